//! Reasons to doubt the modes of a recording.

use super::extract::Extracted;

/// Number of samples in a row at the peak that are clipped.
const CLIPPED: usize = 3;
/// Largest relative standard deviation of a certain decay rate.
pub(super) const UNCERTAINTY: f64 = 0.3;
/// Decay rate below which that of a room is suspected, as multiples of the slowest mode.
const ROOM: f64 = 1.3;

/// Warnings of one impact.
pub(super) fn doubts(samples: &[f32], found: &Extracted) -> Vec<String> {
    let mut out = Vec::new();
    let peak = samples.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    // The crest of a wave that decays reaches the peak once; what is clipped does so again and again.
    let runs = samples.chunk_by(|a, b| a == b).filter(|run| run.len() >= CLIPPED && run[0].abs() == peak);
    let clipped = runs.count();
    if clipped > 1 {
        out.push(format!("clipped in {clipped} stretches: record with less gain"));
    }
    let mut decays: Vec<f64> =
        found.features.iter().filter(|f| f.is_certain(UNCERTAINTY)).map(|f| f.decay).collect();
    decays.sort_by(f64::total_cmp);
    // In a room nothing decays more slowly than its sound: the slow half of the modes has one decay.
    if decays.len() >= 8 && decays[0] > 5.0 && decays[decays.len() / 2] < ROOM * decays[0] {
        out.push(format!(
            "half of the modes decay at {:.1} to {:.1} 1/s at all frequencies, as the sound of a room does: record in a dry room",
            decays[0],
            decays[decays.len() / 2]
        ));
    }
    if decays.is_empty() {
        out.push(
            "no mode has a certain decay, so it says nothing of the material: strike harder, or hold the object more loosely"
                .into(),
        );
    }
    out
}
