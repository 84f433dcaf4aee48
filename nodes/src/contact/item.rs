//! Contacts and sliding speeds, the items of streams between nodes.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use crate::core::item::Item;
use crate::core::random::Rng;
use crate::mesh::Materials;

/// A contact of a cloth vertex with a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Touched surface: 0 is the cloth itself, 1 and up the others; [`Contact::NONE`] in an empty slot.
    pub surface: u32,
    /// Triangle of that surface.
    pub triangle: u32,
    /// Distance to the closest point of the triangle, metres.
    pub distance: f32,
    /// In-plane coordinates at this frame, not clamped to the triangle: x = a + b0 (b - a) + b1 (c - a) + height n.
    /// Over a degenerate triangle, the barycentric weights of the closest point.
    pub beta: [f32; 2],
    /// Distance moved along the triangle until the next frame, metres.
    pub slide: f32,
    /// Change of the distance from the triangle's plane until the next frame, metres; negative while approaching.
    pub approach: f32,
}

impl Contact {
    /// The surface of an empty slot.
    pub const NONE: u32 = u32::MAX;

    /// Returns true if the slot holds a contact.
    #[must_use]
    pub fn is_some(&self) -> bool {
        self.surface != Self::NONE
    }
}

impl Default for Contact {
    fn default() -> Self {
        Self { surface: Self::NONE, triangle: 0, distance: 0.0, beta: [0.0; 2], slide: 0.0, approach: 0.0 }
    }
}

/// The contacts of every vertex of a cloth, frame by frame.
///
/// `slide` and `approach` are measured to the next frame, so those of the last frame have no meaning.
#[derive(Debug)]
pub struct Contacts;

/// Format of a stream of contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactsFormat {
    /// Area of cloth that each vertex stands for at rest, m^2.
    pub areas: Arc<[f32]>,
    /// Largest number of contacts per vertex, nearest first.
    pub slots: usize,
    /// Material of each vertex of the cloth, an index into the names of the first of `surfaces`.
    pub cloth: Arc<[u16]>,
    /// Materials of the triangles of each surface, those of the cloth first.
    pub surfaces: Arc<[Arc<Materials>]>,
}

impl ContactsFormat {
    /// The format of contacts between surfaces of one unnamed material.
    #[must_use]
    pub fn plain(areas: Arc<[f32]>, slots: usize) -> Self {
        Self { cloth: vec![0; areas.len()].into(), areas, slots, surfaces: Arc::from([]) }
    }

    /// Returns the names of the two materials of a contact of a vertex; empty without one.
    #[must_use]
    pub fn pair(&self, vertex: usize, contact: &Contact) -> [&str; 2] {
        let name =
            |surface: usize, material: u16| self.surfaces.get(surface).map_or("", |m| m.name(material));
        let cloth = self.cloth.get(vertex).copied().unwrap_or(0);
        let surface = contact.surface as usize;
        let other = self.surfaces.get(surface).map_or(0, |m| m.of_triangle(contact.triangle));
        [name(0, cloth), name(surface, other)]
    }
}

impl Item for Contacts {
    type Elem = Contact;
    type Format = ContactsFormat;
    const NAME: &'static str = "contacts";
    const COLUMNS: &'static [&'static str] =
        &["surface", "triangle", "distance", "beta0", "beta1", "slide", "approach"];

    fn width(format: &ContactsFormat) -> usize {
        format.areas.len() * format.slots
    }

    fn describe(format: &ContactsFormat) -> String {
        format!("{} vertices, up to {} contacts each", format.areas.len(), format.slots)
    }

    fn trial_format(rng: &mut Rng) -> ContactsFormat {
        let plain = ContactsFormat::plain(Speeds::trial_format(rng), 1 + rng.below(2));
        let surfaces = ["cotton", "cotton", "wool"].map(|name| Arc::new(Materials::one(name)));
        ContactsFormat { surfaces: Arc::from(surfaces), ..plain }
    }

    fn trial(_: &ContactsFormat, _: usize, rng: &mut Rng) -> Contact {
        if rng.below(4) == 0 {
            return Contact::default();
        }
        let slide = if rng.below(3) == 0 { 0.0 } else { rng.between(0.0, 0.01) as f32 };
        Contact {
            surface: rng.below(3) as u32,
            triangle: rng.below(100) as u32,
            distance: rng.between(0.0, 0.05) as f32,
            beta: [rng.uniform() as f32, rng.uniform() as f32],
            slide,
            approach: rng.between(-0.01, 0.01) as f32,
        }
    }

    fn finite(c: &Contact) -> bool {
        [c.distance, c.beta[0], c.beta[1], c.slide, c.approach].iter().all(|x| x.is_finite())
    }

    fn poison() -> Contact {
        Contact { distance: f32::NAN, slide: f32::NAN, ..Contact::default() }
    }

    fn numbers(c: &Contact, out: &mut Vec<f32>) {
        let surface = if c.is_some() { c.surface as f32 } else { -1.0 };
        out.extend([surface, c.triangle as f32, c.distance, c.beta[0], c.beta[1], c.slide, c.approach]);
    }
}

/// Defines an item of one number for each vertex. In a trial the numbers are from 0 to 3, often 0.
macro_rules! per_vertex {
    ($(#[$doc:meta])* $item:ident, $name:literal) => {
        $(#[$doc])*
        ///
        /// Its format is the area of cloth that each vertex stands for at rest, m^2.
        #[derive(Debug)]
        pub struct $item;

        impl Item for $item {
            type Elem = f32;
            type Format = Arc<[f32]>;
            const NAME: &'static str = $name;
            const COLUMNS: &'static [&'static str] = &[""];

            fn width(format: &Arc<[f32]>) -> usize {
                format.len()
            }

            fn describe(format: &Arc<[f32]>) -> String {
                format!("{} vertices", format.len())
            }

            fn trial_format(rng: &mut Rng) -> Arc<[f32]> {
                (0..1 + rng.below(6)).map(|_| rng.between(1e-5, 1e-3) as f32).collect()
            }

            fn trial(_: &Arc<[f32]>, _: usize, rng: &mut Rng) -> f32 {
                if rng.below(3) == 0 { 0.0 } else { rng.between(0.0, 3.0) as f32 }
            }

            fn finite(elem: &f32) -> bool {
                elem.is_finite()
            }

            fn poison() -> f32 {
                f32::NAN
            }

            fn numbers(elem: &f32, out: &mut Vec<f32>) {
                out.push(*elem);
            }
        }
    };
}

per_vertex! {
    /// The speed at which each vertex of a cloth slides, m/s.
    Speeds, "speeds"
}

per_vertex! {
    /// Contact pressure of each vertex of a cloth, relative to a light contact; 0 without contact.
    Pressures, "pressures"
}
