//! The modes of a solid object with their shapes on its surface.

use super::super::fem::assembly::Discretisation;
use super::super::fem::eigen::{EigenError, Request, eigenmodes};
use super::super::fem::elements::{Isotropic, Order};
use super::super::mesh::element::signed_volume;
use super::super::mesh::tet_mesh::TetMesh;
use super::surface::{Flow, Surface};
use crate::contact::vector::sub;
use crate::core::computation::Monitor;
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::modal::surface::surface_view::SurfaceView;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Version of the format of [`ModalModel`].
pub const MODEL_VERSION: u32 = 1;
/// The first bytes of its file.
pub const MARK: &[u8] = b"foley:modal-model\n";

/// Modes of free vibration, without damping.
///
/// # Shapes
/// `modes` of each list per mode, in ascending order of frequency; `vertices` of each list per vertex of the surface. `shapes` is
/// `[vertices][3][modes]`, orthonormal in the mass: in kg^(-1/2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModalModel {
    /// [`MODEL_VERSION`].
    pub version: u32,
    /// Squares of the angular frequencies, rad^2/s^2.
    pub lambda: Vec<f64>,
    /// Vertices of the surface, m.
    pub vertices: Vec<[f64; 3]>,
    /// Triangles over the vertices, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Outward unit normals at the vertices.
    pub normals: Vec<[f64; 3]>,
    /// Displacements of the vertices.
    pub shapes: Vec<f32>,
    /// Integral of the outward normal displacement over the surface, m^2 kg^(-1/2).
    pub net_flow: Vec<f64>,
    /// Integral of its absolute value, m^2 kg^(-1/2).
    pub absolute_flow: Vec<f64>,
    /// Integral of its square, m^2 / kg.
    pub square_flow: Vec<f64>,
    /// The material it was computed for.
    pub material: Isotropic,
    /// Mass, kg.
    pub mass: f64,
    /// Volume, m^3.
    pub volume: f64,
    /// Area of the surface, m^2.
    pub area: f64,
    /// Centre of mass, m.
    pub centre: [f64; 3],
    /// Moments of inertia xx, yy, zz, xy, yz, zx about the centre of mass, kg m^2.
    pub inertia: [f64; 6],
    /// Order of the elements.
    pub order: Order,
    /// Highest frequency asked for, Hz.
    pub highest: f64,
    /// Number of modes below it, by the signs of pivots; more than there are if the number was limited.
    pub counted: u64,
    /// Bound of the relative residuals of the modes, a power of ten.
    pub residual: f64,
    /// Bound of the relative residuals of the motions of rigid bodies, a power of ten.
    pub rigid_residual: f64,
    /// Hash of the mesh.
    pub mesh_hash: [u8; 32],
}

impl ModalModel {
    /// Computes the modes of a mesh; `monitor` is called between steps.
    ///
    /// # Errors
    /// As [`eigenmodes`].
    ///
    /// # Example
    /// ```
    /// use foley_nodes::solid::{Isotropic, ModalModel, Order, Request, mesh::shapes::block};
    /// let steel = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };
    /// let bar = block([0.2, 0.02, 0.02], [10, 1, 1]);
    /// let request = Request { highest: 5000.0, ..Request::default() };
    /// let model = ModalModel::analyse(&bar, &steel, Order::Quadratic, &request, &|_| false)?;
    /// // Two bending modes of 2.5 kHz, as the bar is square.
    /// assert!(model.frequencies().iter().all(|f| (f / 2510.0 - 1.0).abs() < 0.02));
    /// # Ok::<(), foley_nodes::solid::EigenError>(())
    /// ```
    pub fn analyse(
        mesh: &TetMesh,
        material: &Isotropic,
        order: Order,
        request: &Request,
        monitor: &Monitor<'_>,
    ) -> Result<Self, EigenError> {
        let surface = Surface::new(mesh)?;
        let space = Discretisation::new(mesh, order);
        let matrix = space.assemble(material);
        let modes = eigenmodes(mesh, &space, &matrix, request, monitor)?;
        let flows = surface.flows(&space, &modes.shapes);
        let each = |part: fn(&Flow) -> f64| flows.iter().map(part).collect();
        let (centre, inertia) = moments(mesh, material.density);
        let volume = mesh.volume();
        Ok(Self {
            version: MODEL_VERSION,
            net_flow: each(|f| f.net),
            absolute_flow: each(|f| f.absolute),
            square_flow: each(|f| f.square),
            shapes: surface.shapes(&modes.shapes),
            lambda: modes.lambda,
            material: *material,
            mass: material.density * volume,
            volume,
            area: surface.area(),
            centre,
            inertia,
            order,
            highest: request.highest,
            counted: modes.counted as u64,
            residual: bound(modes.residual, -9),
            rigid_residual: bound(modes.rigid_residual, -12),
            mesh_hash: hash(mesh),
            vertices: surface.vertices,
            triangles: surface.triangles,
            normals: surface.normals,
        })
    }

    /// Number of modes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lambda.len()
    }

    /// Returns true if there are no modes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lambda.is_empty()
    }

    /// Frequencies without damping, Hz.
    #[must_use]
    pub fn frequencies(&self) -> Vec<f64> {
        self.lambda.iter().map(|x| x.sqrt() / TAU).collect()
    }

    /// Displacements of a vertex along an axis, by mode.
    #[must_use]
    pub fn shape(&self, vertex: usize, axis: usize) -> &[f32] {
        self.surface().shape(vertex, axis)
    }

    /// The surface with the shapes of all modes.
    #[must_use]
    pub fn surface(&self) -> SurfaceView<'_> {
        SurfaceView {
            vertices: &self.vertices,
            triangles: &self.triangles,
            normals: &self.normals,
            shapes: &self.shapes,
            modes: self.len(),
        }
    }

    /// Checks lengths and ranges.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn validate(&self) -> Result<(), String> {
        let (m, s) = (self.lambda.len(), self.vertices.len());
        let check = |good: bool, what: &str| {
            if good { Ok(()) } else { Err(format!("a modal model has a wrong field: {what}")) }
        };
        let finite = |list: &[f64]| list.iter().all(|x| x.is_finite());
        if self.version != MODEL_VERSION {
            let found = self.version;
            return Err(format!("the modal model has version {found}; this reads version {MODEL_VERSION}"));
        }
        check(m > 0 && s > 0 && !self.triangles.is_empty(), "it has no modes, or no surface")?;
        check(self.lambda.iter().all(|x| x.is_finite() && *x > 0.0), "`lambda` must be above 0")?;
        check(self.lambda.is_sorted(), "`lambda` must ascend")?;
        check(
            s.checked_mul(3).and_then(|n| n.checked_mul(m)) == Some(self.shapes.len()),
            "length of `shapes`",
        )?;
        check(self.normals.len() == s, "length of `normals`")?;
        let flows = [&self.net_flow, &self.absolute_flow, &self.square_flow];
        check(flows.iter().all(|f| f.len() == m && finite(f)), "flows through the surface")?;
        check(
            self.triangles.iter().flatten().all(|c| (*c as usize) < s),
            "`triangles` name missing vertices",
        )?;
        let numbers = [self.mass, self.volume, self.area, self.highest, self.residual, self.rigid_residual];
        check(
            numbers.iter().all(|x| x.is_finite() && *x > 0.0),
            "mass, volume, area, highest and residuals are above 0",
        )?;
        check(self.vertices.iter().chain(&self.normals).all(|p| finite(p)), "a vertex is not finite")?;
        check(finite(&self.centre) && finite(&self.inertia), "centre and inertia must be finite")?;
        check(self.shapes.iter().all(|x| x.is_finite()), "a shape is not finite")?;
        self.material.validate().map_err(|e| e.to_string())
    }

    /// The model as one file: a signature, the version, the hash of all fields, and these.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let fields = postcard::to_allocvec(self).map_err(|e| e.to_string())?;
        let mut out = MARK.to_vec();
        out.extend(self.version.to_le_bytes());
        out.extend(blake3::hash(&fields).as_bytes());
        out.extend(fields);
        Ok(out)
    }

    /// The model in such a file.
    ///
    /// # Errors
    /// Other files, other versions, damaged fields.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let rest = bytes.strip_prefix(MARK).ok_or("this is not a modal model")?;
        let Some((version, rest)) = rest.split_first_chunk::<4>() else {
            return Err("this modal model is too short".into());
        };
        let found = u32::from_le_bytes(*version);
        if found != MODEL_VERSION {
            return Err(format!("the modal model has version {found}; this reads version {MODEL_VERSION}"));
        }
        let Some((hash, fields)) = rest.split_first_chunk::<32>() else {
            return Err("this modal model is too short".into());
        };
        if hash != blake3::hash(fields).as_bytes() {
            return Err("the modal model is damaged or was changed: its fields have another hash".into());
        }
        let model: Self =
            postcard::from_bytes(fields).map_err(|e| format!("the modal model is damaged: {e}"))?;
        model.validate()?;
        Ok(model)
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let f = self.frequencies();
        vec![
            ("modes", self.len().into()),
            ("lowest_hz", f.first().copied().unwrap_or(0.0).into()),
            ("highest_hz", f.last().copied().unwrap_or(0.0).into()),
            ("counted_modes", self.counted.into()),
            ("mass_kg", self.mass.into()),
            ("volume_m3", self.volume.into()),
            ("surface_vertices", self.vertices.len().into()),
            ("extent_m", self.surface().extent().into()),
            ("residual_below", self.residual.into()),
        ]
    }
}

/// The next power of ten, at least `10^lowest`: residuals are rounding errors, which differ between machines.
fn bound(residual: f64, lowest: i32) -> f64 {
    (lowest..=0).map(|k| libm::exp10(k.into())).find(|bound| residual <= *bound).unwrap_or(1.0)
}

/// Hash of the nodes, elements and curves of a mesh.
fn hash(mesh: &TetMesh) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let middles = mesh.curves.iter().map(|(_, middle)| middle);
    for x in mesh.nodes.iter().chain(middles).flatten() {
        hasher.update(&x.to_le_bytes());
    }
    let ends = mesh.curves.iter().flat_map(|(ends, _)| ends);
    for c in mesh.tets.iter().flatten().chain(ends) {
        hasher.update(&c.to_le_bytes());
    }
    *hasher.finalize().as_bytes()
}

/// Centre of mass, and moments of inertia about it: of each element exactly, if it is curved by quadrature.
fn moments(mesh: &TetMesh, density: f64) -> ([f64; 3], [f64; 6]) {
    let (mut mass, mut first) = (0.0, [0.0; 3]);
    for tet in &mesh.tets {
        if let Some(points) = mesh.curved(tet) {
            for p in &points {
                mass += density * p.weight;
                (0..3).for_each(|k| first[k] += density * p.weight * p.position[k]);
            }
            continue;
        }
        let p = mesh.corners(tet);
        let m = density * signed_volume(&p);
        mass += m;
        (0..3).for_each(|k| first[k] += 0.25 * m * p.iter().map(|q| q[k]).sum::<f64>());
    }
    let centre = first.map(|x| x / mass);
    // The integral of x_a x_b is V / 20 times (sum of x_a) (sum of x_b) + sum of x_a x_b over the corners.
    let mut second = [[0.0; 3]; 3];
    let mut add = |m: f64, entry: &dyn Fn(usize, usize) -> f64| {
        for (a, row) in second.iter_mut().enumerate() {
            row.iter_mut().enumerate().for_each(|(b, sum)| *sum += m * entry(a, b));
        }
    };
    for tet in &mesh.tets {
        if let Some(points) = mesh.curved(tet) {
            for p in &points {
                let q = sub(p.position, centre);
                add(density * p.weight, &|a, b| q[a] * q[b]);
            }
            continue;
        }
        let p = mesh.corners(tet).map(|q| sub(q, centre));
        let m = density * signed_volume(&mesh.corners(tet)) / 20.0;
        let sum: [f64; 3] = std::array::from_fn(|k| p.iter().map(|q| q[k]).sum());
        add(m, &|a, b| sum[a] * sum[b] + p.iter().map(|q| q[a] * q[b]).sum::<f64>());
    }
    let [xx, yy, zz] = [second[0][0], second[1][1], second[2][2]];
    (centre, [yy + zz, zz + xx, xx + yy, -second[0][1], -second[1][2], -second[2][0]])
}

impl Data for ModalModel {
    const NAME: &'static str = "modal model";
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mesh = <TetMesh as Data>::trial(rng);
        let surface = Surface::new(&mesh).unwrap_or(Surface {
            nodes: vec![],
            vertices: vec![],
            triangles: vec![],
            normals: vec![],
        });
        let m = 1 + rng.below(12);
        let mut lambda: Vec<f64> = (0..m).map(|_| (TAU * rng.between(100.0, 15e3)).powi(2)).collect();
        lambda.sort_by(f64::total_cmp);
        let mut list =
            |n: usize, low: f64, high: f64| (0..n).map(|_| rng.between(low, high)).collect::<Vec<f64>>();
        let density = 2000.0;
        let (centre, inertia) = moments(&mesh, density);
        let volume = mesh.volume();
        Self {
            version: MODEL_VERSION,
            shapes: list(surface.vertices.len() * 3 * m, -3.0, 3.0).iter().map(|x| *x as f32).collect(),
            net_flow: list(m, -1e-3, 1e-3),
            absolute_flow: list(m, 1e-3, 1e-2),
            square_flow: list(m, 1e-3, 1e-2),
            lambda,
            material: Isotropic { young: 50e9, poisson: 0.2, density },
            mass: density * volume,
            volume,
            area: surface.area(),
            centre,
            inertia,
            order: Order::Quadratic,
            highest: 20e3,
            counted: m as u64,
            residual: 1e-9,
            rigid_residual: 1e-12,
            mesh_hash: hash(&mesh),
            vertices: surface.vertices,
            triangles: surface.triangles,
            normals: surface.normals,
        }
    }

    fn file(&self) -> Option<Vec<u8>> {
        self.to_bytes().ok()
    }
}
