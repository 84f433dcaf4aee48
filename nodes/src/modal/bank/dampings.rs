//! Dampings of a bank that change while it sounds.

use super::lanes::GRID;
use super::resonators::Bank;
use crate::impl_state;
use crate::modal::mode::damping_curve::DampingCurve;
use crate::modal::mode::modes::Modes;
use crate::modal::surface::coupling::Coupling;
use crate::modal::surface::support::Supports;

/// Dampings of the modes of an object, with all that changes them: a material, factors over time, and supports.
#[derive(Debug)]
pub(super) struct Dampings {
    /// Frequency in Hz and decay rate in 1/s of each mode.
    modes: Vec<(f64, f64)>,
    /// Damping of the latest material.
    material: Option<DampingCurve>,
    /// True if its factors are out of date.
    stale: bool,
    /// Factors of the dampings for it.
    of_material: Vec<f32>,
    factors: Vec<f32>,
    pub supports: Option<Supports>,
    added: Vec<f32>,
}
impl_state!(Dampings { material, stale, of_material, each supports });

impl Dampings {
    pub fn new(modes: &Modes, supports: Option<Supports>) -> Self {
        let n = modes.len();
        Self {
            modes: modes.frequencies.iter().copied().zip(modes.dampings.iter().copied()).collect(),
            material: None,
            stale: false,
            of_material: vec![1.0; n],
            factors: vec![1.0; n],
            supports,
            added: vec![0.0; n],
        }
    }

    /// Sets the damping of the material from the next grid point.
    pub fn set_material(&mut self, curve: &DampingCurve) {
        if curve.is_valid() {
            self.material = Some(*curve);
            self.stale = true;
        }
    }

    /// Sets the dampings of the bank at a grid point, `step` seconds after the last one, from the factors and the added decay rates of
    /// links, which have one number for all modes or one for each.
    pub fn apply(&mut self, bank: &mut Bank, linked: Option<&[f32]>, added: Option<&[f32]>, step: f64) {
        if let Some(curve) = self.material.filter(|_| std::mem::take(&mut self.stale)) {
            for (factor, (frequency, decay)) in self.of_material.iter_mut().zip(&self.modes) {
                *factor = (curve.decay(*frequency) / decay) as f32;
            }
        }
        match (self.material, linked) {
            (None, None) => {}
            (None, Some(linked)) => bank.damp(linked),
            (Some(_), linked) => {
                self.factors.copy_from_slice(&self.of_material);
                each(&mut self.factors, linked.unwrap_or(&[1.0]), |factor, x| *factor *= x);
                bank.damp(&self.factors);
            }
        }
        match (&mut self.supports, added) {
            (None, None) => {}
            (None, Some(added)) => bank.add_damping(added),
            (Some(supports), added) if supports.coupling().is_some() => {
                supports.advance_coupling(step, step / GRID as f64);
                if let Some(added) = added {
                    bank.add_damping(added);
                }
            }
            (Some(supports), added) => {
                self.added.copy_from_slice(supports.advance(step));
                each(&mut self.added, added.unwrap_or(&[0.0]), |sum, x| *sum += x.max(0.0));
                bank.add_damping(&self.added);
            }
        }
    }

    /// Changes of the velocities by supports in each sample, if modes are coupled and there are any.
    pub fn coupling(&self) -> Option<&[f32]> {
        self.supports.as_ref().and_then(Supports::coupling).and_then(Coupling::change)
    }

    pub fn take_state(&mut self, old: &Self) {
        if let Some(curve) = &old.material {
            self.set_material(curve);
        }
        if let (Some(supports), Some(old)) = (&mut self.supports, &old.supports) {
            supports.take_state(old);
        }
    }
}

/// Combines each number with the corresponding one of `others`, or with the only one.
fn each(numbers: &mut [f32], others: &[f32], combine: impl Fn(&mut f32, f32)) {
    match others {
        [one] => numbers.iter_mut().for_each(|x| combine(x, *one)),
        _ => numbers.iter_mut().zip(others).for_each(|(x, other)| combine(x, *other)),
    }
}
