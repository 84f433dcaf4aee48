//! The plain list of all node types.

use crate::contact::analytic::analytic_collider::AnalyticCollider;
use crate::contact::detection::contact_detector::ContactDetector;
use crate::contact::material_router::MaterialRouter;
use crate::contact::skinned::skinned_slip::SkinnedSlip;
use crate::contact::sliding::sliding_speed::SlidingSpeed;
use crate::contact::sliding::speed_map::SpeedMapNode;
use crate::core::node::NodeType;
use crate::crumple::bank_nodes::{CrumpleBankFile, CrumpleExtractor};
use crate::crumple::binaural_player_node::BinauralCrumplePlayer;
use crate::crumple::buckle_node::BuckleDetectorNode;
use crate::crumple::calibration_nodes::{EnergyCalibrationFile, EnergyCalibrationNode};
use crate::crumple::events_node::CrumpleEventsNode;
use crate::crumple::matcher_node::HistogramMatcher;
use crate::crumple::picture::BuckleFigure;
use crate::crumple::player_node::CrumplePlayer;
use crate::curvature::mean_curvature::MeanCurvatureNode;
use crate::curvature::rest_noise::RestNoiseNode;
use crate::feature::gaussian_node::TemporalGaussian;
use crate::feature::mfcc_node::Mfcc;
use crate::friction::between::InterpolatedSpectra;
use crate::friction::binaural_node::BinauralIftNoise;
use crate::friction::builder_node::FrictionModelBuilder;
use crate::friction::ift_noise_node::IftNoiseNode;
use crate::friction::model_nodes::{FrictionModelFile, FrictionModelFromClips};
use crate::friction::pair_node::PairFrictionModel;
use crate::mesh::generate_node::MeshGenerator;
use crate::mesh::sequence_node::MeshSequence;
use crate::mesh::subdivide_node::MeshSubdivide;
use crate::modal::bank_node::ModalBankNode;
use crate::modal::force_node::ImpactForce;
use crate::modal::from_recording::ModalFromRecording;
use crate::modal::impact_file_node::ImpactFile;
use crate::modal::membrane_node::MembraneModes;
use crate::modal::modes_file::ModesFile;
use crate::rigid::classification::contact_classifier::ContactClassifier;
use crate::rigid::log::contact_log::ContactLog;
use crate::scrape::isophote_node::IsophoteExcitation;
use crate::scrape::levels_node::LevelMatcher;
use crate::scrape::lod_node::LodSelect;
use crate::scrape::map_node::MapExcitation;
use crate::scrape::meet_node::FeatureCrossings;
use crate::scrape::noise_node::NoiseExcitation;
use crate::scrape::other_node::OtherSurface;
use crate::scrape::pair_levels_node::PairMatcher;
use crate::scrape::pair_node::TwoTextures;
use crate::scrape::path_node::ContactPath;
use crate::scrape::profile_node::PathProfileNode;
use crate::scrape::stroke_node::Stroke;
use crate::spatial::distance_node::DistanceGain;
use crate::spatial::hrtf_node::StructuralHrtf;
use crate::spatial::occlusion_node::Occlusion;
use crate::spatial::orbit_node::Orbit;
use crate::spatial::pose_file_node::PoseFile;
use crate::spatial::vertex_pose::VertexPose;
use crate::tension::node::TensionImpact;
use crate::texture::class_node::HistogramClass;
use crate::texture::feature_nodes::{Bilateral, DogFeatures, FeatureNoiseSplit};
use crate::texture::image_node::ImageLuma;
use crate::texture::isophotes_node::{IsophotesFile, IsophotesNode};
use crate::texture::map_file_node::MapFile;
use crate::texture::map_nodes::{MapCoder, SobelMap};
use crate::texture::profile_node::NoiseProfileNode;
use crate::texture::sizes::MapSizes;
use crate::texture::texture_report::TextureReport;
use crate::unit::concatenator_node::UnitConcatenator;
use crate::unit::database_node::{UnitDatabaseFile, UnitDatabaseNode};
use crate::unit::global_node::GlobalUnitSelector;
use crate::unit::online_node::OnlineUnitSelector;
use crate::unit::report::SelectionReportNode;
use crate::unit::selector_node::UnitSelector;
use crate::warp::diagnostics_node::CorrespondenceDiagnostics;
use crate::warp::fit_node::TpsFit;
use crate::warp::nodes::{Correspondences, TpsWarp, WarpFile};
use crate::warp::suggest_node::CorrespondenceSuggester;
use crate::{dsp, io, live};

/// Every node type, one line each, by family.
#[must_use]
pub fn all() -> Vec<NodeType> {
    vec![
        NodeType::of::<io::nodes::WavInNode>("io"),
        NodeType::of::<io::nodes::WavOutNode>("io"),
        NodeType::of::<dsp::Advance>("dsp"),
        NodeType::of::<dsp::nodes::BiquadNode>("dsp"),
        NodeType::each::<dsp::nodes::ChannelsNode>("dsp"),
        NodeType::of::<dsp::nodes::CrossfadeNode>("dsp"),
        NodeType::of::<dsp::nodes::DelayNode>("dsp"),
        NodeType::of::<dsp::nodes::FadeNode>("dsp"),
        NodeType::of::<dsp::nodes::FeedbackNode>("dsp"),
        NodeType::of::<dsp::nodes::GainNode>("dsp"),
        NodeType::of::<dsp::nodes::HighPassNode>("dsp"),
        NodeType::of::<dsp::nodes::ImpulsesNode>("dsp"),
        NodeType::of::<dsp::nodes::LevelMeterNode>("dsp"),
        NodeType::of::<dsp::nodes::LoudnessNode>("dsp"),
        NodeType::of::<dsp::nodes::LowPassNode>("dsp"),
        NodeType::of::<dsp::nodes::MetronomeNode>("dsp"),
        NodeType::of::<dsp::nodes::MixNode>("dsp"),
        NodeType::each::<dsp::nodes::MonoNode>("dsp"),
        NodeType::of::<dsp::nodes::NoiseNode>("dsp"),
        NodeType::of::<dsp::nodes::NormalizeNode>("dsp"),
        NodeType::of::<dsp::nodes::PanNode>("dsp"),
        NodeType::of::<dsp::nodes::ResampleNode>("dsp"),
        NodeType::of::<dsp::nodes::SweepNode>("dsp"),
        NodeType::of::<dsp::nodes::ToneNode>("dsp"),
        NodeType::of::<dsp::nodes::TrimNode>("dsp"),
        NodeType::of::<MeshSequence>("mesh"),
        NodeType::of::<MeshGenerator>("mesh"),
        NodeType::of::<MeshSubdivide>("mesh"),
        NodeType::of::<ContactDetector>("contact"),
        NodeType::of::<AnalyticCollider>("contact"),
        NodeType::each::<MaterialRouter>("contact"),
        NodeType::of::<SlidingSpeed>("contact"),
        NodeType::of::<SkinnedSlip>("contact"),
        NodeType::each::<SpeedMapNode>("contact"),
        NodeType::of::<IftNoiseNode>("friction"),
        NodeType::of::<BinauralIftNoise>("friction"),
        NodeType::of::<FrictionModelBuilder>("friction"),
        NodeType::func::<FrictionModelFromClips>("friction"),
        NodeType::func::<FrictionModelFile>("friction"),
        NodeType::func::<InterpolatedSpectra>("friction"),
        NodeType::func::<PairFrictionModel>("friction"),
        NodeType::of::<MeanCurvatureNode>("curvature"),
        NodeType::of::<RestNoiseNode>("curvature"),
        NodeType::of::<BuckleDetectorNode>("crumple"),
        NodeType::of::<BuckleFigure>("crumple"),
        NodeType::of::<CrumpleEventsNode>("crumple"),
        NodeType::of::<EnergyCalibrationNode>("crumple"),
        NodeType::func::<EnergyCalibrationFile>("crumple"),
        NodeType::func::<CrumpleExtractor>("crumple"),
        NodeType::func::<CrumpleBankFile>("crumple"),
        NodeType::of::<HistogramMatcher>("crumple"),
        NodeType::of::<CrumplePlayer>("crumple"),
        NodeType::of::<BinauralCrumplePlayer>("crumple"),
        NodeType::of::<Mfcc>("feature"),
        NodeType::of::<TemporalGaussian>("feature"),
        NodeType::func::<UnitDatabaseNode>("unit"),
        NodeType::func::<UnitDatabaseFile>("unit"),
        NodeType::of::<UnitSelector>("unit"),
        NodeType::of::<GlobalUnitSelector>("unit"),
        NodeType::of::<OnlineUnitSelector>("unit"),
        NodeType::of::<UnitConcatenator>("unit"),
        NodeType::of::<SelectionReportNode>("unit"),
        NodeType::of::<ImpactFile>("modal"),
        NodeType::of::<ImpactForce>("modal"),
        NodeType::func::<MembraneModes>("modal"),
        NodeType::of::<ModalBankNode>("modal"),
        NodeType::func::<ModalFromRecording>("modal"),
        NodeType::func::<ModesFile>("modal"),
        NodeType::of::<TensionImpact>("tension"),
        NodeType::func::<ImageLuma>("texture"),
        NodeType::func::<HistogramClass>("texture"),
        NodeType::func::<SobelMap>("texture"),
        NodeType::func::<MapCoder>("texture"),
        NodeType::func::<MapFile>("texture"),
        NodeType::func::<Bilateral>("texture"),
        NodeType::func::<DogFeatures>("texture"),
        NodeType::func::<FeatureNoiseSplit>("texture"),
        NodeType::func::<NoiseProfileNode>("texture"),
        NodeType::func::<MapSizes>("texture"),
        NodeType::of::<ContactPath>("scrape"),
        NodeType::func::<IsophotesNode>("texture"),
        NodeType::func::<IsophotesFile>("texture"),
        NodeType::func::<TextureReport>("texture"),
        NodeType::of::<FeatureCrossings>("scrape"),
        NodeType::of::<IsophoteExcitation>("scrape"),
        NodeType::func::<LevelMatcher>("scrape"),
        NodeType::of::<LodSelect>("scrape"),
        NodeType::of::<MapExcitation>("scrape"),
        NodeType::of::<NoiseExcitation>("scrape"),
        NodeType::of::<OtherSurface>("scrape"),
        NodeType::of::<PathProfileNode>("scrape"),
        NodeType::of::<Stroke>("scrape"),
        NodeType::func::<PairMatcher>("scrape"),
        NodeType::of::<TwoTextures>("scrape"),
        NodeType::of::<ContactClassifier>("rigid"),
        NodeType::of::<ContactLog>("rigid"),
        NodeType::of::<StructuralHrtf>("spatial"),
        NodeType::of::<DistanceGain>("spatial"),
        NodeType::of::<Occlusion>("spatial"),
        NodeType::of::<Orbit>("spatial"),
        NodeType::of::<PoseFile>("spatial"),
        NodeType::each::<VertexPose>("spatial"),
        NodeType::func::<Correspondences>("warp"),
        NodeType::of::<CorrespondenceDiagnostics>("warp"),
        NodeType::of::<CorrespondenceSuggester>("warp"),
        NodeType::of::<TpsFit>("warp"),
        NodeType::of::<TpsWarp>("warp"),
        NodeType::func::<WarpFile>("warp"),
        NodeType::of::<live::LiveContacts>("live"),
        NodeType::of::<live::LiveControl>("live"),
        NodeType::of::<live::LiveImpacts>("live"),
        NodeType::of::<live::LiveMesh>("live"),
    ]
}
