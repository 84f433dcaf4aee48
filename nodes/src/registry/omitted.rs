//! Node types that a build leaves out.

use super::Registry;

/// The node types of a feature.
struct Part {
    feature: &'static str,
    /// True if this build has the feature.
    built: bool,
    names: &'static [&'static str],
}

macro_rules! parts {
    ($($feature:literal: $($name:ident)*;)*) => {
        &[$(Part {
            feature: $feature,
            built: cfg!(feature = $feature),
            names: &[$(stringify!($name)),*],
        }),*]
    };
}

/// The node types of all features, in the order in which they are added.
const PARTS: &[Part] = parts! {
    "grains":
        GrainRecordings GrainDictionary GrainDictionaryFile GrainCorrelate GrainCluster GrainSubset
        GrainCompression CorrelationPatternsFile GrainRetarget PatternResynth PatternReport
        SpectralFlux FluxSegmenter SinePeaks PartialTracks AdditiveResynth TransientResidual
        PatternTimescale PatternVariation PatternStatistics PatternGenerator PatternModelFile
        VariationReport GrainTexture;
    "impact":
        MembraneModes ModalBank ModalResidual ModesFile ImpactProjector ContactDamping SupportContacts
        ModeDecayTimes ContactClassifier ContactReport ContactLog;
    "material":
        ImpactsFromRecording SoundComparison ModalFeatures ModalFromRecording DampingExperiment
        DampingFit DampingFromStream DampingPointsFile ElasticRatio FeatureGate FitComparison
        FitConvergence HeldOutKnocks IntervalCoverage ListeningTest MaterialFile MaterialBlend
        MaterialOut MaterialTable RatingStatistics SpuriousFeatures SupportLaw AnalyticModes
        ModalAnalysis ModalModelFile ModelModes RevolvedMesh SurfaceToTets TetMeshFile;
    "numbers":
        WaveletTree TextureModel TextureModelFile ScoreFile EdlToScore FrameScore ScoreOut
        QuietScore TextureSynthesis SoundtrackReport TreeStep CurveFile CurveOut PoseCurve
        ContactCurve MotionCurve MotionQuery GestureSpotter MatchScore SoundSpot FragmentPath
        PathFrames PathScore;
    "texture":
        ImageLuma HistogramClass SobelMap MapCoder MapFile Bilateral DogFeatures FeatureNoiseSplit
        NoiseProfile NoiseProfileFile MapSizes ContactPath Isophotes IsophotesFile TextureReport
        TextureFigure FeatureCrossings IsophoteExcitation LevelMatcher LodSelect MapExcitation
        NoiseExcitation OtherSurface PathProfile Stroke PairMatcher TwoTextures;
};

/// The features with node types that this build does not have.
pub fn omitted_features() -> impl Iterator<Item = &'static str> {
    PARTS.iter().filter(|part| !part.built).map(|part| part.feature)
}

impl Registry {
    /// The feature that a node type of [`Registry::standard`] needs and that this build does not have; none in a build with all features.
    #[must_use]
    pub fn omitted(&self, name: &str) -> Option<&'static str> {
        if self.get(name).is_some() {
            return None;
        }
        PARTS.iter().find(|part| !part.built && part.names.contains(&name)).map(|part| part.feature)
    }
}

#[cfg(all(
    test,
    feature = "grains",
    feature = "impact",
    feature = "material",
    feature = "numbers",
    feature = "texture"
))]
mod tests {
    use super::super::{grains, impact, material, numbers, texture};
    use super::*;

    #[test]
    fn the_names_of_each_feature_are_those_of_its_node_types() {
        let added = |feature| match feature {
            "grains" => grains::add(Registry::empty()),
            "impact" => impact::rigid_bodies(impact::modes(impact::banks(Registry::empty()))),
            "material" => {
                let types = material::recorded_impacts(Registry::empty());
                material::add(material::recorded_modes(types))
            }
            "numbers" => numbers::add(Registry::empty()),
            "texture" => texture::add(Registry::empty()),
            other => panic!("no node types of `{other}`"),
        };
        for part in PARTS {
            let types = added(part.feature);
            let names: Vec<&str> = types.types().iter().map(|ty| ty.name).collect();
            assert_eq!(names, part.names, "{}", part.feature);
        }
    }

    #[test]
    fn a_build_with_all_features_omits_nothing() {
        assert_eq!(omitted_features().next(), None);
        let empty = Registry::empty();
        assert!(PARTS.iter().flat_map(|part| part.names).all(|name| empty.omitted(name).is_none()));
    }
}
