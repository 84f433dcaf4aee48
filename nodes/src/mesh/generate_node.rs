//! Synthetic meshes as a source of motion.

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
        /// Two sheets `gap` apart, the upper one sliding along x at `speed`: the slip speed is `speed`.
        Planes,
        /// A sheet with a wave of `amplitude` and `wavelength` that travels `frequency` wavelengths per second.
        SineSheet,
        /// A paraboloid that swings between `curvature` and its opposite `frequency` times per second.
        Bowl,
        /// A sphere of `radius` that turns about z `frequency` times per second.
        Sphere,
        /// A tube of `radius` along z, `size[1]` long, whose ends twist against each other by up to `twist` turns.
        Cylinder,
    }
}

params! {
    /// A synthetic mesh with known motion, for tests and demonstrations.
    ///
    /// Z is up, and the rest pose is that of time zero. A parameter that the scene does not
    /// name has no effect.
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
        /// Distance of the two planes.
        gap: f64 = 0.01, unit "m", range 0.0..=10.0;
        /// Height of the wave.
        amplitude: f64 = 0.01, unit "m", range 0.0..=10.0;
        /// Length of the wave along x.
        wavelength: f64 = 0.5, unit "m", range 0.001..=1000.0;
        /// Curvature at the bottom of the bowl.
        curvature: f64 = 1.3, unit "1/m", range -1000.0..=1000.0;
        /// Periods, or turns, per second.
        frequency: f64 = 1.0, unit "Hz", range -1000.0..=1000.0;
        /// Radius of sphere and tube.
        radius: f64 = 0.5, unit "m", range 0.001..=1000.0;
        /// How often the sphere's triangles are split into four.
        subdivisions: u32 = 3, unit "times", range 0..=7;
        /// Greatest twist of the tube's ends.
        twist: f64 = 0.25, unit "turns", range -100.0..=100.0;
        /// Where the middle of the scene lies.
        place: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -1000.0..=1000.0;
        /// What it is made of.
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

/// The node over [`Synthetic`].
pub struct MeshGenerator {
    scene: Box<dyn Synthetic + Send>,
    place: [f32; 3],
}

/// Carries positions around the origin to their place.
fn put(place: [f32; 3], positions: &mut [[f32; 3]]) {
    for p in positions {
        *p = std::array::from_fn(|k| p[k] + place[k]);
    }
}

fn place(p: &MeshGeneratorParams) -> [f32; 3] {
    p.place.map(|x| x as f32)
}

fn scene(p: &MeshGeneratorParams) -> Box<dyn Synthetic + Send> {
    let (vertices, size, frequency, radius) = (p.vertices, p.size, p.frequency, p.radius);
    match p.kind {
        Scene::Sheet => Box::new(FlatSheet { vertices, size, velocity: [p.speed, 0.0, 0.0] }),
        Scene::Planes => Box::new(SlidingPlanes { vertices, size, gap: p.gap, speed: p.speed }),
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
        put(place(p), &mut topology.rest);
        let materials = Arc::new(Materials::one(&p.material.0));
        s.output(MeshGeneratorPorts::mesh, p.rate, MeshFormat { materials, ..MeshFormat::moving(topology) });
        s.ends(Some(ticks(p.duration)));
        Ok(())
    }

    fn build(p: &MeshGeneratorParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { scene: scene(p), place: place(p) })
    }

    fn run(&mut self, mut io: MeshGeneratorIo<'_>) -> Result<(), Fault> {
        let (first, width, rate) = (io.mesh.first(), io.mesh.width(), io.mesh.rate());
        for (index, frame) in (first..).zip(io.mesh.items().chunks_exact_mut(width.max(1))) {
            self.scene.positions(index as f64 * rate.den() as f64 / rate.num() as f64, frame);
            put(self.place, frame);
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
    fn a_place_carries_the_rest_pose_and_every_frame_and_a_material_names_them() {
        let place = [1.0, -2.0, 0.5];
        let base = MeshGeneratorParams { vertices: [2, 2], duration: 0.1, ..params() };
        let here =
            Standalone::new::<MeshGenerator>(base.clone()).run().unwrap().stream(MeshGeneratorPorts::mesh);
        let p = MeshGeneratorParams { place, material: "silk".into(), ..base };
        let standalone = Standalone::new::<MeshGenerator>(p);
        let format =
            standalone.shape().unwrap().outputs[0].as_ref().unwrap().format::<Mesh>().unwrap().clone();
        assert_eq!(format.materials.names(), ["silk"]);
        let there = standalone.run().unwrap().stream(MeshGeneratorPorts::mesh);
        for (a, b) in here.iter().zip(&there) {
            assert!((0..3).all(|k| (b[k] - a[k] - place[k] as f32).abs() < 1e-6), "{a:?} {b:?}");
        }
        assert_eq!(format.topology.rest, there[..4]);
    }

    #[test]
    fn every_scene_gives_the_same_frames_in_any_window() {
        for kind in
            [Scene::Sheet, Scene::Planes, Scene::SineSheet, Scene::Bowl, Scene::Sphere, Scene::Cylinder]
        {
            let p =
                MeshGeneratorParams { kind, vertices: [3, 4], subdivisions: 1, duration: 0.3, ..params() };
            let frames = |window| {
                let standalone = Standalone::new::<MeshGenerator>(p.clone()).window(ticks(window));
                standalone.run().unwrap().stream(MeshGeneratorPorts::mesh)
            };
            let whole = frames(1.0);
            assert!(!whole.is_empty());
            for window in [0.001, 0.0177, 0.1] {
                assert_eq!(frames(window), whole, "{kind:?} {window}");
            }
        }
    }
}
