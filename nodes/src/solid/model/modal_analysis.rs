//! The modes of a mesh, as a node.

use super::super::fem::eigen::{EigenError, Request};
use super::super::fem::elements::{Isotropic, Order};
use super::super::mesh::tet_mesh::TetMesh;
use super::modal_model::ModalModel;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::material::Material;
use crate::{choices, params, ports};

choices! { @param Order {
    /// Ten nodes an element, those in the middle of the edges added; curved edges of the mesh count.
    Quadratic,
    /// Four nodes an element: far too stiff in bending, for comparison.
    Linear,
} }

params! {
    /// Computes the modes of an object from its shape and its material.
    ///
    /// Finite elements of linear elasticity give stiffness and mass of the free object, and its eigenvalue problem the modes below
    /// `highest`. Motions of the whole body are taken out. The number of modes is compared with a count that does not depend on the
    /// iteration, so none is missing. Constants of the material that are set here replace those of the link.
    ///
    /// Modes of elements of order 2 converge from above: a mesh with two elements through each wall is within a few percent, and
    /// a finer one shows by how much. Memory and time are those of a sparse factor, some 0.2 GB and 5 s for 60,000 unknowns of a thin
    /// bowl; a solid block takes more. The surface of the model joins the corners of elements by flat triangles, also where edges are curved.
    ///
    /// # Source
    /// Zienkiewicz and Taylor, "The finite element method" (2000); Ericsson and Ruhe, "The spectral transformation Lanczos method"
    /// (Math. Comp. 35, 1980). Sterling et al. (IEEE TVCG 25(5), 2019), section 3.1.
    pub struct ModalAnalysisParams {
        /// Young's modulus; None for that of the material.
        young: Option<f64> = None, unit "Pa", range 100_000.0..=2_000_000_000_000.0;
        /// Poisson's ratio; None for that of the material. Above 0.45 elements turn too stiff.
        poisson: Option<f64> = None, unit "", range -0.99..=0.499;
        /// Density; None for that of the material.
        density: Option<f64> = None, unit "kg/m^3", range 10.0..=30_000.0;
        /// Modes below this frequency are computed.
        highest: f64 = 20_000.0, unit "Hz", range 20.0..=1_000_000.0;
        /// Order of the elements.
        order: Order = Order::Quadratic;
        /// Maximum number of modes: the lowest ones.
        modes: usize = 2000, unit "", range 1..=20_000;
        /// Maximum memory; a mesh that needs more is an error before it is taken.
        memory: f64 = 4.0, unit "GB", range 0.001..=4096.0;
        /// Permit several separate parts, which ring independently.
        parts: bool = false;
    }
}
ports! {
    pub struct ModalAnalysisPorts / ModalAnalysisIo {
        in {
            /// The shape.
            mesh: Value<TetMesh>,
            /// The material; its elastic constants and its density are used.
            material: Option<Value<Material>>,
        }
        out {
            /// The modes with their shapes.
            model: Value<ModalModel>,
        }
    }
}

/// The node over [`ModalModel::analyse`].
#[derive(Debug)]
pub struct ModalAnalysis;

/// Poisson's ratio above which elements are noticeably too stiff.
const LOCKING: f64 = 0.45;

fn constants(p: &ModalAnalysisParams, material: Option<&Material>) -> Result<Isotropic, Reject> {
    let elastic = material.and_then(|m| m.elastic.as_ref());
    let get = |name: &'static str, own: Option<f64>, linked: Option<f64>| {
        own.or(linked).ok_or_else(|| {
            let found = match material {
                Some(material) => format!("the material {:?} holds no elastic constants", material.name),
                None => "there is no material".into(),
            };
            Reject::new("F137", format!("`{name}` is not known: {found}"))
                .at(name)
                .help("set `young`, `poisson` and `density`, or link a material with `elastic`")
        })
    };
    let constants = Isotropic {
        young: get("young", p.young, elastic.map(|e| e.young))?,
        poisson: get("poisson", p.poisson, elastic.map(|e| e.poisson))?,
        density: get("density", p.density, elastic.map(|e| e.density))?,
    };
    constants.validate().map_err(|e| Reject::new("F137", e.to_string()).at("material"))?;
    Ok(constants)
}

fn fault(e: &EigenError) -> Fault {
    if *e == EigenError::Cancelled {
        return Fault::stopped();
    }
    let (code, field) = match e {
        EigenError::Mesh(_) | EigenError::Rigid { .. } => ("F070", "mesh"),
        EigenError::Memory { .. } => ("F063", "memory"),
        EigenError::None { .. } => ("F078", "highest"),
        _ => ("F078", "mesh"),
    };
    Fault::new(code, e.to_string()).at(field)
}

impl Func for ModalAnalysis {
    type Params = ModalAnalysisParams;
    type Ports = ModalAnalysisPorts;
    const NAME: &'static str = "ModalAnalysis";
    const VERSION: u32 = 2;

    fn check(p: &ModalAnalysisParams, s: &mut Shape<'_, '_, ModalAnalysisPorts>) -> Result<(), Reject> {
        if !s.linked(ModalAnalysisPorts::material) {
            constants(p, None)?;
        }
        if p.poisson.is_some_and(|nu| nu > LOCKING) {
            s.note(format!(
                "Poisson's ratio is above {LOCKING}: elements are too stiff, and frequencies too high"
            ));
        }
        Ok(())
    }

    fn eval(p: &ModalAnalysisParams, cx: &Build<'_>, mut io: ModalAnalysisIo<'_>) -> Result<Summary, Fault> {
        let constants = constants(p, io.material)?;
        let TetMesh { nodes, tets, curves } = io.mesh;
        let mesh = TetMesh::with_curves(nodes.clone(), tets.clone(), curves.clone());
        let mesh = mesh.map_err(|e| fault(&e.into()))?;
        let parts = mesh.quality().components;
        if parts > 1 && !p.parts {
            let message = format!("the mesh consists of {parts} separate parts");
            return Err(Fault::new("F070", message).at("mesh").help("set `parts: true` if it should"));
        }
        let memory = (p.memory * f64::from(1 << 30)) as u64;
        let request = Request { highest: p.highest, max_modes: p.modes, memory, ..Request::default() };
        let model =
            ModalModel::analyse(&mesh, &constants, p.order, &request, cx.monitor).map_err(|e| fault(&e))?;
        let mut summary = model.summary();
        if (model.len() as u64) < model.counted {
            let text =
                format!("the {} lowest of {} modes below {} Hz", model.len(), model.counted, p.highest);
            summary.push(("limited_to", text.into()));
        }
        io.model.set(model);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ModalAnalysisParams, MemoryFiles) {
        let order = if rng.below(2) == 0 { Order::Linear } else { Order::Quadratic };
        let params = ModalAnalysisParams {
            young: Some(rng.between(5e8, 1e9)),
            poisson: Some(rng.between(0.1, 0.4)),
            density: Some(rng.between(900.0, 1100.0)),
            highest: 40_000.0,
            order,
            modes: 20 + rng.below(20),
            memory: 1.0,
            ..ModalAnalysisParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}
