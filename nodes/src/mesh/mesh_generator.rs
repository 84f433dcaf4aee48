//! The node `MeshGenerator`: synthetic meshes as a source of motion.

use super::generate::{Bowl, Cylinder, FlatSheet, SineSheet, SlidingPlanes, Sphere, Synthetic};
use super::{Materials, Mesh, MeshFormat};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node};
use crate::core::params::Text;
use crate::core::ports::Stream;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::{choices, params, ports};
use std::sync::Arc;

choices! {
    /// A synthetic scene.
    pub enum Scene {
        /// A flat sheet that moves along x at `speed`.
        Sheet,
        /// Two sheets at a distance of `gap`; the upper one slides along x, so that the slip speed is `speed`, and grows by `acceleration`.
        Planes,
        /// A sheet with a wave of `amplitude` and `wavelength` that travels at `frequency` wavelengths per second.
        SineSheet,
        /// A paraboloid whose curvature oscillates between `curvature` and its negative at `frequency`.
        Bowl,
        /// A sphere of `radius` that rotates about z at `frequency`.
        Sphere,
        /// A tube of `radius` and length `size[1]` along z whose ends twist against each other by up to `twist` turns.
        Cylinder,
    }
}

params! {
    /// A synthetic mesh with known motion, for tests and demonstrations.
    ///
    /// Z points upward. The rest pose is that of time 0. A parameter that the description of the scene does not name has no
    /// effect.
    pub struct MeshGeneratorParams {
        /// The scene.
        kind: Scene = Scene::Sheet;
        /// Frames per second.
        rate: Rate = Rate::hz(60);
        /// Length of the motion.
        duration: f64 = 4.0, unit "s", range 0.0..=3600.0;
        /// Vertices along x and y; around and along the tube.
        vertices: [usize; 2] = [21, 21], unit "vertices", range 2..=1024;
        /// Size along x and y.
        size: [f64; 2] = [1.0, 1.0], unit "m", range 0.001..=1000.0;
        /// Speed along x.
        speed: f64 = 0.2, unit "m/s", range -100.0..=100.0;
        /// Growth of the speed of `Planes`.
        acceleration: f64 = 0.0, unit "m/s^2", range -100.0..=100.0;
        /// Distance between the two sheets.
        gap: f64 = 0.01, unit "m", range 0.0..=10.0;
        /// Amplitude of the wave.
        amplitude: f64 = 0.01, unit "m", range 0.0..=10.0;
        /// Wavelength along x.
        wavelength: f64 = 0.5, unit "m", range 0.001..=1000.0;
        /// Mean curvature at the centre of the bowl.
        curvature: f64 = 1.3, unit "1/m", range -1000.0..=1000.0;
        /// Periods or revolutions per second.
        frequency: f64 = 1.0, unit "Hz", range -1000.0..=1000.0;
        /// Radius of the sphere or tube.
        radius: f64 = 0.5, unit "m", range 0.001..=1000.0;
        /// Number of subdivisions of the triangles of the sphere into four.
        subdivisions: u32 = 3, unit "times", range 0..=7;
        /// Maximum twist between the ends of the tube.
        twist: f64 = 0.25, unit "turns", range -100.0..=100.0;
        /// Position of the centre of the scene.
        place: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -1000.0..=1000.0;
        /// Name of the material.
        material: Text = "".into();
    }
}

ports! {
    pub struct MeshGeneratorPorts / MeshGeneratorIo {
        in {}
        out {
            /// The moving mesh.
            mesh: Stream<Mesh>,
        }
    }
}

/// The node `MeshGenerator`.
pub struct MeshGenerator {
    scene: Box<dyn Synthetic + Send>,
    centre: [f32; 3],
}

/// Moves positions from the origin to a centre.
fn translate(centre: [f32; 3], positions: &mut [[f32; 3]]) {
    for p in positions {
        *p = std::array::from_fn(|k| p[k] + centre[k]);
    }
}

fn centre(p: &MeshGeneratorParams) -> [f32; 3] {
    p.place.map(|x| x as f32)
}

fn scene(p: &MeshGeneratorParams) -> Box<dyn Synthetic + Send> {
    let (vertices, size, frequency, radius) = (p.vertices, p.size, p.frequency, p.radius);
    match p.kind {
        Scene::Sheet => Box::new(FlatSheet { vertices, size, velocity: [p.speed, 0.0, 0.0] }),
        Scene::Planes => Box::new(SlidingPlanes {
            vertices,
            size,
            gap: p.gap,
            speed: p.speed,
            acceleration: p.acceleration,
        }),
        Scene::SineSheet => Box::new(SineSheet {
            vertices,
            size,
            amplitude: p.amplitude,
            wavelength: p.wavelength,
            frequency,
        }),
        Scene::Bowl => Box::new(Bowl { vertices, size, curvature: p.curvature, frequency }),
        Scene::Sphere => Box::new(Sphere { subdivisions: p.subdivisions, radius, turns: frequency }),
        Scene::Cylinder => {
            Box::new(Cylinder { vertices, radius, length: size[1], twist: p.twist, frequency })
        }
    }
}

impl Node for MeshGenerator {
    type Params = MeshGeneratorParams;
    type Ports = MeshGeneratorPorts;
    const NAME: &'static str = "MeshGenerator";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 20.0;

    fn shape(p: &MeshGeneratorParams, s: &mut Shape<'_, '_, MeshGeneratorPorts>) -> Result<(), Reject> {
        let mut topology = scene(p).topology();
        translate(centre(p), &mut topology.rest);
        let materials = Arc::new(Materials::one(&p.material.0));
        s.output(MeshGeneratorPorts::mesh, p.rate, MeshFormat { materials, ..MeshFormat::moving(topology) });
        s.ends(Some(ticks(p.duration)));
        Ok(())
    }

    fn build(p: &MeshGeneratorParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { scene: scene(p), centre: centre(p) })
    }

    fn run(&mut self, mut io: MeshGeneratorIo<'_>) -> Result<(), Fault> {
        let (first, width, rate) = (io.mesh.first(), io.mesh.width(), io.mesh.rate());
        for (index, frame) in (first..).zip(io.mesh.items().chunks_exact_mut(width.max(1))) {
            self.scene.positions(index as f64 * rate.den() as f64 / rate.num() as f64, frame);
            translate(self.centre, frame);
        }
        Ok(())
    }

    fn trial(rng: &mut crate::core::random::Rng) -> (MeshGeneratorParams, crate::core::files::MemoryFiles) {
        let mut params = <MeshGeneratorParams as crate::core::params::Params>::trial(rng);
        params.vertices = params.vertices.map(|n| 2 + n % 6);
        params.subdivisions %= 3;
        params.duration = params.duration.min(1.0);
        (params, crate::core::files::MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;

    fn params() -> MeshGeneratorParams {
        MeshGeneratorParams::read(&|_| None).expect("every parameter has a default")
    }

    #[test]
    fn the_upper_of_two_planes_moves_by_its_speed() {
        let p = MeshGeneratorParams { kind: Scene::Planes, vertices: [2, 2], duration: 0.5, ..params() };
        let run = Standalone::new::<MeshGenerator>(p).run().unwrap();
        let frames = run.stream(MeshGeneratorPorts::mesh);
        assert_eq!(frames.len(), 30 * 8);
        let moved: Vec<f32> = (0..8).map(|v| frames[29 * 8 + v][0] - frames[v][0]).collect();
        let expected = 0.2 * 29.0 / 60.0;
        assert!(moved[..4].iter().all(|x| x.abs() < 1e-7), "{moved:?}");
        assert!(moved[4..].iter().all(|x| (x - expected).abs() < 1e-6), "{moved:?}");
    }

    #[test]
    fn the_centre_moves_the_rest_pose_and_all_frames_and_the_material_is_named() {
        let centre = [1.0, -2.0, 0.5];
        let base = MeshGeneratorParams { vertices: [2, 2], duration: 0.1, ..params() };
        let at_origin =
            Standalone::new::<MeshGenerator>(base.clone()).run().unwrap().stream(MeshGeneratorPorts::mesh);
        let p = MeshGeneratorParams { place: centre, material: "silk".into(), ..base };
        let standalone = Standalone::new::<MeshGenerator>(p);
        let format =
            standalone.shape().unwrap().outputs[0].as_ref().unwrap().format::<Mesh>().unwrap().clone();
        assert_eq!(format.materials.names(), ["silk"]);
        let moved = standalone.run().unwrap().stream(MeshGeneratorPorts::mesh);
        for (a, b) in at_origin.iter().zip(&moved) {
            assert!((0..3).all(|k| (b[k] - a[k] - centre[k] as f32).abs() < 1e-6), "{a:?} {b:?}");
        }
        assert_eq!(format.topology.rest, moved[..4]);
    }

    #[test]
    fn windows_of_any_length_return_the_same_frames() {
        for kind in
            [Scene::Sheet, Scene::Planes, Scene::SineSheet, Scene::Bowl, Scene::Sphere, Scene::Cylinder]
        {
            let p =
                MeshGeneratorParams { kind, vertices: [3, 4], subdivisions: 1, duration: 0.3, ..params() };
            let frames = |window| {
                let standalone = Standalone::new::<MeshGenerator>(p.clone()).window(ticks(window));
                standalone.run().unwrap().stream(MeshGeneratorPorts::mesh)
            };
            let expected = frames(1.0);
            assert!(!expected.is_empty());
            for window in [0.001, 0.0177, 0.1] {
                assert_eq!(frames(window), expected, "{kind:?} {window}");
            }
        }
    }
}
