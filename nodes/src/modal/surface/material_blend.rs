//! Damping that moves from one material to another while an object sounds, as a node.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Many, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::material::Material;
use crate::modal::mode::modes::Modes;
use crate::{archive_state, params, ports};
use std::f64::consts::TAU;

params! {
    /// Factors that turn the dampings of an object into those of one of several materials, or of one between two of them.
    ///
    /// At position 0 the object is damped as the first material, at 1 as the second, and so on; between two, the damping of each mode is
    /// interpolated geometrically. Link the output to `damping` of the `ModalBank`: the object changes while it sounds. Frequencies stay,
    /// as they follow from stiffness and density.
    pub struct MaterialBlendParams {}
}
ports! {
    pub struct MaterialBlendPorts / MaterialBlendIo {
        in {
            /// The modes of the object.
            modes: Value<Modes>,
            /// The materials.
            materials: Many<Value<Material>>,
            /// Position among the materials, from 0 for the first.
            position: Stream<f32>,
        }
        out {
            /// Factors of the dampings, one channel for each mode.
            factors: Stream<f32>,
        }
    }
}

/// The node `MaterialBlend`.
#[derive(Debug)]
pub struct MaterialBlend {
    /// Logarithms of the factors, `[materials][modes]`.
    logs: Vec<Vec<f64>>,
    /// Position and factors of the latest item.
    latest: Option<f32>,
    factors: Vec<f32>,
}

/// Logarithms of the factors that turn the dampings of modes into those of a material.
fn logs(modes: &Modes, material: &Material) -> Vec<f64> {
    let each = modes.frequencies.iter().zip(&modes.dampings);
    each.map(|(f, d)| {
        let lambda = (TAU * f).powi(2) + d * d;
        (0.5 * material.damping.c(lambda) / d).max(1e-9).ln()
    })
    .collect()
}

impl MaterialBlend {
    fn set(&mut self, position: f32) {
        let last = self.logs.len().saturating_sub(1);
        let at = if position.is_finite() { f64::from(position).clamp(0.0, last as f64) } else { 0.0 };
        let (k, share) = ((at.floor() as usize).min(last), at.fract());
        let next = (k + 1).min(last);
        let (Some(a), Some(b)) = (self.logs.get(k), self.logs.get(next)) else { return };
        for ((factor, a), b) in self.factors.iter_mut().zip(a).zip(b) {
            *factor = (a + share * (b - a)).exp() as f32;
        }
        self.latest = Some(position);
    }
}

impl Node for MaterialBlend {
    type Params = MaterialBlendParams;
    type Ports = MaterialBlendPorts;
    const NAME: &'static str = "MaterialBlend";
    const CLASS: Class = Class::Audio;

    fn shape(_: &MaterialBlendParams, s: &mut Shape<'_, '_, MaterialBlendPorts>) -> Result<(), Reject> {
        let position = s.input(MaterialBlendPorts::position);
        if position.format.0 != 1 {
            let message = format!("`position` has {} channels; one is needed", position.format.0);
            return Err(Reject::new("F046", message).at("position"));
        }
        let modes = s.value(MaterialBlendPorts::modes).map_or(1, |modes| modes.len());
        let Ok(channels) = u16::try_from(modes) else {
            let message = format!("{modes} modes; a stream has at most {} channels", u16::MAX);
            return Err(Reject::new("F078", message).at("modes"));
        };
        s.when_ended(MaterialBlendPorts::position, Ends::Hold);
        s.output(MaterialBlendPorts::factors, position.rate, Channels(channels));
        Ok(())
    }

    fn build(_: &MaterialBlendParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let modes = cx.value(MaterialBlendPorts::modes);
        modes.validate().map_err(|e| Fault::new("F078", e.to_string()).at("modes"))?;
        let materials = cx.many_values(MaterialBlendPorts::materials);
        let logs = materials.iter().map(|material| logs(&modes, material)).collect();
        Ok(Self { logs, latest: None, factors: vec![1.0; modes.len()] })
    }

    fn run(&mut self, mut io: MaterialBlendIo<'_>) -> Result<(), Fault> {
        let width = io.factors.width().max(1);
        for (position, out) in io.position.items().iter().zip(io.factors.items().chunks_exact_mut(width)) {
            if self.latest.is_none_or(|latest| latest.to_bits() != position.to_bits()) {
                self.set(*position);
            }
            out.iter_mut().zip(&self.factors).for_each(|(out, factor)| *out = *factor);
        }
        Ok(())
    }

    fn finish(&mut self, _: MaterialBlendIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("materials", self.logs.len().into())])
    }

    archive_state!(latest, factors);

    fn trial(_: &mut Rng) -> (MaterialBlendParams, MemoryFiles) {
        (MaterialBlendParams {}, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::AnyValue;
    use crate::core::item::Data;
    use crate::core::standalone::{Feed, Standalone};
    use crate::core::time::{Rate, ticks};
    use crate::material::DampingModel;

    fn material(a1: f64) -> Material {
        let damping = DampingModel::Rayleigh { a1, a2: 0.0 };
        Material { damping, ..Material::trial(&mut Rng::new(1)) }
    }

    #[test]
    fn the_position_selects_materials_and_interpolates_between_them() {
        let modes = Modes::new("bar", vec![100.0, 200.0], vec![2.0, 4.0], vec![1.0; 2]).unwrap();
        let positions = vec![0.0, 0.5, 1.0, 9.0, f32::NAN];
        let standalone = Standalone::new::<MaterialBlend>(MaterialBlendParams {})
            .value(MaterialBlendPorts::modes, modes)
            .feed(MaterialBlendPorts::materials.index(), Feed::value(AnyValue::new(material(4.0))))
            .feed(MaterialBlendPorts::materials.index(), Feed::value(AnyValue::new(material(64.0))))
            .input(MaterialBlendPorts::position, Rate::hz(10), Channels(1), positions);
        let factors = standalone.window(ticks(0.2)).run().unwrap().stream(MaterialBlendPorts::factors);
        // c = 4 and 64 1/s are d = 2 and 32; halfway is d = 8.
        let expected = [1.0, 0.5, 4.0, 2.0, 16.0, 8.0, 16.0, 8.0, 1.0, 0.5];
        assert!(
            factors.iter().zip(expected).all(|(a, b): (&f32, f32)| (a / b - 1.0).abs() < 1e-5),
            "{factors:?}"
        );
    }
}
