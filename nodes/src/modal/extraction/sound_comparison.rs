//! Compares a sound with a recording, as a node.

use super::comparison::{Comparison, compare};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary, same_rate};
use crate::core::params::OutPath;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::io::text_output::TextOutput;
use crate::plot::{Axis, Line, beside, chart};
use crate::{archive_state, params, ports};
use std::fmt::Write as _;

params! {
    /// Compares a sound with a reference, such as a resynthesis with its recording, from the onset of the reference to its end.
    ///
    /// The summary lists the energy of the difference, the median and the largest difference of thirds of an octave within 40 dB of the
    /// loudest, the median difference of decay times per octave, and the spectral distance of the first 300 ms. Channels are averaged.
    ///
    /// # Source
    /// Schroeder, "New method of measuring reverberation time" (JASA 37, 1965), for decay times.
    pub struct SoundComparisonParams {
        /// CSV of the bands: level and decay time in both sounds.
        table: Option<OutPath> = None;
        /// SVG of the same.
        figure: Option<OutPath> = None;
    }
}
ports! {
    pub struct SoundComparisonPorts / SoundComparisonIo {
        in {
            /// The recording.
            reference: Stream<f32>,
            /// The sound to compare, at the same sample rate.
            audio: Stream<f32>,
        }
        out {}
    }
}

/// Longest sound, s.
const LONGEST: f64 = 600.0;

/// The node over [`compare`].
#[derive(Debug)]
pub struct SoundComparison {
    rate: Rate,
    sounds: [Vec<f32>; 2],
    table: Option<TextOutput>,
    figure: Option<TextOutput>,
}

fn table(c: &Comparison) -> String {
    let mut text = String::from("band,centre_hz,reference,audio,unit\n");
    for b in &c.levels {
        let _ = writeln!(text, "third_octave,{:.1},{:.2},{:.2},dB", b.centre, b.reference_db, b.audio_db);
    }
    for b in &c.decays {
        let _ = writeln!(text, "octave,{:.1},{:.4},{:.4},s", b.centre, b.reference_s, b.audio_s);
    }
    text
}

fn figure(c: &Comparison) -> String {
    let range = |values: &mut dyn Iterator<Item = f64>, margin: f64| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if low <= high { [low - margin, high + margin] } else { [0.0, 1.0] }
    };
    let frequency = Axis { label: "Frequency (Hz)".into(), range: [20.0, 22_000.0], log: true };
    let levels = Axis {
        label: "Energy (dB)".into(),
        range: range(
            &mut c.levels.iter().flat_map(|b| [b.reference_db, b.audio_db.max(b.reference_db - 20.0)]),
            3.0,
        ),
        log: false,
    };
    let times = Axis {
        label: "3 x T20 (s)".into(),
        range: [0.0, range(&mut c.decays.iter().flat_map(|b| [b.reference_s, b.audio_s]), 0.0)[1] * 1.1],
        log: false,
    };
    let level =
        |of: fn(&super::comparison::BandLevel) -> f64| c.levels.iter().map(|b| [b.centre, of(b)]).collect();
    let time =
        |of: fn(&super::comparison::BandDecay) -> f64| c.decays.iter().map(|b| [b.centre, of(b)]).collect();
    beside(&[
        chart(
            "Thirds of an octave",
            &frequency,
            &levels,
            &[Line::new("reference", level(|b| b.reference_db)), Line::new("sound", level(|b| b.audio_db))],
        ),
        chart(
            "Decay",
            &frequency,
            &times,
            &[Line::new("reference", time(|b| b.reference_s)), Line::new("sound", time(|b| b.audio_s))],
        ),
    ])
}

impl Node for SoundComparison {
    type Params = SoundComparisonParams;
    type Ports = SoundComparisonPorts;
    const NAME: &'static str = "SoundComparison";
    const CLASS: Class = Class::Offline;

    fn shape(_: &SoundComparisonParams, s: &mut Shape<'_, '_, SoundComparisonPorts>) -> Result<(), Reject> {
        let (reference, audio) =
            (s.input(SoundComparisonPorts::reference), s.input(SoundComparisonPorts::audio));
        s.check(same_rate("audio", audio.rate, "`reference`", reference.rate));
        let longest = reference.rate.first_at(crate::core::time::ticks(LONGEST));
        if let Some(end) = reference.end.filter(|end| *end > reference.rate.tick(longest)) {
            let length = crate::core::time::seconds(end);
            s.note(format!("of {length:.0} s the first {LONGEST} s are compared"));
        }
        Ok(())
    }

    fn build(p: &SoundComparisonParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self {
            rate: cx.input(SoundComparisonPorts::reference).rate,
            sounds: [Vec::new(), Vec::new()],
            table: TextOutput::open(cx, "table", p.table.as_ref())?,
            figure: TextOutput::open(cx, "figure", p.figure.as_ref())?,
        })
    }

    fn run(&mut self, io: SoundComparisonIo<'_>) -> Result<(), Fault> {
        let longest = (LONGEST * self.rate.as_f64()) as usize;
        for (sound, input) in self.sounds.iter_mut().zip([&io.reference, &io.audio]) {
            let width = input.width().max(1);
            for frame in input.items().chunks_exact(width) {
                if sound.len() < longest {
                    sound.push(frame.iter().sum::<f32>() / width as f32);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: SoundComparisonIo<'_>) -> Result<Summary, Fault> {
        let [reference, audio] = &self.sounds;
        let found = compare(reference, audio, self.rate.as_f64());
        let mut summary = Summary::new();
        let onset = found.onset as f64 / self.rate.as_f64();
        summary.push(("onset_s", onset.into()));
        summary.push(("difference_db", found.difference_db.into()));
        summary.push(("difference_after_5_ms_db", found.late_difference_db.into()));
        if let Some([median, max]) = found.level_differences() {
            summary.push(("third_octaves_median_db", median.into()));
            summary.push(("third_octaves_largest_db", max.into()));
        }
        if let Some(difference) = found.decay_difference() {
            summary.push(("decay_times_median", difference.into()));
        }
        summary.push(("spectral_distance_db", found.spectral_distance_db.into()));
        if reference.iter().all(|x| *x == 0.0) {
            summary.push(("warning", "the reference is silent".into()));
        }
        for (file, text) in [(&mut self.table, table(&found)), (&mut self.figure, figure(&found))] {
            if let Some(file) = file {
                file.write(&text, &mut summary)?;
            }
        }
        Ok(summary)
    }

    archive_state!(sounds);

    fn trial(_: &mut Rng) -> (SoundComparisonParams, MemoryFiles) {
        (SoundComparisonParams { table: None, figure: None }, MemoryFiles::default())
    }
}
