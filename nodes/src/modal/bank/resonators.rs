//! The resonator bank: many modes, several excitations, damping that varies in time.

use super::coefficients::{Group, HIGHEST, audible};
use super::kernel::{self, Forces, GRID, LANES, Lanes, Push};
use crate::dsp::{Gain, db_to_linear};
use crate::impl_state;
use crate::modal::mode::modes::{Modes, ModesError};
use fearless_simd::{Level, dispatch};

/// Squared size below which a mode is silenced even while a force is on it: far above the denormal numbers, which would
/// slow it down a hundredfold.
const FAINTEST: f32 = 1e-30;
/// Squared size that no sound has: the state has run away on numbers that are not finite or close to it.
const LOUDEST: f32 = 1e30;

/// Rings the modes of one object.
///
/// Each mode is one complex number `z`. In every sample it is turned and shrunk, `z <- z exp((-d + 2 pi i f)/fs)`, and the force
/// at each contact point adds `g exp(i phase)` times its value; the sum of the imaginary parts is heard. That is the exact
/// response to a train of impulses, at any frequency and damping. The state keeps its meaning when damping or frequency
/// change, so they may move at any time; a changed one is taken over every 64th sample.
///
/// A mode that has died away is set to zero, and vectors of modes at zero cost nothing until a force comes.
/// However the samples are cut into calls, the same bits come out.
///
/// # Complexity
/// O(sounding modes) per sample.
///
/// # Source
/// The recursion is the coupled form (Gold and Rader 1969); in single precision the usual two-pole form fails at low
/// frequencies, where its coefficients lose their digits.
///
/// # Example
/// ```
/// use foley_nodes::modal::{Bank, Modes};
///
/// let bell = Modes::new("bell", vec![440.0, 1210.0], vec![3.0, 5.0], vec![1.0, 0.5])?;
/// let mut bank = Bank::new(&bell, 44_100.0)?;
/// let (mut force, mut sound) = ([0.0; 4410], [0.0; 4410]);
/// force[0] = 0.2;
/// bank.process(&force, &mut sound);
/// assert!(sound.iter().any(|x| x.abs() > 0.1));
/// # Ok::<(), foley_nodes::modal::ModesError>(())
/// ```
#[derive(Debug)]
pub struct Bank {
    level: Level,
    /// Places of the modes among those of the object.
    places: Vec<usize>,
    groups: Vec<Group>,
    /// Modes of the object, those left out included.
    total: usize,
    /// Those of them that are too high to sound.
    high: usize,
    lanes: Vec<Lanes>,
    awake: Vec<bool>,
    /// `[vectors, points]`.
    pushes: Vec<Push>,
    forces: Vec<[f32; GRID]>,
    active: Vec<usize>,
    /// Place in the present grid interval.
    phase: usize,
    /// Whether there was no force since the last grid point.
    quiet: bool,
    /// Squared size at which a mode without force counts as silent.
    floor: f32,
    damping: Gain,
    pitch: Gain,
    /// Whether the coefficients are behind what is asked for.
    stale: bool,
    runaways: u64,
}
impl_state!(Bank { groups, lanes, awake, phase, quiet, damping, pitch, stale, runaways });

impl Bank {
    /// A bank at rest, at a sample rate.
    ///
    /// Modes at or above 0.49 of the rate are left out: see [`dropped`](Self::dropped).
    ///
    /// # Errors
    /// As [`Modes::validate`].
    pub fn new(modes: &Modes, rate: f64) -> Result<Self, ModesError> {
        Self::culled(modes, rate, f64::NEG_INFINITY)
    }

    /// The same without the modes that are more than `-cull` dB weaker than the strongest, at every contact point.
    ///
    /// # Errors
    /// As [`Modes::validate`].
    pub fn culled(modes: &Modes, rate: f64, cull: f64) -> Result<Self, ModesError> {
        modes.validate()?;
        let faintest = db_to_linear(cull);
        let high = modes.frequencies.iter().filter(|f| **f >= HIGHEST * rate).count();
        let (places, groups) = audible(modes, rate, faintest);
        let (vectors, points) = (groups.len(), modes.points());
        let mut pushes = vec![Push { re: [0.0; LANES], im: [0.0; LANES] }; vectors * points];
        for (k, i) in places.iter().enumerate() {
            let phase = f64::from(modes.phases.get(*i).copied().unwrap_or(0.0));
            let (sin, cos) = (libm::sin(phase), libm::cos(phase));
            for point in 0..points {
                let gain = f64::from(modes.row(point)[*i]);
                let push = &mut pushes[k / LANES * points + point];
                (push.re[k % LANES], push.im[k % LANES]) = ((gain * cos) as f32, (gain * sin) as f32);
            }
        }
        let mut bank = Self {
            level: Level::new(),
            total: modes.len(),
            high,
            lanes: vec![Lanes::SILENT; vectors],
            awake: vec![false; vectors],
            pushes,
            forces: vec![[0.0; GRID]; points],
            active: Vec::with_capacity(points),
            phase: 0,
            quiet: true,
            floor: 0.0,
            damping: Gain::new(1.0, 0, 1),
            pitch: Gain::new(1.0, 0, 1),
            stale: true,
            runaways: 0,
            places,
            groups,
        };
        bank.set_floor(-140.0);
        Ok(bank)
    }

    /// Modes that do not sound at this rate.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.high
    }

    /// Modes that are left out because they are too weak beside the strongest.
    #[must_use]
    pub fn faint(&self) -> usize {
        self.total - self.high - self.places.len()
    }

    /// Contact points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.forces.len()
    }

    /// Modes that were set to zero because they had grown beyond all bounds.
    #[must_use]
    pub fn runaways(&self) -> u64 {
        self.runaways
    }

    /// Modes that sound at present, to the next sixteen.
    #[must_use]
    pub fn sounding(&self) -> usize {
        LANES * self.awake.iter().filter(|awake| **awake).count()
    }

    /// Sets the level, in dB of full scale, below which a mode without force is silent.
    pub fn set_floor(&mut self, db: f64) {
        self.floor = (db_to_linear(db).powi(2) as f32).max(FAINTEST);
    }

    /// Starts with these factors of all dampings and frequencies, and lets later ones be reached within `ramp` samples.
    pub fn start(&mut self, damping: f64, pitch: f64, ramp: u64) {
        let steps = ramp.div_ceil(GRID as u64);
        self.damping = Gain::new(damping, steps, 1);
        self.pitch = Gain::new(pitch, steps, 1);
        self.set_pitches();
        self.stale = true;
    }

    /// Moves to other factors of all dampings and frequencies.
    pub fn glide(&mut self, damping: f64, pitch: f64) {
        self.damping.set_target(damping);
        self.pitch.set_target(pitch);
    }

    /// Factors of the dampings from the next grid point on, beside those of [`start`](Self::start): one for all modes, or one
    /// for each mode of the object. What is negative or not a number counts as 0, which lets a mode ring on.
    pub fn damp(&mut self, factors: &[f32]) {
        let Some(last) = factors.last() else { return };
        let mut stale = false;
        for (group, places) in self.groups.iter_mut().zip(self.places.chunks(LANES)) {
            let mut asked = [*last; LANES];
            if factors.len() > 1 {
                asked.iter_mut().zip(places).for_each(|(a, i)| *a = *factors.get(*i).unwrap_or(last));
            }
            for (old, new) in group.factors.iter_mut().zip(asked) {
                let new = if new > 0.0 { new } else { 0.0 };
                stale |= *old != new;
                *old = new;
            }
        }
        self.stale |= stale;
    }

    /// Samples until the next grid point: the longest stretch that [`advance`](Self::advance) takes.
    #[must_use]
    pub fn stretch(&self) -> usize {
        GRID - self.phase
    }

    /// Whether the next sample is a grid point, where [`damp`](Self::damp) takes hold.
    #[must_use]
    pub fn at_grid(&self) -> bool {
        self.phase == 0
    }

    /// Places the grid: sample `index` comes next.
    pub fn align(&mut self, index: i64) {
        self.phase = index.rem_euclid(GRID as i64) as usize;
    }

    /// The forces of the next stretch at a contact point, to be written; empty where there is no such point.
    pub fn force(&mut self, point: usize) -> &mut [f32] {
        self.forces.get_mut(point).map_or(&mut [], |force| force.as_mut_slice())
    }

    /// Rings on for `out.len()` samples, at most a [`stretch`](Self::stretch), under the forces written, and clears them.
    pub fn advance(&mut self, out: &mut [f32]) {
        let n = out.len().min(self.stretch());
        if self.phase == 0 {
            self.grid_point();
        }
        self.active.clear();
        for (point, force) in self.forces.iter_mut().enumerate() {
            let mut on = false;
            for f in &mut force[..n] {
                *f = if f.is_finite() { *f } else { 0.0 };
                on |= *f != 0.0;
            }
            if on {
                self.active.push(point);
            }
        }
        if !self.active.is_empty() {
            self.quiet = false;
            self.awake.fill(true);
        }
        let mut sums = [[0.0; LANES]; GRID];
        let forces = Forces { samples: &self.forces, active: &self.active, pushes: &self.pushes };
        kernel::advance(self.level, &mut self.lanes, &self.awake, forces, &mut sums[..n]);
        kernel::collect(self.level, &sums[..n], &mut out[..n]);
        self.forces.iter_mut().for_each(|force| force[..n].fill(0.0));
        self.phase = (self.phase + n) % GRID;
    }

    /// Rings under a force at contact point 0.
    pub fn process(&mut self, force: &[f32], out: &mut [f32]) {
        let (mut force, mut out) = (force, out);
        while !out.is_empty() {
            let n = self.stretch().min(out.len());
            let (now, later) = force.split_at(n.min(force.len()));
            self.force(0)[..now.len()].copy_from_slice(now);
            let (here, rest) = out.split_at_mut(n);
            self.advance(here);
            (force, out) = (later, rest);
        }
    }

    /// Takes over the ringing of another bank of an object of as many modes: of those that sound in both.
    pub fn take_state(&mut self, old: &Self) {
        if old.total != self.total {
            return;
        }
        let mut others = old.places.iter().enumerate().peekable();
        for (k, place) in self.places.iter().enumerate() {
            while others.next_if(|(_, other)| *other < place).is_some() {}
            let Some((j, _)) = others.next_if(|(_, other)| *other == place) else { continue };
            let from = &old.lanes[j / LANES];
            let to = &mut self.lanes[k / LANES];
            (to.re[k % LANES], to.im[k % LANES]) = (from.re[j % LANES], from.im[j % LANES]);
            self.awake[k / LANES] |= old.awake[j / LANES];
        }
        (self.phase, self.quiet) = (old.phase, old.quiet);
        self.damping.start_from(old.damping.current());
        self.pitch.start_from(old.pitch.current());
        self.set_pitches();
        self.stale = true;
    }

    /// What happens every 64th sample: modes that have died away go to sleep, and coefficients catch up.
    fn grid_point(&mut self) {
        let floor = if self.quiet { self.floor } else { FAINTEST };
        let (level, runaways) = (self.level, &mut self.runaways);
        let all = self.lanes.iter_mut().zip(&mut self.awake);
        dispatch!(level, _simd => {
            for (lanes, awake) in all {
                // Mostly all of them sound.
                *awake = *awake && (lanes.all_within(floor, LOUDEST) || silence(lanes, floor, runaways));
            }
        });
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
        if std::mem::take(&mut self.stale) {
            self.set_steps();
        }
    }

    fn set_pitches(&mut self) {
        let pitch = self.pitch.current();
        self.groups.iter_mut().for_each(|group| group.set_pitch(pitch));
    }

    fn set_steps(&mut self) {
        let (level, damping) = (self.level, self.damping.current());
        let Self { lanes, groups, .. } = self;
        dispatch!(level, _simd => {
            for (lanes, group) in lanes.iter_mut().zip(&*groups) {
                group.steps(damping, &mut lanes.less_one, &mut lanes.sin);
            }
        });
    }
}

/// Sets modes to zero that have died away or run away, and says whether any goes on.
fn silence(lanes: &mut Lanes, floor: f32, runaways: &mut u64) -> bool {
    let mut awake = false;
    for (re, im) in lanes.re.iter_mut().zip(&mut lanes.im) {
        let size = *re * *re + *im * *im;
        if size > floor && size < LOUDEST {
            awake = true;
        } else {
            // Not a number is also not below the loudest.
            *runaways += u64::from(size.is_nan() || size >= LOUDEST);
            (*re, *im) = (0.0, 0.0);
        }
    }
    awake
}

#[cfg(test)]
mod tests;
