//! Modes from recordings and from shapes, and the damping of materials.

use super::Registry;
use crate::material::experiments::damping_experiment::DampingExperiment;
use crate::material::experiments::fit_comparison::FitComparison;
use crate::material::experiments::fit_convergence::FitConvergence;
use crate::material::experiments::held_out_knocks::HeldOutKnocks;
use crate::material::experiments::interval_coverage::IntervalCoverage;
use crate::material::experiments::material_table::MaterialTable;
use crate::material::experiments::spurious_features::SpuriousFeatures;
use crate::material::experiments::support_law::SupportLaw;
use crate::material::fitting::damping_fit::DampingFit;
use crate::material::fitting::damping_from_stream::DampingFromStream;
use crate::material::fitting::elastic_ratio::ElasticRatio;
use crate::material::library::material_blend::MaterialBlend;
use crate::material::library::material_file::MaterialFile;
use crate::material::library::material_out::MaterialOut;
use crate::material::points::damping_points_file::DampingPointsFile;
use crate::material::points::feature_gate::FeatureGate;
use crate::material::statistics::listening_test::ListeningTest;
use crate::material::statistics::rating_statistics::RatingStatistics;
use crate::modal::extraction::impacts_from_recording::ImpactsFromRecording;
use crate::modal::extraction::modal_features::ModalFeatures;
use crate::modal::extraction::modal_from_recording::ModalFromRecording;
use crate::modal::extraction::sound_comparison::SoundComparison;
use crate::solid::mesh::revolved_mesh::RevolvedMesh;
use crate::solid::mesh::surface_to_tets::SurfaceToTets;
use crate::solid::mesh::tet_mesh_file::TetMeshFile;
use crate::solid::model::analytic_modes::AnalyticModes;
use crate::solid::model::modal_analysis::ModalAnalysis;
use crate::solid::model::modal_model_file::ModalModelFile;
use crate::solid::model::model_modes::ModelModes;

/// Impacts found in recordings, and comparisons with recordings.
pub(super) fn recorded_impacts(types: Registry) -> Registry {
    types.with::<ImpactsFromRecording>().with::<SoundComparison>()
}

/// Modes found in recordings.
pub(super) fn recorded_modes(types: Registry) -> Registry {
    types.with_func::<ModalFeatures>().with_func::<ModalFromRecording>()
}

/// Adds the families of materials and solids.
pub(super) fn add(types: Registry) -> Registry {
    types
        .family("material")
        .with_func::<DampingExperiment>()
        .with_func::<DampingFit>()
        .with::<DampingFromStream>()
        .with_func::<DampingPointsFile>()
        .with_func::<ElasticRatio>()
        .with_func::<FeatureGate>()
        .with_func::<FitComparison>()
        .with_func::<FitConvergence>()
        .with_func::<HeldOutKnocks>()
        .with_func::<IntervalCoverage>()
        .with::<ListeningTest>()
        .with_func::<MaterialFile>()
        .with::<MaterialBlend>()
        .with::<MaterialOut>()
        .with_func::<MaterialTable>()
        .with_func::<RatingStatistics>()
        .with_func::<SpuriousFeatures>()
        .with_func::<SupportLaw>()
        .family("solid")
        .with_func::<AnalyticModes>()
        .with_func::<ModalAnalysis>()
        .with_func::<ModalModelFile>()
        .with_func::<ModelModes>()
        .with_func::<RevolvedMesh>()
        .with_func::<SurfaceToTets>()
        .with_func::<TetMeshFile>()
}
