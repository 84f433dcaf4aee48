//! The figure of a comparison.

use super::active::LOWEST;
use super::envelope_lines::{EnvelopeSpectrum, HarmonicLine};
use super::report::{Likeness, Statistic};
use crate::plot::{Axis, Chart, Line, Span, chart_over, grid_below, with_spans};

/// Repeats and joins that are marked over the whole height of the spectrogram.
const MARKED: [usize; 2] = [6, 4];
/// Lowest value of the spectrum of the envelope that is drawn, dB.
const LEAST_CONTRAST: f64 = -4.0;
/// Points of a distribution.
const POINTS: usize = 200;

/// Curves of the figure only: each of the sound and of the recordings.
pub(super) struct Distributions {
    /// Levels of frames, dB of full scale.
    pub levels: [Vec<f64>; 2],
    /// Sorted levels above 8 kHz: at joins, between them, and in the recordings.
    pub joins: Option<([Vec<f64>; 2], Vec<f64>)>,
    /// Spectrum of the envelope of the sound.
    pub spectrum: Option<EnvelopeSpectrum>,
}

/// Share of values up to each.
fn cumulative(label: &str, sorted: &[f64]) -> Line {
    let last = sorted.len().saturating_sub(1).max(1);
    let point = |k: usize| {
        let at = k * last / POINTS;
        Some([*sorted.get(at)?, at as f64 / last as f64])
    };
    Line::new(label, (0..=POINTS).filter_map(point).collect())
}

/// A value of the sound and the range of the recordings, against a frequency.
fn ranges(
    likeness: &Likeness,
    title: &str,
    (x, y): (&str, (&str, bool)),
    at: impl Fn(&Statistic) -> Option<f64>,
) -> Chart {
    let line = |label: &str, of: &dyn Fn(&Statistic) -> Option<f64>| {
        let points = likeness.statistics.iter().filter_map(|s| Some([at(s)?, of(s)?])).collect();
        Line::new(label, points)
    };
    let lines = vec![
        line("sound", &|s| s.sound),
        line("lowest take", &|s| s.low),
        line("all recordings", &|s| s.recordings),
        line("highest take", &|s| s.high),
    ];
    Chart::of(title, (x, true), y, lines)
}

/// All charts below the spectrogram.
pub(super) fn charts(likeness: &Likeness, found: &Distributions) -> Vec<Chart> {
    let frequency = "frequency, Hz";
    let of = |quantity: &'static str| move |s: &Statistic| s.band_hz.filter(|_| s.quantity == quantity);
    let mut charts = vec![
        ranges(
            likeness,
            "Thirds of an octave",
            (frequency, ("share of the energy, dB", false)),
            of("third octave"),
        ),
        ranges(likeness, "Kurtosis by octave", (frequency, ("kurtosis", true)), of("kurtosis")),
    ];
    let modulation = |s: &Statistic| {
        let [low, high] = s.modulation_hz.filter(|_| s.band_hz.is_none())?;
        Some((low * high).sqrt())
    };
    let axes = ("modulation frequency, Hz", ("power of the envelope, dB", false));
    charts.push(ranges(likeness, "Modulation spectrum", axes, modulation));
    if let (Some(spectrum), Some(report)) = (&found.spectrum, &likeness.lines) {
        // A stem for each line.
        let stems = |label: &str, of: &dyn Fn(&HarmonicLine) -> Option<f64>| {
            let stem = |line: &HarmonicLine| Some([0.0, of(line)?, 0.0].map(|db| [line.hz, db]));
            Line::new(label, report.lines.iter().filter_map(stem).flatten().collect())
        };
        let contrast = spectrum.contrast().into_iter().map(|[hz, db]| [hz, db.max(LEAST_CONTRAST)]);
        let lines = vec![
            Line::new("sound", contrast.collect()),
            stems("recordings", &|line| line.recordings_db),
            stems("lines", &|line| Some(line.db)),
        ];
        let title = "Envelope, relative to the neighbourhood of each frequency";
        charts.push(Chart::of(title, (frequency, false), ("dB", false), lines));
    }
    if let Some(([joins, between], recorded)) = &found.joins {
        let lines = vec![
            cumulative("at joins", joins),
            cumulative("between joins", between),
            cumulative("recordings", recorded),
        ];
        let x = ("level above 8 kHz in 5 ms, dB relative to the whole", false);
        charts.push(Chart::of("Joins", x, ("share that is softer", false), lines));
    }
    let level = |label: &str, levels: &[f64]| {
        let mut levels = levels.to_vec();
        levels.sort_unstable_by(f64::total_cmp);
        let loudest = levels.last().copied().unwrap_or(0.0);
        levels.iter_mut().for_each(|x| *x -= loudest);
        cumulative(label, &levels)
    };
    let lines = vec![level("sound", &found.levels[0]), level("recordings", &found.levels[1])];
    let x = ("level of 25 ms, dB relative to the loudest", false);
    charts.push(Chart::of("Levels", x, ("share that is softer", false), lines));
    charts
}

/// The spectrogram with its marks at twice the size of the charts below it.
pub(super) fn draw(likeness: &Likeness) -> String {
    let seconds = likeness.sound.seconds.max(1e-3);
    let x = Axis { label: "time, s".into(), range: [0.0, seconds], log: false };
    let range = [LOWEST, likeness.highest_hz.max(2.0 * LOWEST)];
    let y = Axis { label: "frequency, Hz".into(), range, log: true };
    let lines = [Line::new("joins", Vec::new()), Line::new("repeats", Vec::new())];
    let colours = [0, 1].map(|k| crate::plot::colour(k, lines.len()));
    let share = likeness.repeats.share.map_or("-".into(), |share| format!("{:.1} %", 100.0 * share));
    let lag = |lag: f64| format!("{lag:.2} s before");
    let mut spans: Vec<Span> = Vec::new();
    for (k, s) in likeness.repeats.longest.iter().enumerate() {
        let label = if k < MARKED[0] { lag(s.lag) } else { String::new() };
        spans.push(Span { range: [s.from, s.to], label, colour: colours[1].clone(), is_full: k < MARKED[0] });
    }
    let loud = likeness.joins.iter().flat_map(|joins| joins.loudest.iter().filter(|j| j.excess_db > 0.0));
    for (k, place) in loud.enumerate() {
        let label = if k < MARKED[1] { format!("{:+.1} dB", place.excess_db) } else { String::new() };
        let around = [place.at - 0.0025, place.at + 0.0025];
        spans.push(Span { range: around, label, colour: colours[0].clone(), is_full: k < MARKED[1] });
    }
    let title =
        format!("{share} of the active frames repeat part of the {} s before", likeness.repeats.window_s);
    let picture = Some(&likeness.picture).filter(|picture| !picture.is_empty());
    let top = with_spans(&chart_over(picture, &title, &x, &y, &lines), &x, &spans);
    let below: Vec<String> = likeness.charts.iter().map(Chart::draw).collect();
    grid_below(&top, &below, 2)
}
