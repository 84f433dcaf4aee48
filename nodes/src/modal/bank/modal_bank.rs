//! The modal bank, as a node.

use super::dampings::Dampings;
use super::fourier_form::BankForm;
use super::lanes::GRID;
use super::loudness::unit;
use super::moving_points::MovingPoints;
use super::resonators::{Bank, BankOutput};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary, same_rate};
use crate::core::params::Params;
use crate::core::ports::{Events, In, Many, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::core::time::{Rate, Tick, ticks};
use crate::dsp::{Gain, Reference, db_to_linear, linear_to_db, ramp_frames};
use crate::modal::impact::event::Impact;
use crate::modal::mode::damping_curve::DampingCurve;
use crate::modal::mode::modes::Modes;
use crate::modal::surface::coupling::MAX_COUPLED;
use crate::modal::surface::mode_shapes::ModeShapes;
use crate::modal::surface::support::{Support, Supports};
use crate::{archive_state, choices, params, ports};
use std::ops::Range;

choices! {
    /// Entries of the damping matrix of supports that count.
    pub enum SupportCoupling {
        /// Its diagonal: each mode is damped by itself.
        Diagonal,
        /// All of it: modes exchange energy at supports, for at most 64 modes. A pair of modes of a round object then decays as the two
        /// combinations that move at a support and that do not.
        Full,
    }
}

params! {
    /// Rings the modes of an object under forces.
    ///
    /// The response of a mode to an impulse is a damped sine; thousands of modes run at once. By default the output is the acceleration
    /// of the surface, which radiates sound: each mode has its gain at its own frequency, and slow forces are not heard, as they move the
    /// object without waves in the air. A mono force
    /// acts at its contact point in `points`, or at point 0 if it has none there. A force of several channels acts with channel 0
    /// at point 0, and so on. All forces add up.
    ///
    /// Modes at or above 0.49 of the sample rate are left out, and so are modes that are weaker than the strongest by more than
    /// `cull` at every contact point; the summary counts them. For a distant object a second bank with a `cull` of -40 dB is enough.
    /// A mode that has fallen below `floor` is silent until the next force. `gain`, `damping` and `pitch` can be changed while it
    /// rings: they are reached in 10 ms. A link to `damping` replaces the number: it multiplies the dampings over time, by one
    /// factor for all modes or by one channel for each mode. It is read at every 64th sample and may have any rate, as is
    /// `added_damping`, which adds to the dampings. A `MaterialBlend` linked to `material` replaces the dampings by those of a material.
    ///
    /// With `shapes`, each impact of `positions` moves the contact point of its number to its position on the object, from its time
    /// on: link the output of an `ImpactProjector` to `positions` and to an `ImpactForce`. `supports`, from `ContactDamping`, damp each
    /// mode by how much it moves there.
    ///
    /// For thousands of modes, `form: Fourier` or `Auto` computes modes that ring freely by one inverse Fourier transform per half frame instead
    /// of sample by sample. A frame has 1024 samples at 44.1 kHz, and the nearest power of two in ratio at other rates. There is no
    /// latency: the effect of a force is computed in time until the next half frame begins, so an impact sounds at its sample. Modes that
    /// decay by more than 4.65 nepers in a frame, 200/s at 44.1 kHz, are always computed in time, and so are all modes while dampings or
    /// frequencies change. The error relative to the time form depends on `bins`. Under forces that last, the time form costs less.
    ///
    /// # Source
    /// The Fourier form follows Bonneel, Drettakis, Tsingos, Viaud-Delmon and James, "Fast modal sounds with scalable frequency-domain
    /// synthesis" (ACM TOG 27(3), 2008), with bins that are fitted to each half frame in place of windows that overlap. Picard, Tsingos and
    /// Faure (VRIPHYS 2008), section 5, do not state which quantity of an object is heard: acceleration is a choice. Sterling, Rewkowski,
    /// Klatzky and Lin, "Audio-Material Reconstruction for Virtualized Reality Using a Probabilistic Damping Model" (IEEE TVCG 2019).
    pub struct ModalBankParams {
        /// Motion of the surface that becomes sound.
        output: BankOutput = BankOutput::Acceleration;
        /// Scale of the gains: `Normalized` so that a force of 1 N RMS, white up to 20 kHz, sounds at -40 dB K-weighted; `Absolute`
        /// for gains of modes in full scale per N s.
        reference: Reference = Reference::Normalized;
        /// Factor of the sound.
        gain: f32 = 1.0, unit "", range -1_000_000.0..=1_000_000.0_f32;
        /// Level change in addition to `gain`.
        db: f32 = 0.0, unit "dB", range -120.0..=120.0_f32;
        /// Factor of all dampings: above 1 for a shorter decay.
        damping: f64 = 1.0, unit "", range 0.001..=1000.0;
        /// Factor of all frequencies: 0.5 for an object of twice the size.
        pitch: f64 = 1.0, unit "", range 0.01..=100.0;
        /// Contact point of each mono force, in the order of the links.
        points: Vec<u16> = Vec::new(), unit "", range 0..=65_535_u16;
        /// Level below which a mode is silent.
        floor: f64 = -140.0, unit "dB", range -300.0..=-60.0;
        /// Gain relative to the strongest mode below which a mode is left out.
        cull: f64 = -80.0, unit "dB", range -300.0..=0.0;
        /// Coupling of modes by supports.
        coupling: SupportCoupling = SupportCoupling::Diagonal;
        /// Maximum distance of a support from the surface, relative to the size of the object.
        max_off_surface: f64 = 0.05, unit "", range 0.0..=1000.0;
        /// Time for which the modes still ring after the end of the last force.
        tail: f64 = 3.0, unit "s", range 0.0..=3600.0;
        /// Method by which modes are computed. `Auto` uses the Fourier form while at least 256 modes sound and no force acts, and leaves it
        /// under a force that acts throughout half a frame or below 128 modes.
        form: BankForm = BankForm::Time;
        /// Bins of each mode in the Fourier form. The error is -34 to -42 dB for 5, -50 to -59 dB for 7, and -67 to -76 dB for 9.
        bins: u16 = 5, unit "", range 3..=12_u16;
    }
}
ports! {
    pub struct ModalBankPorts / ModalBankIo {
        in {
            /// Forces in N, at the sample rate of the sound.
            forces: Many<Stream<f32>>,
            /// The modes of the object.
            modes: Value<Modes>,
            /// Factor of the dampings over time.
            damping: Option<Stream<f32>>,
            /// Decay rates of the amplitude in 1/s that add to those of the modes over time.
            added_damping: Option<Stream<f32>>,
            /// Shapes of the modes, for contact points that move.
            shapes: Option<Value<ModeShapes>>,
            /// Impacts that move their contact points.
            positions: Option<Events<Impact>>,
            /// Supports of the object, for which `shapes` are needed.
            supports: Option<Events<Support>>,
            /// Dampings of a material over time.
            material: Option<Events<DampingCurve>>,
        }
        out {
            /// The sound, mono.
            audio: Stream<f32>,
        }
    }
}

/// The node `ModalBank`.
#[derive(Debug)]
pub struct ModalBankNode {
    bank: Bank,
    gain: Gain,
    params: ModalBankParams,
    /// Scale of the gains of the modes.
    unit: f64,
    rate: Rate,
    /// Samples of force per second: a force of 1 N for one sample is an impulse of 1 / rate.
    per_sample: f32,
    modes: usize,
    /// True if a link replaces the number of `damping`.
    linked: bool,
    moving: Option<MovingPoints>,
    dampings: Dampings,
    /// Scratch space, one number per mode.
    velocities: Vec<f32>,
}

/// Frequency below which a sound is hardly audible, Hz.
const LOW: f64 = 60.0;

fn reject(e: impl std::fmt::Display) -> Reject {
    Reject::new("F078", e.to_string()).at("modes")
}

fn factor(p: &ModalBankParams, unit: f64) -> f64 {
    f64::from(p.gain) * db_to_linear(p.db.into()) * unit
}

fn named([factor, added]: [Option<Incoming<f32>>; 2]) -> [(&'static str, Option<Incoming<f32>>); 2] {
    [("damping", factor), ("added_damping", added)]
}

/// The last contact point that a force acts at.
fn last_point(p: &ModalBankParams, k: usize, force: &Incoming<f32>) -> usize {
    match force.format {
        Channels(1) => p.points.get(k).copied().unwrap_or(0).into(),
        Channels(n) => usize::from(n.saturating_sub(1)),
    }
}

/// Modes with at least `points` contact points: the additional ones are where each mode is strongest, until they move.
fn extended(modes: &Modes, shapes: &ModeShapes, points: usize) -> Modes {
    let mut modes = modes.clone();
    let reach = shapes.reach();
    // Modes are left out for their strength at all points, so there is at least one of these.
    for _ in modes.points()..points.max(modes.points() + 1) {
        modes.gains.extend(&reach);
    }
    modes
}

/// Errors for forces and dampings that do not fit the modes.
fn mismatches<'a>(
    p: &'a ModalBankParams,
    forces: &'a [Incoming<f32>],
    dampings: [(&'static str, Option<Incoming<f32>>); 2],
    modes: &'a Modes,
    moves: bool,
) -> impl Iterator<Item = Reject> + 'a {
    // Points that move need no gains before they do.
    let points = if moves { usize::MAX } else { modes.points() };
    let beyond_points = move |(k, force): (usize, &Incoming<f32>)| {
        let last = last_point(p, k, force);
        let field = if force.format.0 == 1 { "points".into() } else { format!("forces[{k}]") };
        let message =
            format!("force {k} acts at contact point {last}; the modes have {points}, counted from 0");
        (last >= points).then(|| Reject::new("F078", message).at(field))
    };
    let wide = dampings.into_iter().filter_map(|(name, damping)| {
        let n = usize::from(damping?.format.0);
        (n != 1 && n != modes.len()).then(|| {
            let message = format!("`{name}` has {n} channels for {} modes", modes.len());
            Reject::new("F046", message).at(name).help("one channel, or one for each mode")
        })
    });
    forces.iter().enumerate().filter_map(beyond_points).chain(wide)
}

/// The error for more modes than can be coupled.
fn too_many(p: &ModalBankParams, modes: &Modes) -> Option<Reject> {
    (p.coupling == SupportCoupling::Full && modes.len() > MAX_COUPLED).then(|| {
        let message = format!("{} modes; at most {MAX_COUPLED} can be coupled", modes.len());
        Reject::new("F078", message).at("coupling").help("leave modes out: `top` of ModelModes")
    })
}

/// The error for coupled modes in the Fourier form, in which each mode rings by itself.
fn coupled_in_fourier(p: &ModalBankParams) -> Option<Reject> {
    (p.coupling == SupportCoupling::Full && p.form == BankForm::Fourier).then(|| {
        let message =
            "modes of `coupling: Full` exchange energy in each sample; in `form: Fourier` they ring freely";
        Reject::new("F078", message).at("form").help("`form: Time`, `form: Auto` or `coupling: Diagonal`")
    })
}

/// Takes the supports and materials of a range of ticks.
fn take_events(
    dampings: &mut Dampings,
    supports: &[(Tick, Support)],
    materials: &[(Tick, DampingCurve)],
    ticks: Range<Tick>,
) {
    if let Some(all) = &mut dampings.supports {
        let range = |tick: Tick| supports.partition_point(|(t, _)| *t < tick);
        supports[range(ticks.start)..range(ticks.end)].iter().for_each(|(_, support)| all.take(support));
    }
    let until = materials.partition_point(|(tick, _)| *tick < ticks.end);
    if let Some((_, curve)) = materials[..until].last().filter(|(tick, _)| *tick >= ticks.start) {
        dampings.set_material(curve);
    }
}

impl ModalBankNode {
    /// Moves contact points for the impacts up to a sample, and returns the next sample at which one moves.
    fn move_points(&mut self, moves: &mut &[(Tick, Impact)], sample: i64) -> Option<i64> {
        while let Some(((tick, impact), rest)) = moves.split_first() {
            let next = self.rate.first_at(*tick);
            if next > sample {
                return Some(next);
            }
            if let Some(moving) = self.moving.as_mut().filter(|_| impact.is_valid()) {
                moving.set(&mut self.bank, impact.point as usize, impact.local);
            }
            *moves = rest;
        }
        None
    }

    fn set_floor(&mut self) {
        // The floor is a level of the output, but a small gain must not stop the modes earlier.
        let gain = factor(&self.params, self.unit).abs().max(1.0);
        self.bank.set_floor(self.params.floor - linear_to_db(gain));
    }
}

impl Node for ModalBankNode {
    type Params = ModalBankParams;
    type Ports = ModalBankPorts;
    const NAME: &'static str = "ModalBank";
    const VERSION: u32 = 5;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 3.0;

    fn shape(p: &ModalBankParams, s: &mut Shape<'_, '_, ModalBankPorts>) -> Result<(), Reject> {
        let forces = s.many(ModalBankPorts::forces);
        let Some(first) = forces.first() else {
            return Err(Reject::new("F078", "there is no force").at("forces"));
        };
        for (k, force) in forces.iter().enumerate() {
            s.check(same_rate(&format!("forces[{k}]"), force.rate, "`forces[0]`", first.rate));
        }
        for (field, linked) in [
            ("positions", s.linked(ModalBankPorts::positions)),
            ("supports", s.linked(ModalBankPorts::supports)),
        ] {
            if linked && !s.linked(ModalBankPorts::shapes) {
                let message = format!("`{field}` are on the surface of the object, which is not known");
                s.wrong(
                    Reject::new("F078", message).at(field).help("link `shapes` of a ModelModes to `shapes`"),
                );
            }
        }
        if let Some(found) = coupled_in_fourier(p) {
            s.wrong(found);
        }
        if let Some(modes) = s.value(ModalBankPorts::modes) {
            modes.validate().map_err(reject)?;
            let dampings =
                [ModalBankPorts::damping, ModalBankPorts::added_damping].map(|port| s.optional(port));
            let moves = s.linked(ModalBankPorts::positions);
            let found: Vec<Reject> = mismatches(p, &forces, named(dampings), &modes, moves).collect();
            let shapes = s.optional_value(ModalBankPorts::shapes);
            let misplaced = shapes.and_then(|shapes| shapes.mismatch(&modes).or_else(|| too_many(p, &modes)));
            found.into_iter().chain(misplaced).for_each(|found| s.wrong(found));
            let dropped =
                Bank::culled(&modes, first.rate.as_f64(), p.output, p.cull).map_err(reject)?.dropped();
            if modes.frequencies.iter().all(|f| f * p.pitch < LOW) {
                let n = modes.len();
                s.note(format!("all {n} modes are below {LOW} Hz, which is hardly audible: raise `pitch`"));
            }
            if dropped > 0 {
                let (n, rate) = (modes.len(), first.rate);
                s.note(format!("{dropped} of {n} modes lie above 0.49 of {rate} and are left out"));
            }
        }
        // A damping that lasts longer must not extend the output.
        let end = forces.iter().map(|force| force.end).try_fold(0, |end, e| e.map(|e| end.max(e)));
        s.ends(end);
        s.tail(ticks(p.tail));
        s.lookaround(ModalBankPorts::damping, 1, 0);
        s.when_ended(ModalBankPorts::damping, Ends::Hold);
        s.lookaround(ModalBankPorts::added_damping, 1, 0);
        s.when_ended(ModalBankPorts::added_damping, Ends::Hold);
        s.output(ModalBankPorts::audio, first.rate, Channels(1));
        Ok(())
    }

    fn build(p: &ModalBankParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let modes = cx.value(ModalBankPorts::modes);
        let forces = cx.many(ModalBankPorts::forces);
        let dampings = [ModalBankPorts::damping, ModalBankPorts::added_damping].map(|port| cx.optional(port));
        let linked = dampings[0].is_some();
        let shapes = cx.optional_value(ModalBankPorts::shapes);
        modes.validate().map_err(reject)?;
        let misplaced =
            shapes.as_ref().and_then(|shapes| shapes.mismatch(&modes).or_else(|| too_many(p, &modes)));
        if let Some(found) =
            mismatches(p, &forces, named(dampings), &modes, shapes.is_some()).chain(misplaced).next()
        {
            return Err(found.into());
        }
        let rate = cx.output(ModalBankPorts::audio).rate;
        let points =
            forces.iter().enumerate().map(|(k, force)| last_point(p, k, force) + 1).max().unwrap_or(1);
        let all = shapes.as_ref().map(|shapes| extended(&modes, shapes, points));
        let bank = Bank::culled(all.as_ref().unwrap_or(&modes), rate.as_f64(), p.output, p.cull);
        let mut bank = bank.map_err(reject)?;
        bank.start(if linked { 1.0 } else { p.damping }, p.pitch, ramp_frames(rate));
        // Coupled modes never ring freely.
        if p.coupling == SupportCoupling::Diagonal {
            bank.set_form(p.form, p.bins.into());
        }
        let unit = unit(&modes, p.reference).map_err(reject)?;
        let gain = Gain::new(factor(p, unit), ramp_frames(rate), 1);
        let per_sample = (1.0 / rate.as_f64()) as f32;
        let supports = shapes.clone().map(|shapes| Supports::new(shapes, p.max_off_surface));
        let supports = supports.map(|s| if p.coupling == SupportCoupling::Full { s.coupled() } else { s });
        let moving = shapes.map(|shapes| MovingPoints::new(shapes, bank.points()));
        let dampings = Dampings::new(&modes, supports);
        let velocities = vec![0.0; modes.len()];
        let mut node = Self {
            bank,
            gain,
            params: p.clone(),
            unit,
            rate,
            per_sample,
            modes: modes.len(),
            linked,
            moving,
            dampings,
            velocities,
        };
        node.set_floor();
        Ok(node)
    }

    fn run(&mut self, mut io: ModalBankIo<'_>) -> Result<(), Fault> {
        let first = io.audio.first();
        self.bank.align(first);
        let out = io.audio.items();
        let mut moves = io.positions.as_ref().map_or(&[][..], |positions| positions.events());
        let supports = io.supports.as_ref().map_or(&[][..], |supports| supports.events());
        let materials = io.material.as_ref().map_or(&[][..], |material| material.events());
        // Events before this tick have been taken.
        let mut taken = Tick::MIN;
        let mut at = 0;
        while at < out.len() {
            let index = first + at as i64;
            if self.bank.at_grid() {
                let now = self.rate.tick(index);
                take_events(&mut self.dampings, supports, materials, taken..now + 1);
                taken = now + 1;
                // The latest one, or the one before the window.
                let latest = |damping: &In<'_, f32>| {
                    let item = damping.rate().first_at(now + 1) - 1 - damping.first();
                    item.max(-1) as isize
                };
                let factors = io.damping.as_ref().map(|damping| damping.item(latest(damping)));
                let added = io.added_damping.as_ref().map(|added| added.item(latest(added)));
                self.dampings.apply(&mut self.bank, factors, added, GRID as f64 / self.rate.as_f64());
            }
            let mut n = self.bank.until_grid().min(out.len() - at);
            if let Some(next) = self.move_points(&mut moves, index) {
                n = n.min((next - index) as usize);
            }
            // Coupled modes exchange energy after each sample.
            n = if self.dampings.coupling().is_some() { 1 } else { n };
            for (k, force) in io.forces.iter().enumerate() {
                let width = force.width().max(1);
                let frames = force.items().get(at * width..(at + n) * width).unwrap_or_default();
                let point = self.params.points.get(k).filter(|_| width == 1).copied().unwrap_or(0);
                for channel in 0..width {
                    let sum = self.bank.force(usize::from(point) + channel);
                    for (sum, frame) in sum.iter_mut().zip(frames.chunks_exact(width)) {
                        *sum += frame[channel] * self.per_sample;
                    }
                }
            }
            self.bank.advance(&mut out[at..at + n]);
            if let Some(change) = self.dampings.coupling() {
                self.bank.couple(change, &mut self.velocities);
            }
            at += n;
        }
        take_events(&mut self.dampings, supports, materials, taken..Tick::MAX);
        // Those after the last sample of the window.
        self.move_points(&mut moves, i64::MAX);
        self.gain.process(out);
        Ok(())
    }

    fn finish(&mut self, _: ModalBankIo<'_>) -> Result<Summary, Fault> {
        let mut summary = vec![("modes", (self.modes - self.bank.dropped() - self.bank.faint()).into())];
        if self.bank.dropped() > 0 {
            summary.push(("modes_left_out", self.bank.dropped().into()));
        }
        if self.bank.faint() > 0 {
            summary.push(("modes_too_weak", self.bank.faint().into()));
        }
        if self.bank.diverged() > 0 {
            summary.push(("modes_stopped_that_grew_beyond_bounds", self.bank.diverged().into()));
        }
        if self.params.form != BankForm::Time {
            summary.push(("half_frames_in_fourier_form", self.bank.hops().into()));
        }
        let warning = self.dampings.supports.as_ref().and_then(Supports::warning);
        summary.extend(warning.map(|text| ("warning", text.into())));
        Ok(summary)
    }

    fn retune(&mut self, new: &ModalBankParams) -> Retune {
        let fixed =
            |p: &ModalBankParams| (p.tail, p.cull, p.output, p.reference, p.max_off_surface, p.coupling);
        let fixed = |p: &ModalBankParams| (fixed(p), p.form, p.bins);
        if new.points != self.params.points || fixed(new) != fixed(&self.params) {
            return Retune::Rebuild;
        }
        // Cloning the list would allocate.
        self.params = ModalBankParams { points: std::mem::take(&mut self.params.points), ..*new };
        self.gain.set_target(factor(new, self.unit));
        self.bank.glide(if self.linked { 1.0 } else { new.damping }, new.pitch);
        self.set_floor();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.gain.start_from(old.gain.current());
        self.bank.take_state(&old.bank);
        if let (Some(moving), Some(old)) = (&mut self.moving, &old.moving) {
            moving.take_state(&mut self.bank, old);
        }
        self.dampings.take_state(&old.dampings);
    }

    archive_state!(bank, gain, each moving, dampings);

    fn trial(rng: &mut Rng) -> (ModalBankParams, MemoryFiles) {
        let params = ModalBankParams::trial(rng);
        let points = (0..rng.below(2)).map(|_| rng.below(3) as u16).collect();
        let tail = rng.between(0.0, 2.0);
        (ModalBankParams { points, tail, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
