//! Reasons to doubt the modes of a recording.

use super::extract::Extracted;
use super::feature::Feature;
use super::room::{Room, suspicion};

/// Number of samples in a row at the peak that are clipped.
const CLIPPED: usize = 3;
/// Largest relative standard deviation of a certain decay rate.
pub(super) const UNCERTAINTY: f64 = 0.3;

/// Warnings of one impact at `rate` samples a second in a room, whose decay may be unknown.
pub(super) fn warnings(samples: &[f32], rate: f64, found: &Extracted, room: &Room) -> Vec<String> {
    let mut out = Vec::new();
    let peak = samples.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    // The crest of a wave that decays reaches the peak once; what is clipped does so again and again.
    let runs = samples.chunk_by(|a, b| a == b).filter(|run| run.len() >= CLIPPED && run[0].abs() == peak);
    let clipped = runs.count();
    if clipped > 1 {
        out.push(format!("clipped in {clipped} stretches: record with less gain"));
    }
    let certain: Vec<Feature> =
        found.features.iter().filter(|f| f.is_certain(UNCERTAINTY)).copied().collect();
    if room.bands().is_empty() {
        out.extend(suspicion(&certain, samples, rate));
    }
    let object = certain.iter().filter(|f| room.leaves(f)).count();
    if object < certain.len() {
        out.push(format!(
            "{} of {} modes decay like the room or faster and are left out: they do not measure the damping of the material",
            certain.len() - object,
            certain.len()
        ));
    }
    if object == 0 {
        out.push(
            "no mode has a certain decay, so the recording does not measure the material: strike harder, or hold the object more loosely"
                .into(),
        );
    }
    out
}
