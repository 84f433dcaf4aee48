//! Damped modes of an object at contact points, as a node.

use super::cull::{Culling, DropCounts, Voice, cull};
use super::modal_model::ModalModel;
use super::radiance::{Listener, Radiance, radiation_damping};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::material::{DampingModel, Material};
use crate::modal::Modes;
use crate::modal::surface::contact::contacts;
use crate::modal::surface::mode_shapes::ModeShapes;
use crate::{params, ports};

params! {
    /// Modes for a `ModalBank`: those of an object, damped by its material, with a row of gains for each contact point.
    ///
    /// An impulse along the direction of a contact point excites each mode by its displacement there. The gain of a mode is the
    /// pressure after an impulse of 1 N s, by the chosen model of radiation. Points are positions on the surface, or numbers of
    /// its vertices; those of `points` come first. Without any there is one contact point: the vertex where the sound is loudest. Its decay rate is `c / 2` with the damping `c` of the material at the mode's frequency.
    ///
    /// Modes are left out if they lie outside of the band, do not oscillate, or are too weak at every point of the surface; the
    /// summary counts them by reason.
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), section 3.1; Raghuvanshi and Lin, "Interactive sound synthesis for large scale environments"
    /// (I3D 2006), for merging.
    pub struct ModelModesParams {
        /// Positions of contact points; each is moved to the nearest point of the surface.
        points: Vec<[f64; 3]> = Vec::new(), unit "m", range -1_000_000.0..=1_000_000.0;
        /// Vertices of the surface that are contact points.
        vertices: Vec<u32> = Vec::new(), unit "", range 0..=4_294_967_295_u32;
        /// Direction of the impulse at each contact point; empty for inwards, along the normal.
        directions: Vec<[f64; 3]> = Vec::new(), unit "", range -1_000_000.0..=1_000_000.0;
        /// Maximum distance of a point from the surface, relative to the size of the object.
        max_off_surface: f64 = 0.05, unit "", range 0.0..=1000.0;
        /// Model of radiation.
        radiance: Radiance = Radiance::Sphere;
        /// Distance of the listener.
        distance: f64 = 1.0, unit "m", range 0.1..=1000.0;
        /// Position of the listener in the coordinates of the mesh; None for `distance` along z from the centre of mass.
        listener: Option<[f64; 3]> = None, unit "m", range -1_000_000.0..=1_000_000.0;
        /// Sound pressure that is full scale.
        full_scale: f64 = 20.0, unit "Pa", range 0.000001..=1_000_000.0;
        /// Add the damping by the radiated sound.
        radiation_damping: bool = false;
        /// Lowest frequency of a mode.
        lowest: f64 = 20.0, unit "Hz", range 0.0..=1_000_000.0;
        /// Highest frequency of a mode.
        highest: f64 = 20_000.0, unit "Hz", range 1.0..=1_000_000.0;
        /// Gain relative to the loudest mode below which a mode is left out, if it is so at every point of the surface.
        floor: f64 = -80.0, unit "dB", range -300.0..=0.0;
        /// Width of the bands in which modes are merged, in just noticeable differences of frequency; 0 for none.
        jnd_scale: f64 = 0.0, unit "", range 0.0..=100.0;
        /// Do not merge modes that beat with each other audibly.
        keep_beats: bool = true;
        /// Maximum number of modes: the strongest ones at the contact points.
        top: Option<usize> = None, unit "", range 1..=1_000_000;
    }
}
ports! {
    pub struct ModelModesPorts / ModelModesIo {
        in {
            /// The modes with their shapes.
            model: Value<ModalModel>,
            /// The material; its damping is used.
            material: Value<Material>,
        }
        out {
            /// The modes.
            modes: Value<Modes>,
            /// Their shapes on the surface, in the same order: for impacts anywhere on it, and for contacts that damp them.
            shapes: Value<ModeShapes>,
        }
    }
}

/// The node over [`voices`] and [`cull`].
#[derive(Debug)]
pub struct ModelModes;

/// All modes of a model, damped, with their gains at contact points.
///
/// The response to a unit impulse `J` is `q = (phi . J / omega_d) exp(-d t) sin(omega_d t)`. Radiated pressure follows the velocity of the
/// mode, so the gain is `phi . J omega_n / omega_d` times the pressure per velocity, `pressures[mode]`.
#[must_use]
pub fn voices(
    model: &ModalModel,
    damping: &DampingModel,
    impulses: &[Vec<f64>],
    pressures: &[f64],
    radiation: bool,
) -> Vec<Voice> {
    let mut reach = vec![0.0_f64; model.len()];
    for vertex in 0..model.vertices.len() {
        let along = model.surface().along_normal(vertex);
        reach.iter_mut().zip(along).for_each(|(reach, x)| *reach = reach.max(x.abs()));
    }
    let voice = |(mode, reach): (usize, f64)| {
        let lambda = model.lambda[mode];
        let extra = if radiation { radiation_damping(model, mode) } else { 0.0 };
        let c = damping.c(lambda) + extra;
        let ratio = (lambda / (lambda - 0.25 * c * c).max(f64::MIN_POSITIVE)).sqrt();
        let factor = ratio * pressures[mode];
        let gains = impulses.iter().map(|j| j[mode] * factor).collect();
        Voice { lambda, c, gains, reach: reach * factor.abs(), members: vec![(mode, factor)] }
    };
    reach.into_iter().enumerate().map(voice).collect()
}

/// The vertex at which an impulse along the normal gives the most energy of sound over all modes.
fn loudest_vertex(model: &ModalModel, pressures: &[f64]) -> u32 {
    let energy = |vertex: usize| -> f64 {
        pressures.iter().zip(model.surface().along_normal(vertex)).map(|(p, x)| (p * x).powi(2)).sum()
    };
    let energies = (0..model.vertices.len()).map(|vertex| (vertex, energy(vertex)));
    energies.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(vertex, _)| vertex as u32)
}

/// The shapes of the remaining modes of a model, for a sound pressure that is full scale.
///
/// Modes that were merged have the sum of their shapes, weighted with their sounds.
#[must_use]
pub fn shapes(model: &ModalModel, voices: &[Voice], full_scale: f64) -> ModeShapes {
    let gain = |v: &Voice| match v.members.as_slice() {
        [(_, factor)] => *factor,
        many => many.iter().map(|(_, factor)| factor * factor).sum::<f64>().sqrt(),
    };
    let gains: Vec<f64> = voices.iter().map(gain).collect();
    let displacement = |row: &[f32], v: &Voice, gain: f64| match v.members.as_slice() {
        [(mode, _)] => row[*mode],
        many if gain > 0.0 => {
            (many.iter().map(|(mode, factor)| factor / gain * f64::from(row[*mode])).sum::<f64>()) as f32
        }
        _ => 0.0,
    };
    let rows = model.shapes.chunks_exact(model.len().max(1));
    let shapes =
        rows.flat_map(|row| voices.iter().zip(&gains).map(move |(v, gain)| displacement(row, v, *gain)));
    ModeShapes {
        vertices: model.vertices.clone(),
        triangles: model.triangles.clone(),
        normals: model.normals.clone(),
        shapes: shapes.collect(),
        gains: gains.iter().map(|gain| (gain / full_scale) as f32).collect(),
    }
}

fn summary(counts: &DropCounts) -> Summary {
    vec![
        ("dropped_outside_band", counts.band.into()),
        ("dropped_overdamped", counts.overdamped.into()),
        ("dropped_faint", counts.faint.into()),
        ("merged", counts.merged.into()),
        ("dropped_weaker", counts.weaker.into()),
    ]
}

impl Func for ModelModes {
    type Params = ModelModesParams;
    type Ports = ModelModesPorts;
    const NAME: &'static str = "ModelModes";
    const VERSION: u32 = 2;

    fn eval(p: &ModelModesParams, _: &Build<'_>, mut io: ModelModesIo<'_>) -> Result<Summary, Fault> {
        let (model, material) = (io.model, io.material);
        model.validate().map_err(|e| Fault::new("F078", e).at("model"))?;
        let pressures = p.radiance.pressures(model, &Listener::new(model, p.listener, p.distance));
        let mut vertices = p.vertices.clone();
        if p.points.is_empty() && vertices.is_empty() {
            vertices.push(loudest_vertex(model, &pressures));
        }
        let contacts = contacts(model.surface(), &p.points, &vertices, &p.directions, p.max_off_surface)
            .map_err(|e| Fault::new("F078", e.to_string()).at("points"))?;
        let impulses: Vec<Vec<f64>> = contacts.iter().map(|c| c.impulses(model.surface())).collect();
        let all = voices(model, &material.damping, &impulses, &pressures, p.radiation_damping);
        let culling = Culling {
            lowest: p.lowest,
            highest: p.highest,
            floor: p.floor,
            jnd_scale: p.jnd_scale,
            keep_beats: p.keep_beats,
            top: p.top,
        };
        let (rest, counts) = cull(all, &culling);
        if rest.is_empty() {
            let message = format!("none of the {} modes is left: {counts:?}", model.len());
            return Err(Fault::new("F078", message).at("model"));
        }
        let gains =
            (0..contacts.len()).flat_map(|k| rest.iter().map(move |v| (v.gains[k] / p.full_scale) as f32));
        let modes = Modes::new(
            material.name.clone(),
            rest.iter().map(Voice::frequency).collect(),
            rest.iter().map(Voice::decay).collect(),
            gains.collect(),
        )
        .map_err(|e| Fault::new("F078", e.to_string()).at("material"))?;
        let mut figures: Summary = vec![
            ("modes", modes.len().into()),
            ("contact_points", modes.points().into()),
            ("ring_time_s", modes.ring_time().into()),
        ];
        figures.extend(summary(&counts));
        io.modes.set(modes);
        io.shapes.set(shapes(model, &rest, p.full_scale));
        Ok(figures)
    }

    fn trial(rng: &mut Rng) -> (ModelModesParams, MemoryFiles) {
        let contacts = 1 + rng.below(3);
        let each = |rng: &mut Rng| [0.0; 3].map(|_| rng.between(-1.0, 1.0));
        let params = ModelModesParams {
            // The models of trials lie near the origin.
            points: (0..contacts).map(|_| [0.0; 3].map(|_| rng.between(0.0, 0.1))).collect(),
            vertices: vec![rng.below(8) as u32],
            directions: (0..if rng.below(2) == 0 { 0 } else { contacts + 1 }).map(|_| each(rng)).collect(),
            max_off_surface: 100.0,
            lowest: 1.0,
            highest: 1e6,
            distance: rng.between(0.5, 2.0),
            full_scale: rng.between(1.0, 20.0),
            ..ModelModesParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}
