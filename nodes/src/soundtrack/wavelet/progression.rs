//! Sounds that progress from their beginning to their end.

use crate::friction::builder::psd::{AnalysisWindow, Periodogram, centroid};

/// Length of a frame, s.
const FRAME: f64 = 0.25;
/// Minimum share of the variance that a straight line explains if there is a progression.
const EXPLAINED: f64 = 0.5;
/// Least number of frames for a trend.
const MIN_FRAMES: usize = 6;

/// The trend of the level or of the spectral centroid, if a straight line explains more than half of its variance over frames of 0.25 s.
#[must_use]
pub fn progression(x: &[f32], rate: f64) -> Option<String> {
    let len = (FRAME * rate) as usize;
    if len < 4 || x.len() / len < MIN_FRAMES {
        return None;
    }
    let mut periodogram = Periodogram::new(len, rate, AnalysisWindow::Hann);
    let mut density = vec![0.0; periodogram.bins()];
    let df = rate / periodogram.frame_len() as f64;
    let (mut levels, mut centroids) = (Vec::new(), Vec::new());
    for frame in x.chunks_exact(len) {
        let power = frame.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / len as f64;
        levels.push(10.0 * (power + 1e-12).log10());
        density.fill(0.0);
        periodogram.accumulate(frame, &mut density);
        // A constant offset has no pitch.
        density[0] = 0.0;
        centroids.push(centroid(&density, df));
    }
    let of = |values: &[f64], name: &str, unit: &str| {
        let (slope, explained) = line(values);
        let change = slope * (values.len() - 1) as f64;
        let word = if change > 0.0 { "rises" } else { "falls" };
        (explained > EXPLAINED).then(|| format!("its {name} {word} by {:.0} {unit}", change.abs()))
    };
    of(&levels, "level", "dB").or_else(|| of(&centroids, "spectral centroid", "Hz"))
}

/// Slope of the straight line through values, and the share of their variance that it explains.
fn line(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let middle = (n - 1.0) / 2.0;
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (k, y) in values.iter().enumerate() {
        let (x, y) = (k as f64 - middle, y - mean);
        xy += x * y;
        xx += x * x;
        yy += y * y;
    }
    if yy > 1e-9 { (xy / xx, xy * xy / (xx * yy)) } else { (0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_and_centroids_that_change_are_progressions() {
        let tone = |f: &dyn Fn(f64) -> f64, a: &dyn Fn(f64) -> f64| -> Option<String> {
            let mut phase = 0.0;
            let sample = |k: usize| {
                let t = k as f64 / 8000.0;
                phase += std::f64::consts::TAU * f(t) / 8000.0;
                (a(t) * phase.sin()) as f32
            };
            progression(&(0..24_000).map(sample).collect::<Vec<f32>>(), 8000.0)
        };
        assert_eq!(tone(&|_| 440.0, &|_| 0.5), None);
        assert!(tone(&|_| 440.0, &|t| 0.1 + 0.2 * t).unwrap().starts_with("its level rises by"));
        assert!(
            tone(&|t| 2000.0 - 500.0 * t, &|_| 0.5).unwrap().starts_with("its spectral centroid falls by")
        );
        assert_eq!(progression(&[0.0; 100], 8000.0), None);
        assert_eq!(progression(&[0.0; 30_000], 8000.0), None);
    }
}
