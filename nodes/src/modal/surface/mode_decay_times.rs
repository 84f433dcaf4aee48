//! Decay times of modes under supports, as a node.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{OutPath, Text};
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::{Rate, ticks};
use crate::io::text_output::TextOutput;
use crate::modal::mode::modes::Modes;
use crate::plot::{Axis, Line, chart};
use crate::{archive_state, params, ports};
use std::fmt::Write as _;
use std::sync::Arc;

params! {
    /// Decay times of each mode at given times, under the damping that supports add: `T60 = ln(1000) / (d + added)`.
    ///
    /// The summary prints the median of each time, the table lists every mode, and the figure shows them over frequency.
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), figures 4 and 9: one object under several supports.
    pub struct ModeDecayTimesParams {
        /// Times at which the dampings are read.
        times: Vec<f64>, unit "s", range 0.0..=86_400.0;
        /// A name for each.
        names: Vec<Text> = Vec::new();
        /// CSV with a line per mode.
        table: Option<OutPath> = None;
        /// SVG of the decay times over frequency.
        figure: Option<OutPath> = None;
    }
}
ports! {
    pub struct ModeDecayTimesPorts / ModeDecayTimesIo {
        in {
            /// The modes.
            modes: Value<Modes>,
            /// Decay rates in 1/s that add to those of the modes, from `ContactDamping`.
            damping: Stream<f32>,
        }
        out {}
    }
}

/// `ln(1000)`: nepers of a decay by 60 dB.
const SIXTY_DB: f64 = 6.907_755_278_982_137;

/// The node `ModeDecayTimes`.
#[derive(Debug)]
pub struct ModeDecayTimes {
    modes: Arc<Modes>,
    names: Vec<String>,
    /// Index of the item at each time.
    items: Vec<i64>,
    /// Added dampings at each time; empty if it lies beyond the end.
    added: Vec<Vec<f32>>,
    table: Option<TextOutput>,
    figure: Option<TextOutput>,
}

fn check(p: &ModeDecayTimesParams) -> Result<(), Reject> {
    let (times, names) = (p.times.len(), p.names.len());
    if times == 0 {
        return Err(Reject::new("F078", "there is no time at which to read the damping").at("times"));
    }
    if names != 0 && names != times {
        let message = format!("{names} names for {times} times; none, or one for each, is needed");
        return Err(Reject::new("F078", message).at("names"));
    }
    Ok(())
}

impl ModeDecayTimes {
    /// Decay time of a mode at a time, s.
    fn decay_time(&self, time: usize, mode: usize) -> Option<f64> {
        let added = &self.added[time];
        let added = added.get(mode).or(added.first())?;
        Some(SIXTY_DB / (self.modes.dampings[mode] + f64::from(*added)))
    }

    fn table(&self) -> String {
        let mut text = String::from("mode,frequency_hz");
        self.names.iter().for_each(|name| {
            let _ = write!(text, ",t60_s {}", name.replace([',', '"', '\n'], " "));
        });
        for (mode, frequency) in self.modes.frequencies.iter().enumerate() {
            let _ = write!(text, "\n{mode},{frequency:.3}");
            for time in 0..self.names.len() {
                text += &self.decay_time(time, mode).map_or_else(|| ",".into(), |t60| format!(",{t60:.5}"));
            }
        }
        text + "\n"
    }

    fn figure(&self) -> String {
        let line = |time: usize| {
            let points = self.modes.frequencies.iter().enumerate();
            points.filter_map(|(mode, f)| Some([*f, self.decay_time(time, mode)?])).collect::<Vec<_>>()
        };
        let lines: Vec<Line> =
            self.names.iter().enumerate().map(|(time, name)| Line::dots(name.clone(), line(time))).collect();
        let range = |k: usize| {
            let all = lines.iter().flat_map(|line| &line.points).map(|p| p[k]);
            let (low, high) = all.fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
            if low <= high { [0.8 * low, 1.25 * high] } else { [0.1, 1.0] }
        };
        let frequency = Axis { label: "Frequency (Hz)".into(), range: range(0), log: true };
        let t60 = Axis { label: "T60 (s)".into(), range: range(1), log: true };
        chart("Decay times of the modes", &frequency, &t60, &lines)
    }
}

impl Node for ModeDecayTimes {
    type Params = ModeDecayTimesParams;
    type Ports = ModeDecayTimesPorts;
    const NAME: &'static str = "ModeDecayTimes";
    const CLASS: Class = Class::Offline;

    fn shape(p: &ModeDecayTimesParams, s: &mut Shape<'_, '_, ModeDecayTimesPorts>) -> Result<(), Reject> {
        check(p)?;
        let damping = s.input(ModeDecayTimesPorts::damping);
        if let Some(modes) = s.value(ModeDecayTimesPorts::modes) {
            let n = usize::from(damping.format.0);
            if n != 1 && n != modes.len() {
                let message = format!("`damping` has {n} channels for {} modes", modes.len());
                s.wrong(Reject::new("F046", message).at("damping").help("one channel, or one for each mode"));
            }
        }
        if let (Some(end), Some(late)) = (damping.end, p.times.iter().copied().reduce(f64::max))
            && ticks(late) >= end
        {
            s.note(format!("the damping ends before {late} s: its last values count"));
        }
        s.when_ended(ModeDecayTimesPorts::damping, Ends::Hold);
        Ok(())
    }

    fn build(p: &ModeDecayTimesParams, cx: &Build<'_>) -> Result<Self, Fault> {
        check(p)?;
        let rate: Rate = cx.input(ModeDecayTimesPorts::damping).rate;
        let name = |k: usize| p.names.get(k).map_or_else(|| format!("at {} s", p.times[k]), |n| n.0.clone());
        Ok(Self {
            modes: cx.value(ModeDecayTimesPorts::modes),
            names: (0..p.times.len()).map(name).collect(),
            items: p.times.iter().map(|t| rate.first_at(ticks(*t))).collect(),
            added: vec![Vec::new(); p.times.len()],
            table: TextOutput::open(cx, "table", p.table.as_ref())?,
            figure: TextOutput::open(cx, "figure", p.figure.as_ref())?,
        })
    }

    fn run(&mut self, io: ModeDecayTimesIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.damping.first(), io.damping.width().max(1));
        let items = io.damping.items();
        let count = (items.len() / width) as i64;
        for (item, added) in self.items.iter().zip(&mut self.added) {
            // The latest item up to the time, for a damping that ends before it.
            let index = (item - first).min(count - 1);
            if index >= 0 && *item >= first {
                let at = index as usize * width;
                added.clear();
                added.extend_from_slice(&items[at..at + width]);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: ModeDecayTimesIo<'_>) -> Result<Summary, Fault> {
        let mut summary: Summary = vec![("modes", self.modes.len().into())];
        let medians: Vec<String> = (0..self.names.len())
            .map(|time| {
                let mut all: Vec<f64> =
                    (0..self.modes.len()).filter_map(|mode| self.decay_time(time, mode)).collect();
                all.sort_by(f64::total_cmp);
                let middle = all.get(all.len() / 2).map_or_else(|| "unknown".into(), |t| format!("{t:.3} s"));
                format!("{} {middle}", self.names[time])
            })
            .collect();
        summary.push(("median_t60", medians.join(", ").into()));
        let (table, figure) = (self.table(), self.figure());
        for (file, text) in [(&mut self.table, table), (&mut self.figure, figure)] {
            if let Some(file) = file {
                file.write(&text, &mut summary)?;
            }
        }
        Ok(summary)
    }

    archive_state!(added);

    fn trial(rng: &mut Rng) -> (ModeDecayTimesParams, MemoryFiles) {
        let count = 1 + rng.below(3);
        let times = (0..count).map(|_| rng.between(0.0, 1.5)).collect();
        let names = (0..if rng.below(2) == 0 { 0 } else { count }).map(|k| Text(format!("{k}"))).collect();
        (ModeDecayTimesParams { times, names, table: None, figure: None }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::files::MemoryOutputs;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;

    #[test]
    fn the_table_has_the_decay_time_of_each_mode_at_each_time() {
        let modes = Modes::new("bowl", vec![100.0, 200.0], vec![2.0, 4.0], vec![1.0; 2]).unwrap();
        // At 10 Hz: no damping, then 1 and 3 1/s from 0.5 s on.
        let damping: Vec<f32> = (0..10).flat_map(|k| if k < 5 { [0.0, 0.0] } else { [1.0, 3.0] }).collect();
        let params = ModeDecayTimesParams {
            times: vec![0.2, 0.7],
            names: vec![Text("free".into()), Text("gripped".into())],
            table: Some(OutPath("t.csv".into())),
            figure: Some(OutPath("t.svg".into())),
        };
        let mut standalone = Standalone::new::<ModeDecayTimes>(params)
            .value(ModeDecayTimesPorts::modes, modes)
            .input(ModeDecayTimesPorts::damping, Rate::hz(10), Channels(2), damping);
        standalone.outputs = MemoryOutputs::default();
        let outputs = standalone.outputs.clone();
        let run = standalone.window(ticks(0.13)).run().unwrap();
        let table = String::from_utf8(outputs.get("t.csv").unwrap()).unwrap();
        assert_eq!(
            table,
            "mode,frequency_hz,t60_s free,t60_s gripped\n0,100.000,3.45388,2.30259\n1,200.000,1.72694,0.98682\n"
        );
        assert!(String::from_utf8(outputs.get("t.svg").unwrap()).unwrap().contains("gripped"));
        let text = format!("{:?}", run.summary);
        assert!(text.contains("free 3.454 s, gripped 2.303 s"), "{text}");
    }
}
