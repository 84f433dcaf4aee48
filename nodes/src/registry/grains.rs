//! Grains of recordings.

use super::Registry;
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

/// Adds the family of grains.
pub(super) fn add(types: Registry) -> Registry {
    types
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
}
