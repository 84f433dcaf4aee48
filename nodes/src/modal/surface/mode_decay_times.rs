//! Decay times of modes under supports, as a node.

use super::mode_shapes::ModeShapes;
use super::support::{Support, Supports};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{OutPath, Text};
use crate::core::ports::{Events, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, ticks};
use crate::io::text_output::TextOutput;
use crate::modal::mode::modes::Modes;
use crate::plot::{Axis, Line, chart};
use crate::{archive_state, params, ports};
use std::fmt::Write as _;
use std::sync::Arc;

params! {
    /// Decay times of each mode at given times, under the damping that supports add: `T60 = ln(1000) / (d + G / 2)`.
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
        /// Maximum distance of a support from the surface, relative to the size of the object.
        max_off_surface: f64 = 0.05, unit "", range 0.0..=1000.0;
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
            /// Their shapes on the surface.
            shapes: Value<ModeShapes>,
            /// The supports, from `ContactDamping`.
            supports: Events<Support>,
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
    /// Times in order, as ticks, with the index of each.
    times: Vec<(Tick, usize)>,
    /// Number of these whose dampings are known.
    passed: usize,
    supports: Supports,
    /// Added decay rates at each time, 1/s; empty before it.
    added: Vec<Vec<f64>>,
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
        let added = self.added[time].get(mode)?;
        Some(SIXTY_DB / (self.modes.dampings[mode] + added))
    }

    /// Reads the dampings at the times before a tick.
    fn pass(&mut self, tick: Tick) {
        while let Some((time, index)) = self.times.get(self.passed)
            && *time < tick
        {
            self.added[*index] = self.supports.target().to_vec();
            self.passed += 1;
        }
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
        let known = s.value(ModeDecayTimesPorts::modes).zip(s.value(ModeDecayTimesPorts::shapes));
        if let Some(reject) = known.and_then(|(modes, shapes)| shapes.mismatch(&modes)) {
            s.wrong(reject);
        }
        Ok(())
    }

    fn build(p: &ModeDecayTimesParams, cx: &Build<'_>) -> Result<Self, Fault> {
        check(p)?;
        let (modes, shapes) = (cx.value(ModeDecayTimesPorts::modes), cx.value(ModeDecayTimesPorts::shapes));
        if let Some(reject) = shapes.mismatch(&modes) {
            return Err(reject.into());
        }
        let mut times: Vec<(Tick, usize)> = p.times.iter().map(|t| ticks(*t)).zip(0..).collect();
        times.sort_unstable();
        let name = |k: usize| p.names.get(k).map_or_else(|| format!("at {} s", p.times[k]), |n| n.0.clone());
        Ok(Self {
            modes,
            names: (0..p.times.len()).map(name).collect(),
            times,
            passed: 0,
            supports: Supports::new(shapes, p.max_off_surface),
            added: vec![Vec::new(); p.times.len()],
            table: TextOutput::open(cx, "table", p.table.as_ref())?,
            figure: TextOutput::open(cx, "figure", p.figure.as_ref())?,
        })
    }

    fn run(&mut self, io: ModeDecayTimesIo<'_>) -> Result<(), Fault> {
        for (tick, support) in io.supports.events() {
            self.pass(*tick);
            self.supports.take(support);
        }
        Ok(())
    }

    fn finish(&mut self, _: ModeDecayTimesIo<'_>) -> Result<Summary, Fault> {
        self.pass(Tick::MAX);
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
        summary.extend(self.supports.warning().map(|text| ("warning", text.into())));
        Ok(summary)
    }

    archive_state!(passed, supports, added);

    fn trial(rng: &mut Rng) -> (ModeDecayTimesParams, MemoryFiles) {
        let count = 1 + rng.below(3);
        let times = (0..count).map(|_| rng.between(0.0, 1.5)).collect();
        let names = (0..if rng.below(2) == 0 { 0 } else { count }).map(|k| Text(format!("{k}"))).collect();
        let params = ModeDecayTimesParams { times, names, max_off_surface: 50.0, table: None, figure: None };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::files::MemoryOutputs;
    use crate::core::item::Data;
    use crate::core::standalone::Standalone;

    #[test]
    fn the_table_has_the_decay_time_of_each_mode_at_each_time() {
        let modes = Modes::new("bowl", vec![100.0, 200.0], vec![2.0, 4.0], vec![1.0; 2]).unwrap();
        // All displacements of the first mode are (1, 0, 0), and those of the second (0, 0, 1).
        let shapes = ModeShapes {
            shapes: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0].repeat(4),
            gains: vec![1.0; 2],
            ..ModeShapes::trial(&mut Rng::new(1))
        };
        // On the face z = 0: half of 4 (mu |phi|^2 + (1 - mu) (n phi)^2) is 1 and 2 1/s.
        let support = Support { id: 1, local: [0.02, 0.02, 0.0], coefficient: 4.0, mu: 0.5, release: 0.1 };
        let events = vec![(ticks(0.5), support), (ticks(0.8), Support { coefficient: 0.0, ..support })];
        let params = ModeDecayTimesParams {
            times: vec![0.7, 0.2, 5.0],
            names: ["gripped", "free", "again"].map(|n| Text(n.into())).to_vec(),
            max_off_surface: 0.05,
            table: Some(OutPath("t.csv".into())),
            figure: Some(OutPath("t.svg".into())),
        };
        let mut standalone = Standalone::new::<ModeDecayTimes>(params)
            .value(ModeDecayTimesPorts::modes, modes)
            .value(ModeDecayTimesPorts::shapes, shapes)
            .events(ModeDecayTimesPorts::supports, events, ticks(1.0));
        standalone.outputs = MemoryOutputs::default();
        let outputs = standalone.outputs.clone();
        let run = standalone.window(ticks(0.13)).run().unwrap();
        let table = String::from_utf8(outputs.get("t.csv").unwrap()).unwrap();
        assert_eq!(
            table,
            "mode,frequency_hz,t60_s gripped,t60_s free,t60_s again\n0,100.000,2.30259,3.45388,3.45388\n1,200.000,1.15129,1.72694,1.72694\n"
        );
        assert!(String::from_utf8(outputs.get("t.svg").unwrap()).unwrap().contains("gripped"));
        let text = format!("{:?}", run.summary);
        assert!(text.contains("gripped 2.303 s, free 3.454 s"), "{text}");
    }
}
