//! Silence of a target: the gate that fades the output out, and the gate of units whose output is silent.

use crate::impl_state;

/// Magnitude up to which a target is silent: -100 dBFS, the floor below which features cannot distinguish sounds.
pub const SILENT: f32 = 1e-5;
/// Silence before the output fades, and duration of the fade, s.
const HOLD: f64 = 0.5;
const RELEASE: f64 = 0.05;

/// Gate that fades the output out while the target is silent.
///
/// After 0.5 s of silence in the target the output fades to exact zero in 50 ms; it fades in within 5 ms. The gate is closed
/// before the first sound of the target, so that a silent target results in silence without room tone.
#[derive(Clone, Debug)]
pub struct SilenceGate {
    /// Samples of silence before the fade.
    hold: u64,
    /// Level per sample, down and up.
    release: f32,
    attack: f32,
    silent: u64,
    /// None before the first sample.
    level: Option<f32>,
}
impl_state!(SilenceGate { silent, level });

impl SilenceGate {
    /// Open if the target begins with sound, closed if it begins with silence.
    #[must_use]
    pub fn new(rate: f64) -> Self {
        let samples = |seconds: f64| (seconds * rate).round().max(1.0);
        let hold = samples(HOLD) as u64;
        Self {
            hold,
            release: (1.0 / samples(RELEASE)) as f32,
            attack: (1.0 / samples(0.005)) as f32,
            silent: hold,
            level: None,
        }
    }

    /// Returns the gain of the next sample; `silent` is true if the target is silent there.
    pub fn next(&mut self, silent: bool) -> f32 {
        self.silent = if silent { self.silent.saturating_add(1) } else { 0 };
        let step = if self.silent > self.hold { -self.release } else { self.attack };
        let before = self.level.unwrap_or(if silent { 0.0 } else { 1.0 });
        let level = (before + step).clamp(0.0, 1.0);
        self.level = Some(level);
        level
    }
}

/// Gate over units: closed while [`SilenceGate`] mutes the entire output of a unit.
#[derive(Clone, Debug)]
pub struct UnitGate {
    hold: usize,
    silent: usize,
}
impl_state!(UnitGate { silent });

impl UnitGate {
    /// For `rate` units per second; closed until the first that is not silent.
    #[must_use]
    pub fn new(rate: f64) -> Self {
        // The last sound may lie at the end of its unit, and the last fading unit has to be complete.
        let hold = ((HOLD + RELEASE) * rate - 1e-9).ceil() as usize + 2;
        Self { hold, silent: hold }
    }

    /// Returns true if the gate is closed for the next unit; `silent` is true if the target is silent in it.
    pub fn next(&mut self, silent: bool) -> bool {
        self.silent = if silent { self.silent.saturating_add(1) } else { 0 };
        self.silent > self.hold
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleep_comes_after_half_a_second_and_ends_at_once() {
        let mut gate = SilenceGate::new(1000.0);
        let mut gains = |n: usize, silent| (0..n).map(|_| gate.next(silent)).collect::<Vec<_>>();
        assert!(gains(100, false).iter().chain(&gains(500, true)).all(|&g| g == 1.0));
        let fade = gains(60, true);
        assert!(fade[0] < 1.0 && fade[25] > 0.4 && fade[48] > 0.0 && fade[52..].iter().all(|&g| g == 0.0));
        assert_eq!(gains(6, false)[4..], [1.0, 1.0]);
    }

    #[test]
    fn nothing_is_heard_before_the_first_sound() {
        let mut gate = SilenceGate::new(1000.0);
        let mut gains = |n: usize, silent| (0..n).map(|_| gate.next(silent)).collect::<Vec<_>>();
        assert!(gains(20, true).iter().all(|&g| g == 0.0));
        let woken = gains(6, false);
        assert!(woken[0] > 0.0 && woken[0] < 1.0 && woken[5] == 1.0, "{woken:?}");
        assert!(gains(500, true).iter().all(|&g| g == 1.0));
        let mut doze = UnitGate::new(240.0);
        assert!(doze.next(true) && doze.next(true) && !doze.next(false) && !doze.next(true));
    }
}
