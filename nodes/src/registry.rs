//! The node types that graphs can use: a plain list, one line a type.
//!
//! Those of a feature of this crate are listed in a module of its name.

#[cfg(feature = "grains")]
mod grains;
#[cfg(feature = "impact")]
mod impact;
#[cfg(feature = "material")]
mod material;
#[cfg(feature = "numbers")]
mod numbers;
mod omitted;
#[cfg(feature = "texture")]
mod texture;

pub use omitted::omitted_features;

use crate::contact::analytic::analytic_collider::AnalyticCollider;
use crate::contact::detection::contact_detector::ContactDetector;
use crate::contact::material_router::MaterialRouter;
use crate::contact::skinned::skinned_slip::SkinnedSlip;
use crate::contact::sliding::contact_pressure::ContactPressure;
use crate::contact::sliding::sliding_speed::SlidingSpeed;
use crate::contact::sliding::speed_map::SpeedMapNode;
use crate::core::node::{Each, Func, Node, NodeType};
use crate::crumple::bank::crumple_bank_file::CrumpleBankFile;
use crate::crumple::bank::crumple_extractor::CrumpleExtractor;
use crate::crumple::buckling::buckle_detector::BuckleDetectorNode;
use crate::crumple::buckling::buckle_figure::BuckleFigure;
use crate::crumple::events::crumple_events::CrumpleEventsNode;
use crate::crumple::matching::energy_calibration::EnergyCalibrationNode;
use crate::crumple::matching::energy_calibration_file::EnergyCalibrationFile;
use crate::crumple::matching::histogram_matcher::HistogramMatcher;
use crate::crumple::playback::binaural_crumple_player::BinauralCrumplePlayer;
use crate::crumple::playback::crumple_player::CrumplePlayer;
use crate::curvature::mean_curvature::MeanCurvatureNode;
use crate::curvature::rest_noise::RestNoiseNode;
use crate::feature::mfcc::Mfcc;
use crate::feature::temporal_gaussian::TemporalGaussian;
use crate::friction::builder::friction_model_builder::FrictionModelBuilder;
use crate::friction::builder::friction_model_from_clips::FrictionModelFromClips;
use crate::friction::builder::synthetic_roller::SyntheticRoller;
use crate::friction::model::friction_model_file::FrictionModelFile;
use crate::friction::model::interpolated_spectra::InterpolatedSpectra;
use crate::friction::model::pair_friction_model::PairFrictionModel;
use crate::friction::synthesis::binaural_ift_noise::BinauralIftNoise;
use crate::friction::synthesis::ift_noise::IftNoiseNode;
use crate::likeness::likeness_report::LikenessReport;
use crate::likeness::likeness_table::LikenessTable;
use crate::mesh::mesh_generator::MeshGenerator;
use crate::mesh::mesh_sequence::MeshSequence;
use crate::mesh::mesh_subdivide::MeshSubdivide;
use crate::modal::impact::impact_file::ImpactFile;
use crate::modal::impact::impact_force::ImpactForce;
use crate::spatial::hrtf::structural_hrtf::StructuralHrtf;
use crate::spatial::interaural::interaural_cues::InterauralCues;
use crate::spatial::motion::bvh_pose::BvhPose;
use crate::spatial::motion::object_pose::ObjectPose;
use crate::spatial::motion::orbit::Orbit;
use crate::spatial::motion::pose_file::PoseFile;
use crate::spatial::motion::vertex_pose::VertexPose;
use crate::spatial::obstruction::occlusion::Occlusion;
use crate::spatial::propagation::distance_gain::DistanceGain;
use crate::table::table_out::TableOut;
use crate::take::take_cutter::TakeCutter;
use crate::tension::tension_impact::TensionImpact;
use crate::unit::concatenation::unit_concatenator::UnitConcatenator;
use crate::unit::database::unit_database::UnitDatabaseNode;
use crate::unit::database::unit_database_file::UnitDatabaseFile;
use crate::unit::selection::global_unit_selector::GlobalUnitSelector;
use crate::unit::selection::online_unit_selector::OnlineUnitSelector;
use crate::unit::selection::selection_report::SelectionReportNode;
use crate::unit::selection::unit_selector::UnitSelector;
use crate::warp::correspondence::correspondence_figure::CorrespondenceFigure;
use crate::warp::correspondence::correspondence_set::Correspondences;
use crate::warp::diagnostics::correspondence_diagnostics::CorrespondenceDiagnostics;
use crate::warp::fit::tps_fit::TpsFit;
use crate::warp::fit::tps_warp::TpsWarp;
use crate::warp::fit::warp_file::WarpFile;
use crate::warp::suggestion::correspondence_suggester::CorrespondenceSuggester;
use crate::{dsp, io, live_input};
use std::sync::Arc;

/// Node types by name, in the order in which they were added.
///
/// # Example
///
/// A program with nodes of its own adds them to those of this library:
///
/// ```
/// # use foley_nodes::dsp::nodes::GainNode;
/// # use foley_nodes::registry::Registry;
/// let registry = Registry::empty().family("own").with::<GainNode>();
/// assert_eq!(registry.get("Gain").map(|ty| ty.family), Some("own"));
/// ```
#[derive(Clone, Debug)]
pub struct Registry {
    types: Vec<Arc<NodeType>>,
    family: &'static str,
}

impl Default for Registry {
    fn default() -> Self {
        Self::standard()
    }
}

impl Registry {
    /// No node types.
    #[must_use]
    pub fn empty() -> Self {
        Self { types: Vec::new(), family: "own" }
    }

    /// Sets the family of the node types that are added next; it is `own` at first.
    #[must_use]
    pub fn family(mut self, family: &'static str) -> Self {
        self.family = family;
        self
    }

    /// Adds a [`Node`].
    ///
    /// # Panics
    /// When there is a node type of that name: graphs could not name one of them.
    #[must_use]
    pub fn with<N: Node>(self) -> Self {
        let family = self.family;
        self.with_type(NodeType::of::<N>(family))
    }

    /// Adds an [`Each`].
    ///
    /// # Panics
    /// As [`Registry::with`].
    #[must_use]
    pub fn with_each<E: Each>(self) -> Self {
        let family = self.family;
        self.with_type(NodeType::each::<E>(family))
    }

    /// Adds a [`Func`].
    ///
    /// # Panics
    /// As [`Registry::with`].
    #[must_use]
    pub fn with_func<F: Func>(self) -> Self {
        let family = self.family;
        self.with_type(NodeType::func::<F>(family))
    }

    /// Adds a node type.
    ///
    /// # Panics
    /// As [`Registry::with`].
    #[must_use]
    pub fn with_type(mut self, ty: NodeType) -> Self {
        assert!(self.get(ty.name).is_none(), "there are two node types `{}`", ty.name);
        self.types.push(Arc::new(ty));
        self
    }

    /// The node type of a name.
    ///
    /// # Complexity
    /// Linear in the number of node types.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Arc<NodeType>> {
        self.types.iter().find(|ty| ty.name == name)
    }

    /// All node types, in the order in which they were added.
    #[must_use]
    pub fn types(&self) -> &[Arc<NodeType>] {
        &self.types
    }

    /// The families of the node types, each once, in that order.
    #[must_use]
    pub fn families(&self) -> Vec<&'static str> {
        let mut all = Vec::new();
        for ty in &self.types {
            if !all.contains(&ty.family) {
                all.push(ty.family);
            }
        }
        all
    }

    /// Every node type of this library that the features of this build have, by family.
    #[must_use]
    pub fn standard() -> Self {
        let types = Self::empty()
            .family("io")
            .with::<io::nodes::WavInNode>()
            .with::<io::nodes::WavOutNode>()
            .with::<TableOut>()
            .family("dsp")
            .with::<dsp::Advance>()
            .with::<dsp::nodes::BiquadNode>()
            .with_each::<dsp::nodes::ChannelsNode>()
            .with::<dsp::nodes::CrossfadeNode>()
            .with::<dsp::nodes::DelayNode>()
            .with::<dsp::nodes::FadeNode>()
            .with::<dsp::nodes::FeedbackNode>()
            .with::<dsp::nodes::GainNode>()
            .with::<dsp::nodes::HighPassNode>()
            .with::<dsp::nodes::ImpulsesNode>()
            .with::<dsp::nodes::LevelMeterNode>()
            .with::<dsp::nodes::Limiter>()
            .with::<dsp::nodes::LoudnessNode>()
            .with::<dsp::nodes::LowPassNode>()
            .with::<dsp::nodes::MetronomeNode>()
            .with::<dsp::nodes::MixNode>()
            .with_each::<dsp::nodes::MonoNode>()
            .with::<dsp::nodes::NoiseNode>()
            .with::<dsp::nodes::NormalizeNode>()
            .with::<dsp::nodes::TransientTransfer>()
            .with::<dsp::nodes::PanNode>()
            .with::<dsp::nodes::ResampleNode>()
            .with::<dsp::nodes::SweepNode>()
            .with::<dsp::nodes::ToneNode>()
            .with::<dsp::nodes::TriggerFile>()
            .with::<dsp::nodes::TrimNode>()
            .family("mesh")
            .with::<MeshSequence>()
            .with::<MeshGenerator>()
            .with::<MeshSubdivide>()
            .family("contact")
            .with::<ContactDetector>()
            .with::<AnalyticCollider>()
            .with_each::<MaterialRouter>()
            .with::<SlidingSpeed>()
            .with::<ContactPressure>()
            .with::<SkinnedSlip>()
            .with_each::<SpeedMapNode>()
            .family("friction")
            .with::<IftNoiseNode>()
            .with::<BinauralIftNoise>()
            .with::<FrictionModelBuilder>()
            .with_func::<FrictionModelFromClips>()
            .with_func::<FrictionModelFile>()
            .with_func::<InterpolatedSpectra>()
            .with::<SyntheticRoller>()
            .with_func::<PairFrictionModel>()
            .family("curvature")
            .with::<MeanCurvatureNode>()
            .with::<RestNoiseNode>()
            .family("crumple")
            .with::<BuckleDetectorNode>()
            .with::<BuckleFigure>()
            .with::<CrumpleEventsNode>()
            .with::<EnergyCalibrationNode>()
            .with_func::<EnergyCalibrationFile>()
            .with_func::<CrumpleExtractor>()
            .with_func::<CrumpleBankFile>()
            .with::<HistogramMatcher>()
            .with::<CrumplePlayer>()
            .with::<BinauralCrumplePlayer>();
        #[cfg(feature = "grains")]
        let types = grains::add(types);
        let types = types
            .family("feature")
            .with::<Mfcc>()
            .with::<TemporalGaussian>()
            .family("take")
            .with_func::<TakeCutter>()
            .family("unit")
            .with_func::<UnitDatabaseNode>()
            .with_func::<UnitDatabaseFile>()
            .with::<UnitSelector>()
            .with::<GlobalUnitSelector>()
            .with::<OnlineUnitSelector>()
            .with::<UnitConcatenator>()
            .with::<SelectionReportNode>()
            .family("likeness")
            .with::<LikenessReport>()
            .with_func::<LikenessTable>()
            .family("modal")
            .with::<ImpactFile>();
        #[cfg(feature = "material")]
        let types = material::recorded_impacts(types);
        let types = types.with::<ImpactForce>();
        #[cfg(feature = "impact")]
        let types = impact::banks(types);
        #[cfg(feature = "material")]
        let types = material::recorded_modes(types);
        #[cfg(feature = "impact")]
        let types = impact::modes(types);
        #[cfg(feature = "material")]
        let types = material::add(types);
        let types = types.family("tension").with::<TensionImpact>();
        #[cfg(feature = "texture")]
        let types = texture::add(types);
        #[cfg(feature = "impact")]
        let types = impact::rigid_bodies(types);
        let types = types
            .family("spatial")
            .with::<StructuralHrtf>()
            .with::<InterauralCues>()
            .with::<DistanceGain>()
            .with::<Occlusion>()
            .with::<BvhPose>()
            .with::<ObjectPose>()
            .with::<Orbit>()
            .with::<PoseFile>()
            .with_each::<VertexPose>()
            .family("warp")
            .with_func::<Correspondences>()
            .with::<CorrespondenceFigure>()
            .with::<CorrespondenceDiagnostics>()
            .with::<CorrespondenceSuggester>()
            .with::<TpsFit>()
            .with::<TpsWarp>()
            .with_func::<WarpFile>();
        #[cfg(feature = "numbers")]
        let types = numbers::add(types);
        types
            .family("live")
            .with::<live_input::LiveContacts>()
            .with::<live_input::LiveControl>()
            .with::<live_input::LiveImpacts>()
            .with::<live_input::LiveMesh>()
            .with::<live_input::LiveMeter>()
            .with::<live_input::LiveTriggers>()
            .family("own")
    }
}

/// The node types of [`Registry::standard`].
#[must_use]
pub fn all() -> Vec<Arc<NodeType>> {
    Registry::standard().types
}
