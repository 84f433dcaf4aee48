//! The modal bank: many modes, several forces, time-varying damping.

mod advance;
mod changes;

use super::coefficients::{Group, MAX_FREQUENCY, Radiation, audible};
use super::fourier_form::{BankForm, FourierForm};
use super::lanes::{GRID, InputGain, LANES, Lanes};
use super::two_pole::TwoPole;
use crate::dsp::{Gain, db_to_linear};
use crate::modal::mode::modes::{Modes, ModesError};
use crate::{choices, impl_state};
use changes::set_gains;
use fearless_simd::{Level, dispatch};

/// Squared magnitude below which a mode is set to zero even under a force. It lies far above the denormal numbers, which are
/// a hundred times slower.
const MIN_POWER: f32 = 1e-30;

/// Grid intervals without a change after which modes are computed as two poles. While coefficients move often, those of two poles are not computed.
const STEADY: i32 = 4;

choices! {
    /// Motion of the surface that becomes sound.
    pub enum BankOutput {
        /// Acceleration, which radiates sound. The gain of a mode is that at its own frequency, and 0 for a constant force.
        Acceleration,
        /// Displacement: damped sines in themselves. A constant force gives a constant output.
        Displacement,
    }
}

/// The resonators of one object.
///
/// Each mode is one complex number `z`. Every sample rotates and shrinks it, `z <- z exp((-d + 2 pi i f)/fs)`, and the force
/// at each contact point adds `g exp(i phase)` times its value. The output is the sum of the imaginary parts. This is the exact
/// response to a train of impulses, at any frequency and damping. The state stays valid when damping or frequency
/// change; changes take effect at every 64th sample.
///
/// With [`BankOutput::Displacement`] this is the output. [`BankOutput::Acceleration`] outputs its second derivative, divided by
/// `-|p|^2` for each mode, where `p = -d + 2 pi i f`: the damped sine is rotated by `-(p / |p|)^2`, and the force times a constant is
/// subtracted so that the response to a constant force is 0. The gain of a mode at its own frequency stays the same, falls with the
/// square of the frequency below it, and is constant far above. Input gains include the rotation, so it costs one product per sample and
/// contact point, and one update of the gains when pitch or damping changes.
///
/// With [`set_form`](Self::set_form) modes that ring freely are computed by Fourier transforms, which costs less for some
/// hundred modes and more.
///
/// While no forces act and dampings and frequencies do not change, modes above 56 Hz at 44.1 kHz are computed by two poles, which are
/// initialised with the state of `z` at each grid point: the difference from the rotation is at most 1e-4 of the mode, and 3e-5 above 200 Hz.
///
/// A decayed mode is set to zero, and vectors of modes at zero cost nothing until the next force. The output does not depend on
/// how the samples are divided into calls, bit for bit.
///
/// # Complexity
/// O(sounding modes) per sample.
///
/// # Source
/// The recursion is the coupled form (Gold and Rader 1969). In single precision the two-pole form alone fails at low frequencies, where
/// its coefficients lose digits.
///
/// # Example
/// ```
/// use foley_nodes::modal::{Bank, BankOutput, Modes};
///
/// let bell = Modes::new("bell", vec![440.0, 1210.0], vec![3.0, 5.0], vec![1.0, 0.5])?;
/// let mut bank = Bank::new(&bell, 44_100.0, BankOutput::Acceleration)?;
/// let (mut force, mut sound) = ([0.0; 4410], [0.0; 4410]);
/// force[0] = 0.2;
/// bank.process(&force, &mut sound);
/// assert!(sound.iter().any(|x| x.abs() > 0.1));
/// # Ok::<(), foley_nodes::modal::ModesError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Bank {
    level: Level,
    /// Indices of the modes in the object.
    indices: Vec<usize>,
    groups: Vec<Group>,
    /// Cosine and sine of the phase of each mode.
    phases: Vec<[f64; 2]>,
    /// Samples per second.
    rate: f64,
    /// Modes of the object, including those left out.
    total: usize,
    /// Modes that are too high for the sample rate.
    high: usize,
    lanes: Vec<Lanes>,
    awake: Vec<bool>,
    /// Motion that is put out.
    output: BankOutput,
    /// Gains of displacement, `[vectors, points]`.
    gains: Vec<InputGain>,
    /// Gains of acceleration under the current pitch and damping; empty for displacement.
    turned: Vec<InputGain>,
    /// Output per force at each point in addition to that of the modes; 0 for displacement.
    direct: Vec<f32>,
    forces: Vec<[f32; GRID]>,
    active: Vec<usize>,
    /// Position in the current grid interval.
    phase: usize,
    /// True if there was no force since the last grid point.
    quiet: bool,
    /// Squared magnitude at which a mode without force counts as silent.
    floor: f32,
    damping: Gain,
    pitch: Gain,
    /// True if the coefficients are out of date.
    stale: bool,
    /// Modes that diverged and were set to zero.
    diverged: u64,
    /// The modes without forces, as two poles.
    two_poles: Vec<TwoPole>,
    /// True if the current grid interval is computed by two poles so far.
    is_free: bool,
    /// Grid intervals since the coefficients changed, at most one more than [`STEADY`]; -1 before the first one if they are set.
    steady: i32,
    /// Modes that ring freely, unless all are computed in time.
    fourier: Option<FourierForm>,
}
impl_state!(Bank {
    groups,
    lanes,
    gains,
    turned,
    direct,
    awake,
    phase,
    quiet,
    damping,
    pitch,
    stale,
    diverged,
    two_poles,
    is_free,
    steady,
    each fourier
});

impl Bank {
    /// A bank at rest, at a sample rate in Hz.
    ///
    /// Modes at or above 0.49 of the rate are left out: see [`dropped`](Self::dropped).
    ///
    /// # Errors
    /// As [`Modes::validate`].
    pub fn new(modes: &Modes, rate: f64, output: BankOutput) -> Result<Self, ModesError> {
        Self::culled(modes, rate, output, f64::NEG_INFINITY)
    }

    /// A bank without the modes that are more than `-cull` dB weaker than the strongest mode, at every contact point.
    ///
    /// # Errors
    /// As [`Modes::validate`].
    pub fn culled(modes: &Modes, rate: f64, output: BankOutput, cull: f64) -> Result<Self, ModesError> {
        modes.validate()?;
        let min_gain = db_to_linear(cull);
        let high = modes.frequencies.iter().filter(|f| **f >= MAX_FREQUENCY * rate).count();
        let (indices, groups) = audible(modes, rate, min_gain);
        let (vectors, points) = (groups.len(), modes.points());
        let mut gains = vec![InputGain { re: [0.0; LANES], im: [0.0; LANES] }; vectors * points];
        let phase = |i: &usize| {
            let phase = f64::from(modes.phases.get(*i).copied().unwrap_or(0.0));
            [libm::cos(phase), libm::sin(phase)]
        };
        let phases: Vec<[f64; 2]> = indices.iter().map(phase).collect();
        for point in 0..points {
            set_gains(
                gains.get_mut(point..).unwrap_or_default(),
                points,
                &indices,
                &phases,
                modes.row(point),
            );
        }
        let mut bank = Self {
            level: Level::new(),
            total: modes.len(),
            high,
            lanes: vec![Lanes::SILENT; vectors],
            awake: vec![false; vectors],
            output,
            turned: if output == BankOutput::Acceleration { gains.clone() } else { Vec::new() },
            direct: vec![0.0; points],
            gains,
            forces: vec![[0.0; GRID]; points],
            active: Vec::with_capacity(points),
            phase: 0,
            quiet: true,
            floor: 0.0,
            damping: Gain::new(1.0, 0, 1),
            pitch: Gain::new(1.0, 0, 1),
            stale: true,
            diverged: 0,
            two_poles: vec![TwoPole::new(&Lanes::SILENT); vectors],
            is_free: false,
            steady: 0,
            fourier: None,
            indices,
            groups,
            phases,
            rate,
        };
        bank.set_floor(-140.0);
        bank.set_steps();
        Ok(bank)
    }

    /// Number of modes left out because they are too high for the sample rate.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.high
    }

    /// Number of modes left out because they are too weak against the strongest.
    #[must_use]
    pub fn faint(&self) -> usize {
        self.total - self.high - self.indices.len()
    }

    /// Number of contact points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.forces.len()
    }

    /// Number of modes that diverged and were set to zero.
    #[must_use]
    pub fn diverged(&self) -> u64 {
        self.diverged
    }

    /// Number of modes that sound now, rounded up to vectors of sixteen.
    #[must_use]
    pub fn sounding(&self) -> usize {
        let held = self.fourier.as_ref().map_or(&[][..], FourierForm::awake).iter().copied();
        let held = held.chain(std::iter::repeat(false));
        LANES * self.awake.iter().zip(held).filter(|(awake, held)| **awake || *held).count()
    }

    /// Hops whose modes were computed by Fourier transforms.
    #[must_use]
    pub fn hops(&self) -> u64 {
        self.fourier.as_ref().map_or(0, FourierForm::hops)
    }

    /// Sets how modes are computed, with `bins` bins of each mode from 1 to 12, for a bank at rest whose factors are set.
    ///
    /// The Fourier form holds the modes that ring freely and decay by at most 4.65 nepers in a frame, 200/s at 44.1 kHz. A frame has 1024
    /// samples at 44.1 kHz, and the nearest power of two in ratio at other rates. Forces act in time, sample by sample, for at most half a
    /// frame, so there is no latency. While dampings or frequencies change, all modes are in time. The error relative to the time form is -34
    /// to -42 dB for five bins and -50 to -59 dB for seven.
    ///
    /// [`BankForm::Auto`] changes to the Fourier form where no force acted for half a frame and at least 256 modes sound. It leaves it where
    /// forces act throughout half a frame or fewer than 128 modes sound. By the bench `modal` on one core with AVX-512, both forms cost the
    /// same at 64 modes if an impact comes each second, and between 256 and 1000 if one comes each 1024 samples.
    ///
    /// It allocates, so it is for the preparation of a bank.
    ///
    /// # Complexity
    /// O(modes * bins^2). The sound then costs O(modes * bins) in each half frame in place of O(modes) in each sample.
    ///
    /// # Source
    /// Bonneel, Drettakis, Tsingos, Viaud-Delmon and James (ACM TOG 27(3), 2008). They overlap windowed frames; here the bins are fitted to
    /// half frames, which is more exact and does not blur impacts.
    ///
    /// # Example
    /// ```
    /// use foley_nodes::modal::{Bank, BankForm, BankOutput, Modes};
    ///
    /// let frequencies = (0..1000).map(|k| 50.0 + 15.0 * f64::from(k)).collect();
    /// let plate = Modes::new("plate", frequencies, vec![5.0; 1000], vec![0.01; 1000])?;
    /// let mut bank = Bank::new(&plate, 44_100.0, BankOutput::Displacement)?;
    /// let mut exact = bank.clone();
    /// bank.set_form(BankForm::Fourier, 7);
    /// let (mut a, mut b) = (vec![0.0; 4410], vec![0.0; 4410]);
    /// bank.process(&[1.0], &mut a);
    /// exact.process(&[1.0], &mut b);
    /// let power = |x: &mut dyn Iterator<Item = f32>| x.map(|x| x * x).sum::<f32>();
    /// let error = power(&mut a.iter().zip(&b).map(|(a, b)| a - b));
    /// assert!(error < 1e-5 * power(&mut b.iter().copied()) && bank.hops() > 0);
    /// # Ok::<(), foley_nodes::modal::ModesError>(())
    /// ```
    pub fn set_form(&mut self, form: BankForm, bins: usize) {
        self.release();
        self.fourier = None;
        if form == BankForm::Time {
            return;
        }
        if std::mem::take(&mut self.stale) {
            self.set_steps();
            self.steady = -1;
        }
        let mut fourier = FourierForm::new(form, bins, self.lanes.len(), self.rate);
        fourier.set_position(self.phase as i64);
        fourier.refresh(&self.groups, self.damping.current(), usize::MAX);
        self.fourier = Some(fourier);
    }

    /// Moves all states to the lanes.
    fn release(&mut self) {
        self.leave_two_poles();
        if let Some(fourier) = &mut self.fourier {
            fourier.release(&mut self.lanes, &mut self.awake);
        }
    }

    /// Sets the states of all modes to the current ones, if they were computed by two poles.
    fn leave_two_poles(&mut self) {
        if !std::mem::take(&mut self.is_free) {
            return;
        }
        let all = self.lanes.iter_mut().zip(&self.two_poles).zip(&self.awake);
        dispatch!(self.level, _simd => {
            for ((lanes, two_pole), awake) in all {
                if two_pole.fits && *awake {
                    [lanes.re, lanes.im] = lanes.after(&lanes.re, &lanes.im, self.phase);
                }
            }
        });
    }

    /// Sets the level, in dB of full scale, below which a mode without force is silent.
    pub fn set_floor(&mut self, db: f64) {
        self.floor = (db_to_linear(db).powi(2) as f32).max(MIN_POWER);
    }

    /// Takes over the states of the modes that are in both banks; `old` must be of an object with as many modes.
    pub fn take_state(&mut self, old: &Self) {
        if old.total != self.total {
            return;
        }
        self.release();
        let mut others = old.indices.iter().enumerate().peekable();
        // The states of one vector of the other bank at a time.
        let mut states = (usize::MAX, [(0.0, 0.0); LANES]);
        for (k, index) in self.indices.iter().enumerate() {
            while others.next_if(|(_, other)| *other < index).is_some() {}
            let Some((j, _)) = others.next_if(|(_, other)| *other == index) else { continue };
            if states.0 != j / LANES {
                states = (j / LANES, old.states(j / LANES));
            }
            let to = &mut self.lanes[k / LANES];
            (to.re[k % LANES], to.im[k % LANES]) = states.1[j % LANES];
            self.awake[k / LANES] |= states.1[j % LANES] != (0.0, 0.0);
        }
        (self.phase, self.quiet) = (old.phase, old.quiet);
        if let Some(fourier) = &mut self.fourier {
            let position = fourier.position(old.fourier.as_ref()).unwrap_or(old.phase);
            fourier.set_position(position as i64);
        }
        self.damping.start_from(old.damping.current());
        self.pitch.start_from(old.pitch.current());
        self.set_pitches();
        self.stale = true;
    }

    /// The states of sixteen modes, wherever they are.
    fn states(&self, vector: usize) -> [(f32, f32); LANES] {
        let mut lanes = self.lanes[vector];
        if self.is_free && self.two_poles[vector].fits && self.awake[vector] {
            [lanes.re, lanes.im] = lanes.after(&lanes.re, &lanes.im, self.phase);
        }
        let mut states = std::array::from_fn(|l| (lanes.re[l], lanes.im[l]));
        if let Some(fourier) = &self.fourier {
            fourier.add_state(vector, &lanes, &mut states);
        }
        states
    }
}

#[cfg(test)]
mod tests;
