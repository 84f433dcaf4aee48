//! Damping that moves from one material to another while an object sounds, as a node.

use super::material::Material;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Events, Many, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::modal::mode::damping_curve::DampingCurve;
use crate::{archive_state, params, ports};
use std::f64::consts::TAU;

params! {
    /// The damping of one of several materials, or between two of them, over time.
    ///
    /// At position 0 it is that of the first material, at 1 of the second, and so on; between two, it is interpolated geometrically at each
    /// frequency. Link the output to `material` of a `ModalBank`: the object changes while it sounds. Frequencies stay, as they
    /// follow from stiffness and density.
    pub struct MaterialBlendParams {}
}
ports! {
    pub struct MaterialBlendPorts / MaterialBlendIo {
        in {
            /// The materials.
            materials: Many<Value<Material>>,
            /// Position among the materials, from 0 for the first.
            position: Stream<f32>,
        }
        out {
            /// The damping: an event for each change of the position.
            damping: Events<DampingCurve>,
        }
    }
}

/// The node `MaterialBlend`.
#[derive(Debug)]
pub struct MaterialBlend {
    materials: Vec<DampingCurve>,
    /// Bits of the latest position.
    latest: Option<u32>,
}

impl MaterialBlend {
    fn at(&self, position: f32) -> Option<DampingCurve> {
        let last = self.materials.len().checked_sub(1)?;
        let at = if position.is_finite() { f64::from(position).clamp(0.0, last as f64) } else { 0.0 };
        let k = (at as usize).min(last);
        Some(self.materials[k].blend(&self.materials[(k + 1).min(last)], at - k as f64))
    }
}

impl Node for MaterialBlend {
    type Params = MaterialBlendParams;
    type Ports = MaterialBlendPorts;
    const NAME: &'static str = "MaterialBlend";
    const CLASS: Class = Class::Audio;

    fn shape(_: &MaterialBlendParams, s: &mut Shape<'_, '_, MaterialBlendPorts>) -> Result<(), Reject> {
        let position = s.input(MaterialBlendPorts::position);
        if !s.linked(MaterialBlendPorts::materials) {
            return Err(Reject::new("F137", "there is no material").at("materials"));
        }
        if position.format.0 != 1 {
            let message = format!("`position` has {} channels; one is needed", position.format.0);
            return Err(Reject::new("F046", message).at("position"));
        }
        s.when_ended(MaterialBlendPorts::position, Ends::Hold);
        Ok(())
    }

    fn build(_: &MaterialBlendParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let curve = |material: &Material| {
            // Half of `c`; the decay rate in lambda is neglected.
            DampingCurve::new(|f| 0.5 * material.damping.c((TAU * f).powi(2)))
        };
        let materials = cx.many_values(MaterialBlendPorts::materials);
        Ok(Self { materials: materials.iter().map(|material| curve(material)).collect(), latest: None })
    }

    fn run(&mut self, mut io: MaterialBlendIo<'_>) -> Result<(), Fault> {
        let (rate, first) = (io.position.rate(), io.position.first());
        for (item, position) in (first..).zip(io.position.items()) {
            if self.latest != Some(position.to_bits()) {
                self.latest = Some(position.to_bits());
                if let Some(damping) = self.at(*position) {
                    io.damping.push(rate.tick(item), damping);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: MaterialBlendIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("materials", self.materials.len().into())])
    }

    archive_state!(latest);

    fn trial(_: &mut Rng) -> (MaterialBlendParams, MemoryFiles) {
        (MaterialBlendParams {}, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::{AnyValue, Channels, Data};
    use crate::core::standalone::{Feed, Standalone};
    use crate::core::time::{Rate, ticks};
    use crate::material::DampingModel;

    fn material(a1: f64) -> Material {
        let damping = DampingModel::Rayleigh { a1, a2: 0.0 };
        Material { damping, ..Material::trial(&mut Rng::new(1)) }
    }

    #[test]
    fn the_position_selects_materials_and_interpolates_between_them() {
        let positions = vec![0.0, 0.5, 0.5, 1.0, 9.0, f32::NAN];
        let standalone = Standalone::new::<MaterialBlend>(MaterialBlendParams {})
            .feed(MaterialBlendPorts::materials.index(), Feed::value(AnyValue::new(material(4.0))))
            .feed(MaterialBlendPorts::materials.index(), Feed::value(AnyValue::new(material(64.0))))
            .input(MaterialBlendPorts::position, Rate::hz(10), Channels(1), positions);
        let found = standalone.window(ticks(0.2)).run().unwrap().events(MaterialBlendPorts::damping);
        // c = 4 and 64 1/s are d = 2 and 32; halfway is d = 8. No event where nothing changes.
        let decays: Vec<(i64, f64)> =
            found.iter().map(|(tick, curve)| (tick / ticks(0.1), curve.decay(440.0).round())).collect();
        assert_eq!(decays, [(0, 2.0), (1, 8.0), (3, 32.0), (4, 32.0), (5, 2.0)]);
    }
}
