//! A bank in reports: its summary, and the figure of its samples in the waveforms of the recordings.

use std::fmt::Write;

use super::crumple_bank::{CrumpleBank, trial_bank};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::plot::escaped;

/// Size of the figure, height of a row and left margin.
const WIDTH: f64 = 960.0;
const ROW: f64 = 90.0;
const LEFT: f64 = 12.0;

/// Draws one row per recording: its outline, and its samples in colour.
fn plot(bank: &CrumpleBank) -> Option<String> {
    let longest = bank.recordings.iter().map(|r| r.seconds).fold(0.0, f64::max);
    let peak = bank.recordings.iter().flat_map(|r| &r.outline).fold(0.0, |peak: f32, x| peak.max(*x));
    if longest <= 0.0 || peak <= 0.0 {
        return None;
    }
    let height = 60.0 + ROW * bank.recordings.len() as f64;
    let scale = (WIDTH - 2.0 * LEFT) / longest;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<text x=\"{LEFT}\" y=\"20\" font-weight=\"bold\">{} samples of {} in {} recordings; the longest lasts {longest:.2} s</text>",
        bank.len(),
        escaped(if bank.material.is_empty() { "cloth" } else { &bank.material }),
        bank.recordings.len()
    );
    for (row, recording) in bank.recordings.iter().enumerate() {
        let (top, middle) = (34.0 + ROW * row as f64, 34.0 + ROW * (row as f64 + 0.55));
        let _ = writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"{:.1}\" fill=\"#555\">{}</text>",
            top + 10.0,
            escaped(&recording.provenance)
        );
        for (k, origin) in bank.origins.iter().enumerate().filter(|(_, o)| o.recording as usize == row) {
            let (x, width) = (LEFT + origin.start * scale, bank.sample(k).len() as f64 / bank.fs * scale);
            let _ = writeln!(
                svg,
                "<rect class=\"sample\" x=\"{x:.2}\" y=\"{:.1}\" width=\"{:.2}\" height=\"{:.1}\" fill=\"#f4a582\" stroke=\"#b2182b\" \
                 stroke-width=\"0.6\"/>",
                middle - 0.4 * ROW,
                width.max(0.5),
                0.8 * ROW
            );
        }
        let step = recording.seconds * scale / recording.outline.len().max(1) as f64;
        let point = |k: usize, sign: f64| {
            let height = 0.38 * ROW * f64::from(recording.outline[k] / peak);
            format!("{:.1},{:.1}", LEFT + (k as f64 + 0.5) * step, middle - sign * height)
        };
        let upper = (0..recording.outline.len()).map(|k| point(k, 1.0));
        let lower = (0..recording.outline.len()).rev().map(|k| point(k, -1.0));
        let points = upper.chain(lower).collect::<Vec<_>>().join(" ");
        let _ = writeln!(svg, "<polygon points=\"{points}\" fill=\"#2166ac\" stroke=\"none\"/>");
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

impl Data for CrumpleBank {
    const NAME: &'static str = "crumple bank";
    const PLOTS: bool = true;

    fn trial(_: &mut Rng) -> Self {
        trial_bank()
    }

    /// Draws the samples in the waveforms of their recordings: figure 8 of An, James and Marschner (2012).
    fn plot(&self) -> Option<String> {
        plot(self)
    }
}

/// Number of samples below which repetitions are audible.
const MIN_SAMPLES: usize = 30;
/// Summary of a bank for the report.
pub(super) fn bank_summary(bank: &CrumpleBank) -> Summary {
    let (weakest, strongest) = (bank.energies.first(), bank.energies.last());
    let mut summary: Summary = vec![
        ("samples", bank.len().into()),
        ("weakest", weakest.copied().unwrap_or(0.0).into()),
        ("strongest", strongest.copied().unwrap_or(0.0).into()),
        ("longest_s", bank.longest().into()),
    ];
    if bank.len() < MIN_SAMPLES {
        let text =
            format!("only {} samples: with fewer than {MIN_SAMPLES} repetitions are audible", bank.len());
        summary.push(("warning", text.into()));
    }
    summary
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crumple::bank::Recorded;

    #[test]
    fn every_sample_has_a_box_in_the_row_of_its_recording() {
        let outline = vec![0.1, 0.9, 0.4];
        let take = |name: &str| Recorded {
            provenance: name.into(),
            seconds: 2.0,
            outline: outline.clone(),
            ..Recorded::default()
        };
        let mut bank = trial_bank();
        bank.recordings = vec![take("a < b.wav"), take("c.wav")];
        bank.origins[2].recording = 1;
        bank.origins[2].start = 1.0;
        let svg = plot(&bank).unwrap();
        assert_eq!((svg.matches("class=\"sample\"").count(), svg.matches("<polygon").count()), (3, 2));
        assert!(svg.contains("a &lt; b.wav") && svg.contains("x=\"480.00\""), "{svg}");
        assert_eq!(plot(&trial_bank()), None);
    }
}
