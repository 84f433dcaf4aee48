//! The figure of takes: the parts that were cut out of each recording.

use super::cutting::{DIGITAL_SILENCE, levels};
use super::takes::{CutRecording, Takes};
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::core::time::Rate;
use crate::plot::{Axis, Line, Span, chart, colour, grid, with_spans};
use crate::unit::UnitSource;

/// Most recordings that are drawn.
const DRAWN: usize = 24;
/// Most takes of a recording that are numbered.
const NUMBERED: usize = 40;
/// Points of a level curve.
const POINTS: usize = 600;

/// One chart per recording, two in a row: its level, its noise floor and its takes.
fn draw(takes: &Takes) -> Option<String> {
    let drawn = takes.recordings.iter().filter(|recording| !recording.is_empty()).take(DRAWN);
    let charts: Vec<String> = drawn.map(|recording| one(recording, takes.rate.as_f64())).collect();
    (!charts.is_empty()).then(|| grid(&charts, 2))
}

fn one(recording: &CutRecording, rate: f64) -> String {
    let (n, inside) = (recording.len(), recording.samples_in_takes());
    let step = n.div_ceil(POINTS).max(1);
    let level = |(k, level): (usize, f64)| [(k * step) as f64 / rate, level.max(DIGITAL_SILENCE)];
    let points: Vec<[f64; 2]> =
        levels(&recording.channels, step, step).into_iter().enumerate().map(level).collect();
    let seconds = n as f64 / rate;
    let lines = [
        Line::new("level", points),
        Line::new("noise floor", vec![[0.0, recording.floor], [seconds, recording.floor]]),
    ];
    let x = Axis { label: "time, s".into(), range: [0.0, seconds], log: false };
    let values = lines.iter().flat_map(|line| line.points.iter().map(|p| p[1]));
    let y = Axis::over("level, dB of full scale", values, false);
    let name = recording.source.provenance.rsplit(['/', '\\']).next().unwrap_or_default();
    let title =
        format!("{name}: {} takes, {:.2} of {seconds:.2} s", recording.takes.len(), inside as f64 / rate);
    let count = recording.takes.len();
    let spans: Vec<Span> = recording
        .takes
        .iter()
        .enumerate()
        .map(|(k, take)| Span {
            range: [take.start, take.end].map(|sample| sample as f64 / rate),
            label: if count <= NUMBERED { format!("{}", k + 1) } else { String::new() },
            colour: colour(2, 3),
            is_full: true,
        })
        .collect();
    with_spans(&chart(&title, &x, &y, &lines), &x, &spans)
}

impl Data for Takes {
    const NAME: &'static str = "takes";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut recording = |k: usize| {
            let x: Vec<f32> = (0..3000).map(|_| rng.between(-0.3, 0.3) as f32).collect();
            CutRecording {
                source: UnitSource { provenance: format!("trial_{k}.wav"), ..UnitSource::default() },
                channels: vec![x],
                takes: vec![0..1200, 1500..3000],
                floor: -60.0,
                gain: 1.0,
            }
        };
        Self { rate: Rate::hz(8000), recordings: (0..2).map(&mut recording).collect() }
    }

    /// Draws the takes in the levels of their recordings.
    fn plot(&self) -> Option<String> {
        draw(self)
    }
}
