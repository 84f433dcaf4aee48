//! Classification of textures as simple or complex, by the number of tones.
//!
//! The bandwidth `B = exp(-sum p ln p) / 256`, over the histogram `p` of luminance in 256 bins, is the effective number of tones as
//! a fraction of all. Unlike a distance between percentiles, it does not depend on the contrast of two tones.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 2, who write "narrow" and "broad" and state no
//! measure.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::escaped;
use crate::texture::maps::Luma;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Number of bins of the histogram.
pub const BINS: usize = 256;

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
    /// Pixels in each of [`BINS`] bins from black to white, without holes.
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
    let total: f64 = histogram.iter().map(|n| f64::from(*n)).sum();
    let entropy: f64 =
        histogram.iter().filter(|n| **n > 0).map(|n| f64::from(*n) / total).map(|p| -p * p.ln()).sum();
    (entropy.exp() / histogram.len().max(1) as f64) as f32
}

/// Classifies a texture by its bandwidth; `class` overrides the result.
#[must_use]
pub fn classify(luma: &Luma, threshold: f32, class: Option<Class>) -> TextureClass {
    let histogram = histogram(luma);
    let bandwidth = bandwidth(&histogram);
    let found = if bandwidth < threshold { Class::Simple } else { Class::Complex };
    TextureClass { class: class.unwrap_or(found), bandwidth, threshold, histogram }
}

impl Data for TextureClass {
    const NAME: &'static str = "texture class";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let histogram: Vec<u32> = (0..BINS).map(|_| rng.below(500) as u32).collect();
        let bandwidth = bandwidth(&histogram);
        Self { class: Class::Complex, bandwidth, threshold: 0.2, histogram }
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
             <text x=\"{left}\" y=\"{y}\" text-anchor=\"middle\">black</text>\n\
             <text x=\"{right}\" y=\"{y}\" text-anchor=\"middle\">white</text>\n\
             <text x=\"{left}\" y=\"{above}\">{max} pixels</text>\n</svg>",
            y = top + height + 20.0,
            right = left + width,
            above = top - 6.0
        );
        Some(svg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Grid, LumaKind, Surface};
    use std::f64::consts::TAU;

    fn luma(mut tone: impl FnMut(usize, usize) -> f64) -> Luma {
        let grid = Grid::from_fn(512, 512, |x, y| tone(x, y).round().clamp(0.0, 255.0) as f32);
        Luma { grid, holes: Vec::new(), kind: LumaKind::Rec601, surface: Surface::default() }
    }

    fn normal(rng: &mut Rng) -> f64 {
        (-2.0 * (1.0 - rng.uniform()).ln()).sqrt() * (TAU * rng.uniform()).cos()
    }

    /// Tiles of one tone, with joints of another on 6 % of the pixels.
    fn tile(x: usize, y: usize) -> f64 {
        if x % 66 < 2 || y % 66 < 2 { 60.0 } else { 200.0 }
    }

    #[test]
    fn bandwidths_are_those_of_the_table() {
        let mut rng = Rng::new(2);
        let near = |luma: &Luma, expected: f64| {
            let b = f64::from(bandwidth(&histogram(luma)));
            assert!((b / expected - 1.0).abs() < 0.03, "{b} against {expected}");
        };
        near(&luma(tile), 0.0049);
        near(&luma(|x, y| tile(x, y) + 4.0 * normal(&mut rng)), 0.082);
        for (sd, b) in [(4.0, 0.065), (8.0, 0.129), (16.0, 0.259), (32.0, 0.514)] {
            near(&luma(|_, _| 128.0 + sd * normal(&mut rng)), b);
        }
        near(&luma(|_, _| (256.0 * rng.uniform()).floor()), 0.9995);
        near(&luma(|_, _| 77.0), 1.0 / 256.0);
    }

    #[test]
    fn bandwidth_does_not_depend_on_order_or_brightness_and_holes_do_not_count() {
        let image = luma(|x, y| 60.0 + ((x * 31 + y * 17) % 83) as f64);
        let b = classify(&image, 0.2, None).bandwidth;
        let mut other = image.clone();
        let mut rng = Rng::new(4);
        (1..other.grid.samples.len()).rev().for_each(|k| other.grid.samples.swap(k, rng.below(k + 1)));
        other.grid.samples.iter_mut().for_each(|x| *x += 40.0);
        assert_eq!(classify(&other, 0.2, None).bandwidth, b);
        let mut pierced = luma(tile);
        pierced.grid.samples[..512].fill(0.0);
        pierced.holes = vec![false; 512 * 512];
        pierced.holes[..512].fill(true);
        assert_eq!(histogram(&pierced)[0], 0);
    }

    #[test]
    fn the_threshold_separates_simple_from_complex_unless_the_class_is_given() {
        let simple = luma(tile);
        assert_eq!(classify(&simple, 0.2, None).class, Class::Simple);
        assert_eq!(classify(&simple, 0.2, Some(Class::Complex)).class, Class::Complex);
        let ramp = luma(|x, _| x as f64 / 2.0);
        assert_eq!(classify(&ramp, 0.2, None).class, Class::Complex);
        let svg = classify(&ramp, 0.2, None).plot().unwrap();
        assert!(svg.contains("(complex; simple below 0.2)") && svg.matches("<rect").count() > 200, "{svg}");
    }

    #[test]
    fn lightness_is_counted_over_its_own_range() {
        let mut image = luma(|_, _| 100.0);
        image.kind = LumaKind::Lstar;
        assert_eq!(histogram(&image)[255], 512 * 512);
    }
}
