//! The node types that graphs can use: a plain list, one line a type.

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
use crate::grain::correlation::correlation_patterns_file::CorrelationPatternsFile;
use crate::grain::correlation::grain_correlate::GrainCorrelate;
use crate::grain::dictionary::grain_dictionary::GrainDictionaryNode;
use crate::grain::dictionary::grain_dictionary_file::GrainDictionaryFile;
use crate::grain::recording::grain_recordings::GrainRecordingsNode;
use crate::grain::reduction::grain_cluster::GrainCluster;
use crate::grain::reduction::grain_compression::GrainCompression;
use crate::grain::reduction::grain_subset::GrainSubset;
use crate::grain::reduction::variation_report::VariationReport;
use crate::grain::segmentation::flux_segmenter::FluxSegmenter;
use crate::grain::segmentation::spectral_flux::SpectralFlux;
use crate::grain::sinusoid::additive_resynth::AdditiveResynth;
use crate::grain::sinusoid::partial_tracks::PartialTracks;
use crate::grain::sinusoid::sine_peaks::SinePeaks;
use crate::grain::sinusoid::transient_residual::TransientResidual;
use crate::grain::statistics::grain_texture::GrainTexture;
use crate::grain::statistics::pattern_generator::PatternGenerator;
use crate::grain::statistics::pattern_model_file::PatternModelFile;
use crate::grain::statistics::pattern_statistics::PatternStatistics;
use crate::grain::synthesis::grain_retarget::GrainRetarget;
use crate::grain::synthesis::pattern_report::PatternReport;
use crate::grain::synthesis::pattern_resynth::PatternResynth;
use crate::grain::synthesis::pattern_timescale::PatternTimescale;
use crate::grain::synthesis::pattern_variation::PatternVariation;
use crate::likeness::likeness_report::LikenessReport;
use crate::likeness::likeness_table::LikenessTable;
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
use crate::mesh::mesh_generator::MeshGenerator;
use crate::mesh::mesh_sequence::MeshSequence;
use crate::mesh::mesh_subdivide::MeshSubdivide;
use crate::modal::bank::modal_bank::ModalBankNode;
use crate::modal::extraction::impacts_from_recording::ImpactsFromRecording;
use crate::modal::extraction::modal_features::ModalFeatures;
use crate::modal::extraction::modal_from_recording::ModalFromRecording;
use crate::modal::extraction::sound_comparison::SoundComparison;
use crate::modal::impact::impact_file::ImpactFile;
use crate::modal::impact::impact_force::ImpactForce;
use crate::modal::mode::membrane_modes::MembraneModes;
use crate::modal::mode::modes_file::ModesFile;
use crate::modal::residual::modal_residual::ModalResidual;
use crate::modal::surface::contact_damping::ContactDamping;
use crate::modal::surface::impact_projector::ImpactProjector;
use crate::modal::surface::mode_decay_times::ModeDecayTimes;
use crate::modal::surface::support_contacts::SupportContacts;
use crate::rigid::classification::contact_classifier::ContactClassifier;
use crate::rigid::classification::contact_report::ContactReport;
use crate::rigid::log::contact_log::ContactLog;
use crate::scrape::crossing::feature_crossings::FeatureCrossings;
use crate::scrape::isophote::isophote_excitation::IsophoteExcitation;
use crate::scrape::level::level_matcher::LevelMatcher;
use crate::scrape::level::lod_select::LodSelect;
use crate::scrape::level::pair_matcher::PairMatcher;
use crate::scrape::map::map_excitation::MapExcitation;
use crate::scrape::map::path_profile::PathProfileNode;
use crate::scrape::noise::noise_excitation::NoiseExcitation;
use crate::scrape::path::contact_path::ContactPath;
use crate::scrape::path::other_surface::OtherSurface;
use crate::scrape::path::stroke::Stroke;
use crate::scrape::relief::two_textures::TwoTextures;
use crate::solid::mesh::revolved_mesh::RevolvedMesh;
use crate::solid::mesh::surface_to_tets::SurfaceToTets;
use crate::solid::mesh::tet_mesh_file::TetMeshFile;
use crate::solid::model::analytic_modes::AnalyticModes;
use crate::solid::model::modal_analysis::ModalAnalysis;
use crate::solid::model::modal_model_file::ModalModelFile;
use crate::solid::model::model_modes::ModelModes;
use crate::soundtrack::matching::fragment_path::FragmentPathNode;
use crate::soundtrack::matching::gesture_spotter::GestureSpotter;
use crate::soundtrack::matching::match_score::MatchScore;
use crate::soundtrack::matching::motion_query::MotionQuery;
use crate::soundtrack::matching::path_frames::PathFrames;
use crate::soundtrack::matching::path_score::PathScore;
use crate::soundtrack::matching::sound_spot::SoundSpot;
use crate::soundtrack::motion::contact_curve::ContactCurve;
use crate::soundtrack::motion::curve_file::CurveFile;
use crate::soundtrack::motion::curve_out::CurveOut;
use crate::soundtrack::motion::motion_curve::MotionCurveNode;
use crate::soundtrack::motion::pose_curve::PoseCurve;
use crate::soundtrack::score::edl_to_score::EdlToScore;
use crate::soundtrack::score::frame_score::FrameScore;
use crate::soundtrack::score::quiet_score::QuietScore;
use crate::soundtrack::score::score_file::ScoreFile;
use crate::soundtrack::score::score_out::ScoreOut;
use crate::soundtrack::synthesis::soundtrack_report::SoundtrackReport;
use crate::soundtrack::synthesis::texture_synthesis::TextureSynthesis;
use crate::soundtrack::synthesis::tree_step::TreeStep;
use crate::soundtrack::wavelet::texture_model::TextureModelNode;
use crate::soundtrack::wavelet::texture_model_file::TextureModelFile;
use crate::soundtrack::wavelet::wavelet_tree::WaveletTreeNode;
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
use crate::texture::class::histogram_class::HistogramClass;
use crate::texture::figure::texture_figure::TextureFigure;
use crate::texture::filter::bilateral::Bilateral;
use crate::texture::filter::dog_features::DogFeatures;
use crate::texture::filter::sobel_map::SobelMap;
use crate::texture::image::image_luma::ImageLuma;
use crate::texture::isophote::isophotes::IsophotesNode;
use crate::texture::isophote::isophotes_file::IsophotesFile;
use crate::texture::map_code::map_coder::MapCoder;
use crate::texture::map_code::map_file::MapFile;
use crate::texture::noise::feature_noise_split::FeatureNoiseSplit;
use crate::texture::noise::noise_profile::NoiseProfileNode;
use crate::texture::noise::noise_profile_file::NoiseProfileFile;
use crate::texture::size::map_sizes::MapSizes;
use crate::texture::size::texture_report::TextureReport;
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

    /// Every node type of this library, by family.
    #[must_use]
    pub fn standard() -> Self {
        Self::empty()
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
            .with::<BinauralCrumplePlayer>()
            .family("grain")
            .with_func::<GrainRecordingsNode>()
            .with_func::<GrainDictionaryNode>()
            .with_func::<GrainDictionaryFile>()
            .with_func::<GrainCorrelate>()
            .with_func::<GrainCluster>()
            .with_func::<GrainSubset>()
            .with_func::<GrainCompression>()
            .with_func::<CorrelationPatternsFile>()
            .with::<GrainRetarget>()
            .with::<PatternResynth>()
            .with_func::<PatternReport>()
            .with::<SpectralFlux>()
            .with::<FluxSegmenter>()
            .with::<SinePeaks>()
            .with::<PartialTracks>()
            .with::<AdditiveResynth>()
            .with::<TransientResidual>()
            .with_func::<PatternTimescale>()
            .with_func::<PatternVariation>()
            .with_func::<PatternStatistics>()
            .with_func::<PatternGenerator>()
            .with_func::<PatternModelFile>()
            .with_func::<VariationReport>()
            .with::<GrainTexture>()
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
            .with::<ImpactFile>()
            .with::<ImpactsFromRecording>()
            .with::<SoundComparison>()
            .with::<ImpactForce>()
            .with_func::<MembraneModes>()
            .with::<ModalBankNode>()
            .with_func::<ModalFeatures>()
            .with_func::<ModalFromRecording>()
            .with::<ModalResidual>()
            .with_func::<ModesFile>()
            .with::<ImpactProjector>()
            .with::<ContactDamping>()
            .with::<SupportContacts>()
            .with::<ModeDecayTimes>()
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
            .family("tension")
            .with::<TensionImpact>()
            .family("texture")
            .with_func::<ImageLuma>()
            .with_func::<HistogramClass>()
            .with_func::<SobelMap>()
            .with_func::<MapCoder>()
            .with_func::<MapFile>()
            .with_func::<Bilateral>()
            .with_func::<DogFeatures>()
            .with_func::<FeatureNoiseSplit>()
            .with_func::<NoiseProfileNode>()
            .with_func::<NoiseProfileFile>()
            .with_func::<MapSizes>()
            .family("scrape")
            .with::<ContactPath>()
            .family("texture")
            .with_func::<IsophotesNode>()
            .with_func::<IsophotesFile>()
            .with_func::<TextureReport>()
            .with_func::<TextureFigure>()
            .family("scrape")
            .with::<FeatureCrossings>()
            .with::<IsophoteExcitation>()
            .with_func::<LevelMatcher>()
            .with::<LodSelect>()
            .with::<MapExcitation>()
            .with::<NoiseExcitation>()
            .with::<OtherSurface>()
            .with::<PathProfileNode>()
            .with::<Stroke>()
            .with_func::<PairMatcher>()
            .with::<TwoTextures>()
            .family("rigid")
            .with::<ContactClassifier>()
            .with::<ContactReport>()
            .with::<ContactLog>()
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
            .with_func::<WarpFile>()
            .family("soundtrack")
            .with_func::<WaveletTreeNode>()
            .with_func::<TextureModelNode>()
            .with_func::<TextureModelFile>()
            .with_func::<ScoreFile>()
            .with_func::<EdlToScore>()
            .with_func::<FrameScore>()
            .with::<ScoreOut>()
            .with_func::<QuietScore>()
            .with::<TextureSynthesis>()
            .with::<SoundtrackReport>()
            .with_func::<TreeStep>()
            .with::<CurveFile>()
            .with::<CurveOut>()
            .with::<PoseCurve>()
            .with::<ContactCurve>()
            .with::<MotionCurveNode>()
            .with_func::<MotionQuery>()
            .with::<GestureSpotter>()
            .with_func::<MatchScore>()
            .with_func::<SoundSpot>()
            .with_func::<FragmentPathNode>()
            .with_func::<PathFrames>()
            .with_func::<PathScore>()
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
