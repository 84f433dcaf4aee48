//! Textured surfaces, and bodies that scrape over them.

use super::Registry;
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

/// Adds the families of textures and of scraping.
pub(super) fn add(types: Registry) -> Registry {
    types
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
}
