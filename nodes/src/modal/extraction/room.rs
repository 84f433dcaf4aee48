//! The sound of the room in a recording of an impact.
//!
//! A recording is the sound of the object convolved with the response of the room. So it has the poles of both: modes that ring longer than
//! the room have their own decay, and those that decay faster are followed by the room, whose poles lie around them. The decay of the room
//! cannot be subtracted from that of a mode, but the poles of the room can be left out.

use super::bands::Spectrum;
use super::comparison::decay_time;
use super::feature::Feature;
use super::onset::onset;
use foley_fft::FftPlanner;
use std::f64::consts::{LN_10, TAU};

/// Decay of the room relative to which a mode has to be slower to be one of the object. Poles fitted to a room have from about this share
/// of its decay rate on, since its response is random.
pub const OBJECT: f64 = 0.6;
/// Centres of the octaves in which a room is measured, Hz.
const OCTAVES: [f64; 7] = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0];
/// Half-width of the flat part of an octave filter, octaves.
const FLAT: f64 = 0.5;
/// Minimum share of modes beside louder and slower ones at which a room is suspected, and their minimum number.
const SATELLITES: (f64, usize) = (0.2, 3);
/// Ratio of the decay times of octaves below which they are those of a room, and their least number.
const UNIFORM: (f64, usize) = (1.3, 6);
/// Lowest octave that counts for that, Hz: below, rooms ring longer.
const LOWEST: f64 = 200.0;

/// Reverberation times of a room over frequency.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Room {
    /// Frequency in Hz and time of the decay by 60 dB in s, by frequency.
    bands: Vec<[f64; 2]>,
}

impl Room {
    /// A room of bands (Hz, s) in any order.
    #[must_use]
    pub fn new(mut bands: Vec<[f64; 2]>) -> Self {
        bands.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Self { bands }
    }

    /// Measures a room by the recording of a short sound in it, such as a clap or a balloon that bursts: three times the decay from 5 to
    /// 25 dB below the level at the onset, in octaves of 125 Hz to 8 kHz where it stands above the noise.
    ///
    /// # Complexity
    /// O(samples log samples).
    ///
    /// # Source
    /// ISO 3382-2, T20; Schroeder, "New method of measuring reverberation time" (JASA 37, 1965).
    #[must_use]
    pub fn measured(samples: &[f32], rate: f64) -> Self {
        Self { bands: octave_decays(samples, rate) }
    }

    /// The bands: frequency in Hz and reverberation time in s.
    #[must_use]
    pub fn bands(&self) -> &[[f64; 2]] {
        &self.bands
    }

    /// Decay rate `6.908 / T60` of amplitudes in 1/s, interpolated over log frequency; `None` without bands.
    #[must_use]
    pub fn decay(&self, frequency: f64) -> Option<f64> {
        let rate = |t60: f64| 3.0 * LN_10 / t60;
        let above = self.bands.partition_point(|b| b[0] < frequency);
        let (low, high) = (above.checked_sub(1).map(|k| self.bands[k]), self.bands.get(above));
        match (low, high) {
            (Some(low), Some(high)) => {
                let share = (frequency / low[0]).ln() / (high[0] / low[0]).ln();
                Some(rate(low[1]) * (1.0 - share) + rate(high[1]) * share)
            }
            (Some(band), None) => Some(rate(band[1])),
            (None, band) => band.map(|band| rate(band[1])),
        }
    }

    /// Returns true if a feature decays more slowly than the room, so that it is a mode of the object.
    #[must_use]
    pub fn leaves(&self, feature: &Feature) -> bool {
        self.decay(feature.freq_hz).is_none_or(|d| feature.decay < OBJECT * d)
    }
}

/// Frequency and decay time by 60 dB of the octaves where it can be measured.
fn octave_decays(samples: &[f32], rate: f64) -> Vec<[f64; 2]> {
    let sound: Vec<f64> = samples[onset(samples, rate)..].iter().map(|x| f64::from(*x)).collect();
    let spectrum = Spectrum::new(&sound, rate);
    let mut planner = FftPlanner::new();
    let below = OCTAVES.into_iter().filter(|f| f * 2.0_f64.sqrt() < 0.5 * rate);
    let mut time = |f: f64| Some([f, decay_time(&spectrum.octave(f, FLAT, &mut planner))?]);
    below.filter_map(&mut time).collect()
}

/// A reason to suspect a room, if there is one: certain modes that decay at least twice as fast as a louder one within their own width, as
/// the room around each mode; or octaves that all decay alike.
pub(super) fn suspicion(certain: &[Feature], samples: &[f32], rate: f64) -> Option<String> {
    let energy = |f: &Feature| f.amp * f.amp / f.decay;
    let beside = |f: &&Feature| {
        certain.iter().any(|other| {
            let near = (other.freq_hz - f.freq_hz).abs() < 3.0 * f.decay / TAU;
            near && 2.0 * other.decay < f.decay && energy(other) > energy(f)
        })
    };
    let mut decays: Vec<f64> = certain.iter().filter(beside).map(|f| f.decay).collect();
    decays.sort_by(f64::total_cmp);
    if decays.len() >= SATELLITES.1 && decays.len() as f64 > SATELLITES.0 * certain.len() as f64 {
        return Some(format!(
            "{} of {} modes lie beside slower ones and decay at {:.0} 1/s or faster, as the sound of a room does: record in a dry room, or state `room`",
            decays.len(),
            certain.len(),
            decays[0]
        ));
    }
    let times: Vec<f64> =
        octave_decays(samples, rate).into_iter().filter(|b| b[0] > LOWEST).map(|b| b[1]).collect();
    let (least, most) = times.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), t| (a.min(*t), b.max(*t)));
    (times.len() >= UNIFORM.1 && most < UNIFORM.0 * least).then(|| {
        format!("all octaves decay by 60 dB in {least:.2} to {most:.2} s, as the sound of a room does: record in a dry room, or state `room`")
    })
}

#[cfg(test)]
mod tests {
    use super::super::extract::{ExtractParams, extract};
    use super::*;
    use crate::core::random::Rng;
    use crate::statistics::normal::standard_normal;
    use foley_fft::RealFftPlanner;

    const RATE: f64 = 44_100.0;
    const T60: f64 = 0.3;

    /// A sound in a room whose reverberation has the energy of the direct sound.
    fn in_room(dry: &[f64], rng: &mut Rng) -> Vec<f32> {
        let length = 1 << 17;
        let mut planner = RealFftPlanner::<f64>::new();
        let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
        let transform = |x: &[f64]| {
            let (mut time, mut bins) = (forward.make_input_vec(), forward.make_output_vec());
            time[..x.len()].copy_from_slice(x);
            forward.process(&mut time, &mut bins).unwrap();
            bins
        };
        let decay = 3.0 * LN_10 / T60 / RATE;
        let mut response: Vec<f64> =
            (0..16_000).map(|n| standard_normal(rng) * libm::exp(-decay * f64::from(n))).collect();
        let scale = response.iter().map(|x| x * x).sum::<f64>().sqrt();
        response.iter_mut().for_each(|x| *x /= scale);
        response[0] += 1.0;
        let (mut product, other) = (transform(dry), transform(&response));
        product.iter_mut().zip(&other).for_each(|(a, b)| *a *= b);
        let mut wet = inverse.make_output_vec();
        inverse.process(&mut product, &mut wet).unwrap();
        wet[..dry.len()].iter().map(|x| (x / length as f64 + 1e-5 * standard_normal(rng)) as f32).collect()
    }

    fn struck(modes: &[(f64, f64)]) -> Vec<f64> {
        let mode = |t: f64| {
            let each =
                |(k, (f, d)): (usize, &(f64, f64))| libm::exp(-d * t) * libm::cos(TAU * f * t + k as f64);
            0.1 * modes.iter().enumerate().map(each).sum::<f64>()
        };
        (0..50_000).map(|n: i32| if n < 2000 { 0.0 } else { mode(f64::from(n - 2000) / RATE) }).collect()
    }

    #[test]
    fn modes_in_a_room_of_a_third_of_a_second_are_warned_of_and_are_true_without_the_poles_of_the_room() {
        let mut rng = Rng::new(5);
        let modes: Vec<(f64, f64)> = (0..13)
            .map(|k| {
                let f = 250.0 * 1.33_f64.powi(k) * rng.between(0.97, 1.03);
                (f, 3.0 + 0.5e-8 * (TAU * f).powi(2))
            })
            .collect();
        let params = ExtractParams { contact: true, ..ExtractParams::default() };
        let certain = |samples: &[f32]| -> Vec<Feature> {
            extract(samples, RATE, &params)
                .unwrap()
                .features
                .into_iter()
                .filter(|f| f.is_certain(0.3))
                .collect()
        };
        let dry: Vec<f32> = struck(&modes).iter().map(|x| *x as f32).collect();
        assert_eq!(suspicion(&certain(&dry), &dry, RATE), None);
        let wet = in_room(&struck(&modes), &mut rng);
        let found = certain(&wet);
        let text = suspicion(&found, &wet, RATE).unwrap();
        assert!(text.contains("as the sound of a room"), "{text}");
        let truth = |f: &Feature| {
            let near = |m: &&(f64, f64)| (m.0 / f.freq_hz - 1.0).abs() < 0.01;
            modes.iter().find(near).map(|m| (f.decay / m.1 - 1.0).abs())
        };
        let wrong =
            |all: &[Feature]| all.iter().filter(|f| truth(f).is_none_or(|error| error > 0.15)).count();
        let room = Room::new(vec![[1000.0, T60]]);
        let left: Vec<Feature> = found.iter().filter(|f| room.leaves(f)).copied().collect();
        assert!(wrong(&found) > 10, "{}", wrong(&found));
        assert!(wrong(&left) <= 1 && left.len() >= 9, "{left:?}");
    }

    #[test]
    fn objects_that_decay_faster_than_the_room_are_warned_of() {
        let mut rng = Rng::new(6);
        let modes: Vec<(f64, f64)> = (0..14).map(|k| (200.0 * 1.33_f64.powi(k), 45.0)).collect();
        let wet = in_room(&struck(&modes), &mut rng);
        let text = suspicion(&[], &wet, RATE).unwrap();
        assert!(text.starts_with("all octaves decay by 60 dB in 0.2"), "{text}");
    }

    #[test]
    fn a_clap_gives_the_decay_of_the_room() {
        let mut rng = Rng::new(7);
        let mut clap = vec![0.0; 40_000];
        clap[500] = 1.0;
        let room = Room::measured(&in_room(&clap, &mut rng), RATE);
        assert!(room.bands().len() >= 5, "{room:?}");
        for f in [250.0, 1000.0, 6000.0] {
            let ratio = room.decay(f).unwrap() / (3.0 * LN_10 / T60);
            assert!((0.75..1.3).contains(&ratio), "{f}: {ratio}");
        }
        assert!(Room::measured(&[0.0; 5000], RATE).bands().is_empty());
    }

    #[test]
    fn decays_are_interpolated_over_log_frequency() {
        let room = Room::new(vec![[4000.0, 0.2], [1000.0, 0.4]]);
        let [slow, fast] = [0.4, 0.2].map(|t| 3.0 * LN_10 / t);
        assert!((room.decay(2000.0).unwrap() - 0.5 * (slow + fast)).abs() < 1e-9);
        assert_eq!((room.decay(100.0), room.decay(9000.0)), (Some(slow), Some(fast)));
        assert_eq!(Room::default().decay(100.0), None);
        assert!(Room::default().leaves(&Feature::default()));
    }
}
