//! The node `ContactReport`.

use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Events, Fold};
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, seconds};
use crate::modal::Impact;
use crate::plot::{Chart, Line};
use crate::rigid::item::{ContactState, State};
use crate::table::{Cell, ResultTable};
use crate::{archive_state, params, ports};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Largest number of rows.
const MAX_ROWS: usize = 100_000;
/// Largest number of points of the figure; beyond it, every second one is left out, again and again.
const MAX_POINTS: usize = 40_000;

params! {
    /// Lists the impacts and the states of contacts, and draws them over time: normal force, speeds and power.
    ///
    /// `table` has a row for each impact, and for each time that a contact remains in one state. Tapped as SVG it shows whether the contacts
    /// of a log are classified as they should be.
    ///
    /// # Source
    /// Figure 4 of Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009): forces
    /// and the contacts that are detected.
    pub struct ContactReportParams {}
}
ports! {
    pub struct ContactReportPorts / ContactReportIo {
        in {
            /// Contacts with their states.
            states: Events<ContactState>,
            /// Impacts.
            impacts: Option<Events<Impact>>,
        }
        out {
            /// The impacts, and the states with their mean speed and power.
            table: Fold<ResultTable>,
        }
    }
}

/// A time that a contact remains in one state.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Span {
    bodies: [u32; 2],
    state: State,
    begin: Tick,
    end: Tick,
    /// Sums over its frames: power, speed, force.
    sums: [f64; 3],
    frames: f64,
}

/// One frame of a contact in the figure.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Point {
    time: f64,
    state: State,
    force: f32,
    speed: f32,
    power: f32,
}

/// Data of the report.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct ContactRecord {
    /// States that last, by contact.
    open: BTreeMap<u64, Span>,
    ended: Vec<Span>,
    impacts: Vec<(Tick, u32, f32, f32)>,
    points: Vec<Point>,
    /// Every so many frames there is a point.
    stride: u64,
    frames: u64,
    left_out: u64,
}

/// The node `ContactReport`.
#[derive(Debug)]
pub struct ContactReport {
    record: ContactRecord,
}

fn name(state: State) -> &'static str {
    match state {
        State::Unsteady => "unsteady",
        State::Static => "static",
        State::Sliding => "sliding",
        State::Rolling => "rolling",
        State::Mixed => "mixed",
    }
}

impl ContactRecord {
    fn end(&mut self, span: Span) {
        if self.ended.len() < MAX_ROWS { self.ended.push(span) } else { self.left_out += 1 }
    }

    fn add(&mut self, tick: Tick, event: &ContactState) {
        let frame = &event.frame;
        let speed = f64::from(event.sliding.max(event.rolling));
        if self.frames.is_multiple_of(self.stride.max(1)) {
            self.points.push(Point {
                time: seconds(tick),
                state: event.state,
                force: frame.force,
                speed: speed as f32,
                power: event.power,
            });
            if self.points.len() >= MAX_POINTS {
                let mut is_left = false;
                self.points.retain(|_| {
                    is_left = !is_left;
                    is_left
                });
                self.stride = 2 * self.stride.max(1);
            }
        }
        self.frames += 1;
        let fresh = Span {
            bodies: frame.bodies,
            state: event.state,
            begin: tick,
            end: tick,
            sums: [0.0; 3],
            frames: 0.0,
        };
        let goes_on = |span: &Span| span.state == event.state && !frame.begins;
        match self.open.get(&frame.contact) {
            Some(span) if goes_on(span) => {}
            None if self.open.len() >= MAX_ROWS => {
                self.left_out += 1;
                return;
            }
            _ => {
                if let Some(ended) = self.open.insert(frame.contact, fresh) {
                    self.end(ended);
                }
            }
        }
        let Some(span) = self.open.get_mut(&frame.contact) else { return };
        span.end = tick + frame.interval;
        span.frames += 1.0;
        for (sum, x) in span.sums.iter_mut().zip([event.power.into(), speed, frame.force.into()]) {
            *sum += x;
        }
        if frame.ends
            && let Some(ended) = self.open.remove(&frame.contact)
        {
            self.end(ended);
        }
    }

    fn table(mut self) -> ResultTable {
        let open = std::mem::take(&mut self.open);
        open.into_values().for_each(|span| self.end(span));
        self.ended.sort_by_key(|span| (span.begin, span.bodies));
        let mut table = ResultTable::new(&[
            "what",
            "begin_s",
            "seconds",
            "body_a",
            "body_b",
            "mean_power_w",
            "mean_speed_m_s",
            "mean_force_n",
            "impulse_n_s",
            "energy_j",
        ]);
        for span in &self.ended {
            let [power, speed, force] = span.sums.map(|sum| sum / span.frames.max(1.0));
            table.push([
                name(span.state).into(),
                seconds(span.begin).into(),
                seconds(span.end - span.begin).into(),
                (span.bodies[0] as usize).into(),
                (span.bodies[1] as usize).into(),
                power.into(),
                speed.into(),
                force.into(),
                Cell::Empty,
                Cell::Empty,
            ]);
        }
        for (tick, object, impulse, energy) in &self.impacts {
            table.push([
                "impact".into(),
                seconds(*tick).into(),
                0.0.into(),
                Cell::Empty,
                (*object as usize).into(),
                Cell::Empty,
                Cell::Empty,
                Cell::Empty,
                f64::from(*impulse).into(),
                f64::from(*energy).into(),
            ]);
        }
        table.charts = self.charts();
        table
    }

    fn charts(&self) -> Vec<Chart> {
        let states = [State::Static, State::Sliding, State::Rolling, State::Mixed, State::Unsteady];
        let dots = |value: &dyn Fn(&Point) -> f64| -> Vec<Line> {
            let of_state = |state: &State| {
                let points = self.points.iter().filter(|p| p.state == *state);
                Line::dots(name(*state), points.map(|p| [p.time, value(p)]).collect())
            };
            states.iter().map(of_state).filter(|line| !line.points.is_empty()).collect()
        };
        let impacts = self.impacts.iter().map(|(tick, _, impulse, _)| [seconds(*tick), f64::from(*impulse)]);
        let time = ("time, s", false);
        let chart = |title: &str, unit: &str, lines| Chart::of(title, time, (unit, false), lines);
        vec![
            chart("normal force", "force, N", dots(&|p| p.force.into())),
            chart("impacts", "impulse, N s", vec![Line::dots("impact", impacts.collect())]),
            chart("speed of slip or of rolling", "speed, m/s", dots(&|p| p.speed.into())),
            chart("dissipated power", "power, W", dots(&|p| p.power.into())),
        ]
    }
}

impl Node for ContactReport {
    type Params = ContactReportParams;
    type Ports = ContactReportPorts;
    const NAME: &'static str = "ContactReport";
    const CLASS: Class = Class::Offline;

    fn shape(_: &ContactReportParams, _: &mut Shape<'_, '_, ContactReportPorts>) -> Result<(), Reject> {
        Ok(())
    }

    fn build(_: &ContactReportParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { record: ContactRecord::default() })
    }

    fn run(&mut self, io: ContactReportIo<'_>) -> Result<(), Fault> {
        for (tick, event) in io.states.events() {
            self.record.add(*tick, event);
        }
        for (tick, impact) in io.impacts.iter().flat_map(|impacts| impacts.events()) {
            if self.record.impacts.len() < MAX_ROWS {
                self.record.impacts.push((*tick, impact.object, impact.impulse, impact.energy));
            } else {
                self.record.left_out += 1;
            }
        }
        Ok(())
    }

    fn finish(&mut self, mut io: ContactReportIo<'_>) -> Result<Summary, Fault> {
        let record = std::mem::take(&mut self.record);
        let (impacts, left_out) = (record.impacts.len(), record.left_out);
        let table = record.table();
        let mut summary = vec![("impacts", impacts.into()), ("states", (table.rows.len() - impacts).into())];
        if left_out > 0 {
            summary.push(("warning", format!("{left_out} rows beyond {MAX_ROWS} were left out").into()));
        }
        io.table.set(table);
        Ok(summary)
    }

    archive_state!(record);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Event;
    use crate::core::random::Rng;
    use crate::core::time::ticks;
    use crate::rigid::item::ContactFrame;

    fn state(contact: u64, state: State, ends: bool) -> ContactState {
        let frame = ContactFrame {
            contact,
            begins: false,
            ends,
            interval: ticks(0.01),
            force: 10.0,
            ..ContactFrame::trial(&mut Rng::new(1))
        };
        ContactState {
            frame,
            state,
            power: 2.0,
            sliding: 0.2,
            rolling: 0.0,
            ..ContactState::trial(&mut Rng::new(2))
        }
    }

    #[test]
    fn successive_frames_of_a_state_are_one_row() {
        let mut record = ContactRecord::default();
        let states = [State::Sliding, State::Sliding, State::Static, State::Sliding];
        for (k, s) in states.into_iter().enumerate() {
            record.add(ticks(0.01 * k as f64), &state(1, s, k == 3));
            record.add(ticks(0.01 * k as f64), &state(2, State::Rolling, false));
        }
        record.impacts.push((ticks(0.02), 1, 0.5, 0.1));
        let table = record.table();
        let texts: Vec<String> = table.rows.iter().map(|row| row[0].text()).collect();
        assert_eq!(texts, ["sliding", "rolling", "static", "sliding", "impact"]);
        let numbers: Vec<String> = table.rows[0].iter().map(Cell::text).collect();
        assert_eq!(numbers[1..8], ["0", "0.0200000", "0", numbers[4].as_str(), "2", "0.200000", "10"]);
        assert_eq!(table.charts.len(), 4);
    }

    #[test]
    fn the_figure_of_a_long_log_is_bounded() {
        let mut record = ContactRecord::default();
        (0..200_000).for_each(|k| record.add(ticks(0.001 * k as f64), &state(1, State::Sliding, false)));
        assert!(record.points.len() <= MAX_POINTS && record.points.len() > MAX_POINTS / 4);
        assert_eq!(record.table().rows.len(), 1);
    }
}
