//! Loudness of an object under a force of known strength.

use super::resonators::{Bank, BankOutput};
use crate::dsp::{Reference, Weighting, weighted_rms};
use crate::modal::mode::modes::{Modes, ModesError};

/// Level of the sound of a white force of 1 N RMS with normalized gains.
const REFERENCE: f64 = 0.01;
/// Sample rate of the responses, Hz.
const RATE: f64 = 48_000.0;
/// Bandwidth of the force, Hz.
const BANDWIDTH: f64 = 20_000.0;
/// Longest response, s.
const LONGEST: f64 = 4.0;
/// Decay up to which a response is computed, nepers: 60 dB.
const DECAY: f64 = 6.908;
/// Largest number of contact points whose responses are averaged.
const POINTS: usize = 8;

/// K-weighted RMS of the sound of modes under a force of 1 N RMS with a constant power density up to 20 kHz, averaged over contact points.
///
/// It follows from the energy of the response to an impulse, by displacement, so that modes that cancel each other do not add to it.
///
/// # Errors
/// As [`Modes::validate`].
///
/// # Complexity
/// O(modes) for each of up to 192,000 samples and 8 contact points.
pub fn loudness(modes: &Modes) -> Result<f64, ModesError> {
    modes.validate()?;
    let slowest = modes.dampings.iter().copied().fold(f64::INFINITY, f64::min);
    let samples = (RATE * (DECAY / slowest).min(LONGEST)) as usize + 1;
    let step = modes.points().div_ceil(POINTS);
    let mut bank = Bank::new(modes, RATE, BankOutput::Displacement)?;
    let silent = bank.clone();
    let mut energies = Vec::with_capacity(POINTS);
    for point in (0..modes.points()).step_by(step.max(1)) {
        bank.clone_from(&silent);
        let mut response = vec![0.0; samples];
        if let Some(force) = bank.force(point).first_mut() {
            *force = 1.0;
        }
        let (head, tail) = response.split_at_mut(bank.until_grid().min(samples));
        bank.advance(head);
        bank.process(&[], tail);
        energies.push(weighted_rms(&response, RATE, Weighting::K).powi(2) * samples as f64 / RATE);
    }
    let mean = energies.iter().sum::<f64>() / energies.len().max(1) as f64;
    // A power density of 1 / BANDWIDTH for positive frequencies.
    Ok((mean / (2.0 * BANDWIDTH)).sqrt())
}

/// Scale of the gains of modes: 1 for [`Reference::Absolute`], else the scale at which a white force of 1 N RMS has a level of -40 dB.
///
/// # Errors
/// As [`Modes::validate`].
pub(in crate::modal) fn unit(modes: &Modes, reference: Reference) -> Result<f64, ModesError> {
    Ok(match reference {
        Reference::Absolute => 1.0,
        Reference::Normalized => reference.unit(loudness(modes)? / REFERENCE),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn a_white_force_sounds_as_loud_as_stated() {
        let modes = Modes::new("two", vec![400.0, 3000.0], vec![30.0, 50.0], vec![2.0, 0.7]).unwrap();
        let mut rng = Rng::new(4);
        // White up to half of the rate, of a density of 1 N^2 in 20 kHz.
        let deviation = (0.5 * RATE / BANDWIDTH).sqrt();
        let force: Vec<f32> = (0..960_000)
            .map(|_| (deviation * 3.0_f64.sqrt() * rng.between(-1.0, 1.0) / RATE) as f32)
            .collect();
        let mut sound = vec![0.0; force.len()];
        Bank::new(&modes, RATE, BankOutput::Displacement).unwrap().process(&force, &mut sound);
        let (found, right) = (loudness(&modes).unwrap(), weighted_rms(&sound, RATE, Weighting::K));
        assert!((found / right - 1.0).abs() < 0.03, "{found} {right}");
    }

    #[test]
    fn modes_that_cancel_each_other_are_soft_and_points_are_averaged() {
        let one = Modes::new("one", vec![500.0], vec![10.0], vec![1.0]).unwrap();
        let pair = Modes::new("pair", vec![500.0, 500.0], vec![10.0, 10.0], vec![10.0, -9.0]).unwrap();
        let [a, b] = [&one, &pair].map(|modes| loudness(modes).unwrap());
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
        let points = Modes { gains: vec![1.0, 3.0], ..one };
        assert!((loudness(&points).unwrap() / a - 5.0_f64.sqrt()).abs() < 1e-3);
    }
}
