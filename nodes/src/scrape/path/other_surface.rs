//! The node `OtherSurface`.

use super::piece::PathPiece;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::ports::Events;
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params, ports};

params! {
    /// Exchanges the two surfaces of each path.
    ///
    /// A node that reads the result moves over the other surface at the speed of that surface. So each surface of a contact can have its
    /// own noise, map or isophotes, whose forces add up. Pieces without a position on the other surface are left out and counted.
    pub struct OtherSurfaceParams {}
}
ports! {
    pub struct OtherSurfacePorts / OtherSurfaceIo {
        in {
            /// Paths over both surfaces.
            paths: Events<PathPiece>,
        }
        out {
            /// The same, with the surfaces exchanged.
            other: Events<PathPiece>,
        }
    }
}

/// The node `OtherSurface`.
#[derive(Debug)]
pub struct OtherSurface {
    left_out: u64,
}

/// The piece with its surfaces exchanged, if both are known.
pub(in crate::scrape) fn exchanged(piece: &PathPiece) -> Option<PathPiece> {
    piece.other.map(|other| PathPiece { position: other, other: Some(piece.position), ..*piece })
}

impl Node for OtherSurface {
    type Params = OtherSurfaceParams;
    type Ports = OtherSurfacePorts;
    const NAME: &'static str = "OtherSurface";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;

    fn shape(_: &OtherSurfaceParams, _: &mut Shape<'_, '_, OtherSurfacePorts>) -> Result<(), Reject> {
        Ok(())
    }

    fn build(_: &OtherSurfaceParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { left_out: 0 })
    }

    fn run(&mut self, mut io: OtherSurfaceIo<'_>) -> Result<(), Fault> {
        for (tick, piece) in io.paths.events() {
            match exchanged(piece) {
                Some(piece) => io.other.push(*tick, piece),
                None => self.left_out += 1,
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: OtherSurfaceIo<'_>) -> Result<Summary, Fault> {
        Ok(if self.left_out > 0 { vec![("left_out", self.left_out.into())] } else { Vec::new() })
    }

    fn retune(&mut self, _: &OtherSurfaceParams) -> Retune {
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.left_out = old.left_out;
    }

    archive_state!(left_out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::random::Rng;
    use crate::core::standalone::{Feed, Standalone};
    use crate::core::time::{Rate, ticks};
    use crate::scrape::force::contact_force_params::ContactForceParams;
    use crate::scrape::noise::noise_excitation::{
        NoiseExcitation, NoiseExcitationParams, NoiseExcitationPorts,
    };
    use crate::scrape::testing::{piece, rms};
    use crate::texture::NoiseProfile;

    #[test]
    fn surfaces_are_exchanged_and_paths_on_one_surface_are_left_out() {
        let both = PathPiece {
            other: Some(piece([7.0, 1.0], [0.2, 0.0], 0.1).position),
            ..piece([0.0; 2], [1.0, 0.5], 0.1)
        };
        let paths = vec![(5, both), (9, piece([0.0; 2], [1.0, 0.0], 0.1)), (12, exchanged(&both).unwrap())];
        let standalone = Standalone::new::<OtherSurface>(OtherSurfaceParams {});
        let run = standalone.events(OtherSurfacePorts::paths, paths, ticks(0.2)).run().unwrap();
        assert_eq!(run.summary, vec![("left_out", 1.into())]);
        let back = exchanged(&both).unwrap();
        assert_eq!((back.position, back.other), (both.other.unwrap(), Some(both.position)));
        assert_eq!(run.events(OtherSurfacePorts::other), [(5, back), (12, both)]);
    }

    #[test]
    fn noises_of_both_surfaces_are_independent_and_their_powers_add() {
        // One passes at 0.5 m/s, the other at 0.2: two noises at their own speeds.
        let path = PathPiece {
            other: Some(piece([0.0; 2], [0.0, 0.2], 2.0).position),
            ..piece([0.0; 2], [0.5, 0.0], 2.0)
        };
        let mut rng = Rng::new(8);
        let mut profile = || NoiseProfile {
            samples: (0..8192).map(|_| rng.between(-1.0, 1.0) as f32).collect(),
            spacing: 1.0 / 8192.0,
            ..NoiseProfile::default()
        };
        let mut force = |path: PathPiece, seed: u64| {
            let p = NoiseExcitationParams {
                contact: ContactForceParams {
                    rate: Rate::hz(44_100),
                    ..NoiseExcitationParams::read(&|_| None).unwrap().contact
                },
                value: crate::texture::NoiseValue::Height,
                reference: crate::dsp::Reference::Absolute,
                ..NoiseExcitationParams::read(&|_| None).unwrap()
            };
            let mut standalone = Standalone::new::<NoiseExcitation>(p)
                .feed(0, Feed::events(vec![(0, path)], ticks(2.0)))
                .value(NoiseExcitationPorts::noise, profile());
            standalone.seed = seed;
            standalone.run().unwrap().stream(NoiseExcitationPorts::force)
        };
        let (a, b) = (force(path, 1), force(exchanged(&path).unwrap(), 2));
        let sum: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a + b).collect();
        let ratio = (rms(&sum).powi(2)) / (rms(&a).powi(2) + rms(&b).powi(2));
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        // By the square root of the speed.
        assert!((rms(&b) / rms(&a) / 0.4_f64.sqrt() - 1.0).abs() < 0.06, "{}", rms(&b) / rms(&a));
    }
}
