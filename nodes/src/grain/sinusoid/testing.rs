//! The nodes of this family in sequence, for tests.

use super::additive_resynth::{AdditiveResynth, AdditiveResynthParams, AdditiveResynthPorts};
use super::item::{FrameFormat, TrackPoint};
use super::partial_tracks::{PartialTracks, PartialTracksParams, PartialTracksPorts};
use super::peaks::SinePeak;
use super::sine_peaks::{SinePeaks, SinePeaksParams, SinePeaksPorts};
use crate::core::item::Channels;
use crate::core::params::Params;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, ticks};
use crate::dsp::Trigger;

pub const RATE: Rate = Rate::hz(44_100);

/// Frames of the defaults at 44.1 kHz.
pub fn frames(count: usize) -> (Rate, FrameFormat) {
    (RATE.divided_by(256).unwrap(), FrameFormat { count, hop: 256, window: 2047 })
}

pub fn track_params() -> PartialTracksParams {
    PartialTracksParams::read(&|_| None).unwrap()
}

pub fn peaks(x: &[f32], threshold: f64, window: f64) -> Vec<SinePeak> {
    let params = SinePeaksParams { threshold, ..SinePeaksParams::read(&|_| None).unwrap() };
    let standalone = Standalone::new::<SinePeaks>(params);
    let standalone = standalone.input(SinePeaksPorts::audio, RATE, Channels(1), x.to_vec());
    standalone.window(ticks(window)).run().unwrap().stream(SinePeaksPorts::peaks)
}

pub fn points(peaks: Vec<SinePeak>, params: &PartialTracksParams, window: f64) -> Vec<TrackPoint> {
    let (rate, format) = frames(100);
    let standalone = Standalone::new::<PartialTracks>(params.clone());
    let standalone = standalone.input(PartialTracksPorts::peaks, rate, format, peaks);
    standalone.window(ticks(window)).run().unwrap().stream(PartialTracksPorts::tracks)
}

/// The steady part: `ratio` of the parameter, or of a control.
pub fn resynthesis(
    points: Vec<TrackPoint>,
    (slots, ratio): (usize, f64),
    control: Option<Vec<f32>>,
    attacks: Option<&[usize]>,
    window: f64,
) -> Vec<f32> {
    let (rate, format) = frames(slots);
    let standalone = Standalone::new::<AdditiveResynth>(AdditiveResynthParams { ratio });
    let mut standalone = standalone.input(AdditiveResynthPorts::tracks, rate, format, points);
    if let Some(control) = control {
        standalone = standalone.optional(AdditiveResynthPorts::ratio, RATE, Channels(1), control);
    }
    if let Some(attacks) = attacks {
        let events = attacks.iter().map(|at| (RATE.tick(*at as i64), Trigger::of(1.0))).collect();
        let feed = crate::core::standalone::Feed::events(events, ticks(60.0));
        standalone = standalone.feed(AdditiveResynthPorts::attacks.index(), feed);
    }
    standalone.window(ticks(window)).run().unwrap().stream(AdditiveResynthPorts::steady)
}
