//! Changes while a bank sounds: dampings, pitch, coupling and contact points.

use super::*;

impl Bank {
    /// Sets factors of all dampings and frequencies at once; later changes are reached in `ramp` samples.
    pub fn start(&mut self, damping: f64, pitch: f64, ramp: u64) {
        let steps = ramp.div_ceil(GRID as u64);
        self.damping = Gain::new(damping, steps, 1);
        self.pitch = Gain::new(pitch, steps, 1);
        self.set_pitches();
        self.stale = true;
    }

    /// Sets the targets of the factors of all dampings and frequencies.
    pub fn glide(&mut self, damping: f64, pitch: f64) {
        self.damping.set_target(damping);
        self.pitch.set_target(pitch);
    }

    /// Sets factors of the dampings from the next grid point, in addition to that of [`start`](Self::start).
    ///
    /// # Shapes
    /// One factor for all modes, or one for each mode of the object. A factor that is negative or not a number counts as 0.
    pub fn damp(&mut self, factors: &[f32]) {
        let Some(last) = factors.last() else { return };
        let mut stale = false;
        for (group, indices) in self.groups.iter_mut().zip(self.indices.chunks(LANES)) {
            let mut targets = [*last; LANES];
            if factors.len() > 1 {
                targets.iter_mut().zip(indices).for_each(|(a, i)| *a = *factors.get(*i).unwrap_or(last));
            }
            for (old, new) in group.factors.iter_mut().zip(targets) {
                let new = if new > 0.0 { new } else { 0.0 };
                stale |= *old != new;
                *old = new;
            }
        }
        self.stale |= stale;
    }

    /// Sets dampings in 1/s that add to those of the modes, from the next grid point.
    ///
    /// # Shapes
    /// One for all modes, or one for each mode of the object. One that is negative or not a number counts as 0.
    pub fn add_damping(&mut self, dampings: &[f32]) {
        let Some(last) = dampings.last() else { return };
        let (rate, mut stale) = (self.rate, false);
        for (group, indices) in self.groups.iter_mut().zip(self.indices.chunks(LANES)) {
            for (old, i) in group.added.iter_mut().zip(indices) {
                let damping = if dampings.len() > 1 { *dampings.get(*i).unwrap_or(last) } else { *last };
                let new = if damping > 0.0 { f64::from(damping) / rate } else { 0.0 };
                stale |= *old != new;
                *old = new;
            }
        }
        self.stale |= stale;
    }

    /// Adds to the velocity of each mode a weighted sum of those of all modes.
    ///
    /// The velocity is the real part of the state, which is exact up to the damping ratio.
    ///
    /// # Shapes
    /// `change` is `[modes * modes]` of the object, row by row, `scratch` at least as long as the modes.
    pub fn couple(&mut self, change: &[f32], scratch: &mut [f32]) {
        let total = self.total;
        if change.len() != total * total || scratch.len() < total {
            return;
        }
        self.release();
        scratch[..total].fill(0.0);
        for (k, i) in self.indices.iter().enumerate() {
            scratch[*i] = self.lanes[k / LANES].re[k % LANES];
        }
        for (k, i) in self.indices.iter().enumerate() {
            let row = &change[i * total..(i + 1) * total];
            let sum: f32 = row.iter().zip(&*scratch).map(|(a, v)| a * v).sum();
            self.lanes[k / LANES].re[k % LANES] += sum;
            self.awake[k / LANES] |= sum != 0.0;
        }
    }

    /// Moves a contact point to a position at which the modes have other gains, from the next sample.
    ///
    /// # Shapes
    /// One gain for each mode of the object, including those left out.
    pub fn move_point(&mut self, point: usize, gains: &[f32]) {
        let points = self.points();
        if point >= points || gains.len() != self.total {
            return;
        }
        let own = self.gains.get_mut(point..).unwrap_or_default();
        set_gains(own, points, &self.indices, &self.phases, gains);
        if self.turned.is_empty() || self.stale {
            // The next grid point sets all of them.
            return;
        }
        let damping = self.damping.current();
        self.direct[point] = 0.0;
        for (vector, (group, lanes)) in self.groups.iter().zip(&self.lanes).enumerate() {
            let radiation = Radiation::new(group, damping, lanes);
            let at = vector * points + point;
            self.direct[point] -= radiation.apply(&self.gains[at], &mut self.turned[at]);
        }
    }

    pub(super) fn set_pitches(&mut self) {
        let pitch = self.pitch.current();
        self.groups.iter_mut().for_each(|group| group.set_pitch(pitch));
    }

    pub(super) fn set_steps(&mut self) {
        let (level, damping) = (self.level, self.damping.current());
        let Self { lanes, groups, output, gains, turned, direct, .. } = self;
        dispatch!(level, _simd => {
            for (lanes, group) in lanes.iter_mut().zip(&*groups) {
                group.steps(damping, &mut lanes.less_one, &mut lanes.sin);
            }
        });
        if *output == BankOutput::Displacement {
            return;
        }
        direct.fill(0.0);
        let points = direct.len();
        let all = gains.chunks(points).zip(turned.chunks_mut(points)).zip(lanes.iter().zip(&*groups));
        dispatch!(level, _simd => {
            for ((gains, turned), (lanes, group)) in all {
                let radiation = Radiation::new(group, damping, lanes);
                for ((gain, turned), direct) in gains.iter().zip(turned).zip(&mut *direct) {
                    *direct -= radiation.apply(gain, turned);
                }
            }
        });
    }
}

/// Sets the gains of a contact point; every `points`-th element of `inputs` holds sixteen of them.
pub(super) fn set_gains(
    inputs: &mut [InputGain],
    points: usize,
    indices: &[usize],
    phases: &[[f64; 2]],
    gains: &[f32],
) {
    let all = indices.chunks(LANES).zip(phases.chunks(LANES));
    for ((indices, phases), input) in all.zip(inputs.iter_mut().step_by(points.max(1))) {
        for (l, (i, [cos, sin])) in indices.iter().zip(phases).enumerate() {
            let gain = gains.get(*i).map_or(0.0, |gain| f64::from(*gain));
            (input.re[l], input.im[l]) = ((gain * cos) as f32, (gain * sin) as f32);
        }
    }
}
