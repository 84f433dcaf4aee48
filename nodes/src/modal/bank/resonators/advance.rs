//! Computes the samples of a bank: blocks up to the next grid point, and the update there.

use super::{Bank, BankOutput, MIN_POWER, STEADY};
use crate::modal::bank::fourier_form::Limits;
use crate::modal::bank::kernel::{self, Forces, Part};
use crate::modal::bank::lanes::{GRID, LANES, Lanes};
use crate::modal::bank::two_pole::TwoPole;
use fearless_simd::dispatch;

/// Squared magnitude above which a mode has diverged, because of forces that are not finite or nearly so.
const MAX_POWER: f32 = 1e30;

impl Bank {
    /// Samples until the next grid point: the longest block of [`advance`](Self::advance).
    #[must_use]
    pub fn until_grid(&self) -> usize {
        GRID - self.phase
    }

    /// Returns true if the next sample is a grid point, where [`damp`](Self::damp) takes effect.
    #[must_use]
    pub fn at_grid(&self) -> bool {
        self.phase == 0
    }

    /// Aligns the grid with the next sample, of index `index`.
    pub fn align(&mut self, index: i64) {
        let phase = index.rem_euclid(GRID as i64) as usize;
        if phase != self.phase || self.fourier.as_ref().is_some_and(|fourier| !fourier.is_at(index)) {
            self.leave_two_poles();
        }
        self.phase = phase;
        if let Some(fourier) = self.fourier.as_mut().filter(|fourier| !fourier.is_at(index)) {
            fourier.release(&mut self.lanes, &mut self.awake);
            fourier.set_position(index);
        }
    }

    /// The forces of the next block at a contact point, to be written; empty if the point does not exist. Each is the impulse of its sample
    /// in N s: a force in N over the sample rate.
    pub fn force(&mut self, point: usize) -> &mut [f32] {
        self.forces.get_mut(point).map_or(&mut [], |force| force.as_mut_slice())
    }

    /// Computes `out.len()` samples, at most [`until_grid`](Self::until_grid), under the forces written, and clears the forces.
    pub fn advance(&mut self, out: &mut [f32]) {
        let n = out.len().min(self.until_grid());
        if self.phase == 0 {
            self.grid_point();
        }
        self.active.clear();
        let mut first = n;
        for (point, force) in self.forces.iter_mut().enumerate() {
            let mut on = false;
            for f in &mut force[..n] {
                *f = if f.is_finite() { *f } else { 0.0 };
                on |= *f != 0.0;
            }
            if on {
                self.active.push(point);
                first = first.min(force[..n].iter().position(|f| *f != 0.0).unwrap_or(n));
            }
        }
        let mut sums = [[0.0; LANES]; GRID];
        if self.is_free {
            if first > 0 {
                let Self { level, lanes, two_poles, awake, .. } = self;
                let part = Part { begins: self.phase == 0, ends: self.phase + first == GRID };
                kernel::advance_freely(*level, lanes, two_poles, awake, part, &mut sums[..first]);
                self.phase += first;
            }
            if first < n {
                self.leave_two_poles();
            }
        } else {
            first = 0;
        }
        if !self.active.is_empty() {
            self.quiet = false;
            self.awake.fill(true);
        }
        if !self.is_free {
            let gains = if self.turned.is_empty() { &self.gains } else { &self.turned };
            let forces = Forces { samples: &self.forces, first, active: &self.active, gains };
            kernel::advance(self.level, &mut self.lanes, &self.awake, forces, &mut sums[first..n]);
            self.phase += n - first;
        }
        kernel::sum_lanes(self.level, &sums[..n], &mut out[..n]);
        if self.output == BankOutput::Acceleration {
            for &point in &self.active {
                let direct = self.direct[point];
                out.iter_mut().zip(&self.forces[point][..n]).for_each(|(out, force)| *out += direct * force);
            }
        }
        if let Some(fourier) = &mut self.fourier {
            fourier.add_to(&mut out[..n]);
        }
        self.forces.iter_mut().for_each(|force| force[..n].fill(0.0));
        self.phase %= GRID;
    }

    /// Computes samples under a force at contact point 0, given as the impulse of each sample in N s: a force in N over the sample rate.
    pub fn process(&mut self, force: &[f32], out: &mut [f32]) {
        let (mut force, mut out) = (force, out);
        while !out.is_empty() {
            let n = self.until_grid().min(out.len());
            let (now, later) = force.split_at(n.min(force.len()));
            self.force(0)[..now.len()].copy_from_slice(now);
            let (block, rest) = out.split_at_mut(n);
            self.advance(block);
            (force, out) = (later, rest);
        }
    }

    /// The update at every 64th sample: decayed modes are set to zero, and coefficients follow their targets.
    fn grid_point(&mut self) {
        let floor = if self.quiet { self.floor } else { MIN_POWER };
        let (level, diverged) = (self.level, &mut self.diverged);
        let all = self.lanes.iter_mut().zip(&mut self.awake);
        dispatch!(level, _simd => {
            for (lanes, awake) in all {
                // The common case: all of them sound.
                *awake = *awake && (lanes.all_within(floor, MAX_POWER) || silence(lanes, floor, diverged));
            }
        });
        if let Some(fourier) = self.fourier.as_mut().filter(|_| !self.quiet) {
            fourier.note_force();
        }
        self.quiet = true;
        if self.pitch.is_moving() {
            self.pitch.advance();
            self.set_pitches();
            self.stale = true;
        }
        if self.damping.is_moving() {
            self.damping.advance();
            self.stale = true;
        }
        let changed = std::mem::take(&mut self.stale);
        if changed {
            // By the old coefficients.
            self.release();
            self.set_steps();
        }
        self.steady = if changed { 0 } else { (self.steady + 1).min(STEADY + 1) };
        self.start_hop(changed);
        self.begin_two_poles();
    }

    /// Moves modes to the Fourier form and back, at a grid point.
    fn start_hop(&mut self, changed: bool) {
        let Some(fourier) = &mut self.fourier else { return };
        if changed {
            fourier.spoil();
        } else {
            fourier.refresh_some(&self.groups, self.damping.current());
        }
        let limits = Limits { floor: self.floor, min: MIN_POWER, max: MAX_POWER };
        fourier.start_hop(self.level, &mut self.lanes, &mut self.awake, limits, &mut self.diverged);
    }

    /// Begins a grid interval with two poles, if the coefficients are steady.
    fn begin_two_poles(&mut self) {
        self.is_free = self.steady >= STEADY && self.awake.contains(&true);
        let Self { level, two_poles, lanes, .. } = self;
        if self.steady == STEADY {
            dispatch!(*level, _simd => {
                for (two_pole, lanes) in two_poles.iter_mut().zip(&*lanes) {
                    *two_pole = TwoPole::new(lanes);
                }
            });
        }
    }
}

/// Sets modes to zero that have decayed or diverged; returns true if any other is left.
fn silence(lanes: &mut Lanes, floor: f32, diverged: &mut u64) -> bool {
    let mut awake = false;
    for (re, im) in lanes.re.iter_mut().zip(&mut lanes.im) {
        let size = *re * *re + *im * *im;
        if size > floor && size < MAX_POWER {
            awake = true;
        } else {
            // NaN is not below the maximum either.
            *diverged += u64::from(size.is_nan() || size >= MAX_POWER);
            (*re, *im) = (0.0, 0.0);
        }
    }
    awake
}
