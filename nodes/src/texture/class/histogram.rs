//! Classification of textures as simple or complex, by the number of tones.
//!
//! The bandwidth `B = exp(-sum p ln p) / 256`, over the histogram `p` of luminance in 256 bins, is the effective number of tones as
//! a fraction of all. Unlike a distance between percentiles, it does not depend on the contrast of two tones. The bins cover the
//! percentiles 1 to 99 of the luminance, so that it does not depend on the contrast of gradations either.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 2, who write "narrow-band" and "broad-band" and state no
//! measure. Entropy, the stretched range and the threshold are choices of foley.

pub use super::stretch::BINS;
use super::stretch::stretched;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::escaped;
use crate::texture::maps::Luma;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Class of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Class {
    /// Few tones with edges between them. It sounds best by its discontinuity map.
    Simple,
    /// Many tones with smooth transitions. It sounds best by isophotes, or by features and noise.
    Complex,
}

/// The histogram of a texture, its bandwidth and class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextureClass {
    /// The class.
    pub class: Class,
    /// Effective number of tones as a fraction of all, above 0 to 1.
    pub bandwidth: f32,
    /// Bandwidth below which textures are simple.
    pub threshold: f32,
    /// Luminance of the first and of the last bin.
    pub range: [f32; 2],
    /// Pixels in each of [`BINS`] bins, without holes.
    pub histogram: Vec<u32>,
}

/// Counts the pixels in each of [`BINS`] bins, without holes.
#[must_use]
pub fn histogram(luma: &Luma) -> Vec<u32> {
    let scale = (BINS - 1) as f32 / luma.kind.max();
    let mut counts = vec![0; BINS];
    for (k, x) in luma.grid.samples.iter().enumerate() {
        if luma.holes.get(k) != Some(&true) {
            counts[((x * scale).round().max(0.0) as usize).min(BINS - 1)] += 1;
        }
    }
    counts
}

/// Returns the exponential of the entropy over the number of bins.
#[must_use]
pub fn bandwidth(histogram: &[u32]) -> f32 {
    entropy_bandwidth(&histogram.iter().map(|n| f64::from(*n)).collect::<Vec<_>>())
}

fn entropy_bandwidth(pixels: &[f64]) -> f32 {
    let total: f64 = pixels.iter().sum();
    let entropy: f64 = pixels.iter().filter(|n| **n > 0.0).map(|n| n / total).map(|p| -p * p.ln()).sum();
    (entropy.exp() / pixels.len().max(1) as f64) as f32
}

/// Bandwidth below which a texture is simple, by [`classify`].
pub const THRESHOLD: f32 = 0.5;

/// Classifies a texture by the bandwidth of its luminance between the percentiles 1 and 99; `class` overrides the result.
#[must_use]
pub fn classify(luma: &Luma, threshold: f32, class: Option<Class>) -> TextureClass {
    let (range, pixels) = stretched(luma);
    let histogram = pixels.iter().map(|n| n.round() as u32).collect();
    TextureClass::new(entropy_bandwidth(&pixels), range, histogram, threshold, class)
}

/// Classifies a texture by the bandwidth of its luminance from black to white, as the paper's histograms are drawn.
///
/// This bandwidth is proportional to the contrast of gradations; the table of known values holds for a `threshold` of 0.2.
#[must_use]
pub fn classify_unstretched(luma: &Luma, threshold: f32, class: Option<Class>) -> TextureClass {
    let histogram = histogram(luma);
    TextureClass::new(bandwidth(&histogram), [0.0, luma.kind.max()], histogram, threshold, class)
}

impl TextureClass {
    fn new(
        bandwidth: f32,
        range: [f32; 2],
        histogram: Vec<u32>,
        threshold: f32,
        class: Option<Class>,
    ) -> Self {
        let found = if bandwidth < threshold { Class::Simple } else { Class::Complex };
        Self { class: class.unwrap_or(found), bandwidth, threshold, range, histogram }
    }
}

impl Data for TextureClass {
    const NAME: &'static str = "texture class";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let histogram: Vec<u32> = (0..BINS).map(|_| rng.below(500) as u32).collect();
        let bandwidth = bandwidth(&histogram);
        Self { class: Class::Complex, bandwidth, threshold: THRESHOLD, range: [0.0, 100.0], histogram }
    }

    /// The histogram and the class: figure 2 of Picard, Tsingos and Faure (2008).
    fn plot(&self) -> Option<String> {
        const SIZE: [f64; 2] = [720.0, 400.0];
        const FRAME: [f64; 4] = [50.0, 60.0, 640.0, 290.0];
        let max = f64::from(self.histogram.iter().copied().max().filter(|max| *max > 0)?);
        let class = format!("{:?}", self.class).to_lowercase();
        let title = format!(
            "Luminance: {:.1} effective tones of {BINS}, bandwidth {:.3} ({class}; simple below {})",
            f64::from(self.bandwidth) * BINS as f64,
            self.bandwidth,
            self.threshold
        );
        let [left, top, width, height] = FRAME;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"{}\" height=\"{}\" fill=\"white\"/>\n\
             <text x=\"{left}\" y=\"30\" font-weight=\"bold\">{}</text>\n",
            SIZE[0],
            SIZE[1],
            SIZE[0],
            SIZE[1],
            escaped(&title)
        );
        let bar = width / BINS as f64;
        for (k, count) in self.histogram.iter().enumerate().filter(|(_, n)| **n > 0) {
            let high = height * f64::from(*count) / max;
            // Writing to a string cannot fail.
            let _ = writeln!(
                svg,
                "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{bar:.2}\" height=\"{high:.2}\" fill=\"#2166ac\"/>",
                left + k as f64 * bar,
                top + height - high
            );
        }
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"black\"/>\n\
             <text x=\"{left}\" y=\"{y}\" text-anchor=\"middle\">{dark:.1}</text>\n\
             <text x=\"{right}\" y=\"{y}\" text-anchor=\"middle\">{light:.1}</text>\n\
             <text x=\"{left}\" y=\"{above}\">{max} pixels</text>\n</svg>",
            y = top + height + 20.0,
            right = left + width,
            above = top - 6.0,
            dark = self.range[0],
            light = self.range[1]
        );
        Some(svg)
    }
}

#[cfg(test)]
mod tests;
