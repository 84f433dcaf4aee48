//! Luminance of images: CIE lightness of linear light, or the weighted sum of the coded channels.
//!
//! # Source
//! IEC 61966-2-1 (sRGB); CIE 15 (lightness); ITU-R BT.601.

use super::format::{ImageError, Picture, Samples};
use crate::texture::grid::Grid;
use crate::texture::maps::{Luma, LumaKind, Surface};
use rayon::prelude::*;

/// Converts a coded sRGB value to linear light, both 0 to 1.
#[must_use]
pub fn linear(coded: f64) -> f64 {
    if coded <= 0.04045 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
}

/// Returns the CIE lightness, 0 to 100, of a luminance from 0 to 1.
#[must_use]
pub fn lightness(y: f64) -> f64 {
    if y > 0.008_856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
}

/// Look-up tables from coded values to luminance.
struct Tables {
    kind: LumaKind,
    /// Luminance of a grey value.
    grey: Vec<f32>,
    /// Linear light, or the value from 0 to 255, of one channel.
    channel: Vec<f32>,
    weights: [f32; 3],
    /// True to invert the luminance.
    invert: bool,
}

impl Tables {
    fn new(values: usize, kind: LumaKind, invert: bool) -> Self {
        let coded = |k: usize| k as f64 / (values - 1) as f64;
        let flip = |x: f64| if invert { f64::from(kind.max()) - x } else { x };
        let grey = (0..values).map(|k| match kind {
            LumaKind::Lstar => flip(lightness(linear(coded(k)))) as f32,
            LumaKind::Rec601 => flip(255.0 * coded(k)) as f32,
        });
        let channel = (0..values).map(|k| match kind {
            LumaKind::Lstar => linear(coded(k)) as f32,
            LumaKind::Rec601 => (255.0 * coded(k)) as f32,
        });
        let weights = match kind {
            LumaKind::Lstar => [0.2126, 0.7152, 0.0722],
            LumaKind::Rec601 => [0.299, 0.587, 0.114],
        };
        Self { kind, grey: grey.collect(), channel: channel.collect(), weights, invert }
    }

    fn colour(&self, rgb: [usize; 3]) -> f32 {
        let light = |k: usize| self.channel.get(k).copied().unwrap_or_default();
        let [r, g, b] = rgb.map(light);
        let y = self.weights[0] * r + self.weights[1] * g + self.weights[2] * b;
        let luma = match self.kind {
            LumaKind::Rec601 => y,
            // As [`lightness`], in single precision.
            LumaKind::Lstar if y > 0.008_856 => 116.0 * y.cbrt() - 16.0,
            LumaKind::Lstar => 903.3 * y,
        };
        if self.invert { self.kind.max() - luma } else { luma }
    }

    /// Luminance of a pixel, and true if it is a hole.
    fn pixel<T: Copy + Into<usize>>(&self, pixel: &[T]) -> (f32, bool) {
        let grey = |k: T| self.grey.get(k.into()).copied().unwrap_or_default();
        let hole = |alpha: T| 2 * alpha.into() < self.grey.len() - 1;
        match *pixel {
            [g] => (grey(g), false),
            [g, a] => (grey(g), hole(a)),
            [r, g, b] => (self.colour([r, g, b].map(Into::into)), false),
            [r, g, b, a] => (self.colour([r, g, b].map(Into::into)), hole(a)),
            _ => (0.0, true),
        }
    }
}

impl Luma {
    /// Converts an image to luminance. `invert` inverts it, for images with bright grooves.
    ///
    /// # Errors
    /// An image whose every pixel is a hole.
    ///
    /// # Complexity
    /// `O(pixels)`.
    pub fn new(
        picture: &Picture,
        kind: LumaKind,
        invert: bool,
        surface: Surface,
    ) -> Result<Self, ImageError> {
        let (grid, holes) = luminance(picture, kind, invert)?;
        Ok(Self { grid, holes, kind, surface })
    }
}

/// Returns the luminance of an image and its holes, the pixels with an alpha below one half; the latter are empty if there are none.
///
/// Holes have luminance 0. `invert` inverts the luminance, for images with bright grooves.
///
/// # Errors
/// An image whose every pixel is a hole.
///
/// # Complexity
/// `O(pixels)`.
pub fn luminance(picture: &Picture, kind: LumaKind, invert: bool) -> Result<(Grid, Vec<bool>), ImageError> {
    let values = match picture.samples {
        Samples::Bytes(_) => 1 << 8,
        Samples::Words(_) => 1 << 16,
    };
    let tables = Tables::new(values, kind, invert);
    let (samples, holes) = match &picture.samples {
        Samples::Bytes(samples) => pixels(&tables, samples, picture),
        Samples::Words(samples) => pixels(&tables, samples, picture),
    };
    if !holes.is_empty() && holes.iter().all(|hole| *hole) {
        return Err(ImageError::Transparent);
    }
    let holes = if holes.contains(&true) { holes } else { Vec::new() };
    Ok((Grid { width: picture.width, height: picture.height, samples }, holes))
}

fn pixels<T: Copy + Into<usize> + Sync>(
    tables: &Tables,
    samples: &[T],
    of: &Picture,
) -> (Vec<f32>, Vec<bool>) {
    let mut luma = vec![0.0; of.width * of.height];
    let alpha = of.channels == 2 || of.channels == 4;
    let mut holes = vec![false; if alpha { luma.len() } else { 0 }];
    let (row, channels) = (of.width.max(1), of.channels.max(1));
    if alpha {
        let rows =
            luma.par_chunks_mut(row).zip(holes.par_chunks_mut(row)).zip(samples.par_chunks(row * channels));
        rows.for_each(|((luma, holes), samples)| {
            for ((luma, hole), pixel) in luma.iter_mut().zip(holes).zip(samples.chunks_exact(channels)) {
                (*luma, *hole) = tables.pixel(pixel);
                *luma = if *hole { 0.0 } else { *luma };
            }
        });
    } else {
        let rows = luma.par_chunks_mut(row).zip(samples.par_chunks(row * channels));
        rows.for_each(|(luma, samples)| {
            luma.iter_mut()
                .zip(samples.chunks_exact(channels))
                .for_each(|(l, pixel)| *l = tables.pixel(pixel).0);
        });
    }
    (luma, holes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::image::decode::{Format, decode};

    fn picture(channels: usize, samples: Samples) -> Picture {
        let count = match &samples {
            Samples::Bytes(s) => s.len(),
            Samples::Words(s) => s.len(),
        };
        Picture { width: count / channels, height: 1, channels, samples, format: Format::Png }
    }

    #[test]
    fn the_middle_grey_of_srgb_has_a_lightness_of_50() {
        let bytes = picture(1, Samples::Bytes(vec![119, 0, 255]));
        let (grid, holes) = luminance(&bytes, LumaKind::Lstar, false).unwrap();
        assert!((grid.samples[0] - 50.0).abs() < 0.1, "{}", grid.samples[0]);
        assert!(grid.samples[1] == 0.0 && (grid.samples[2] - 100.0).abs() < 1e-4 && holes.is_empty());
        let words = picture(1, Samples::Words(vec![119 * 257]));
        assert_eq!(luminance(&words, LumaKind::Lstar, false).unwrap().0.samples[0], grid.samples[0]);
        let grey = picture(3, Samples::Bytes(vec![119; 3]));
        let colour = luminance(&grey, LumaKind::Lstar, false).unwrap().0.samples[0];
        assert!((colour - grid.samples[0]).abs() < 1e-4);
    }

    #[test]
    fn rec601_weighs_the_coded_channels() {
        let rgb = picture(3, Samples::Bytes(vec![200, 100, 50]));
        let (grid, _) = luminance(&rgb, LumaKind::Rec601, false).unwrap();
        assert!((grid.samples[0] - (0.299 * 200.0 + 58.7 + 5.7)).abs() < 1e-4);
        let (flipped, _) = luminance(&rgb, LumaKind::Rec601, true).unwrap();
        assert!((flipped.samples[0] + grid.samples[0] - 255.0).abs() < 1e-4);
    }

    #[test]
    fn pixels_of_an_alpha_below_one_half_are_holes() {
        let image = picture(2, Samples::Bytes(vec![200, 127, 200, 128, 0, 0]));
        let (grid, holes) = luminance(&image, LumaKind::Lstar, true).unwrap();
        assert_eq!(holes, [true, false, true]);
        assert!(grid.samples[0] == 0.0 && grid.samples[1] > 0.0 && grid.samples[2] == 0.0);
        let clear = picture(4, Samples::Words(vec![9, 9, 9, 32_767]));
        assert_eq!(luminance(&clear, LumaKind::Lstar, false), Err(ImageError::Transparent));
        let solid = picture(4, Samples::Words(vec![9, 9, 9, 32_768]));
        assert!(luminance(&solid, LumaKind::Lstar, false).unwrap().1.is_empty());
    }

    #[test]
    fn tiffs_of_16_bits_and_with_alpha_are_read_as_their_pixels() {
        use tiff::encoder::{TiffEncoder, colortype};
        let written = |write: &dyn Fn(&mut TiffEncoder<&mut std::io::Cursor<Vec<u8>>>)| {
            let mut file = std::io::Cursor::new(Vec::new());
            write(&mut TiffEncoder::new(&mut file).unwrap());
            luminance(&decode(&file.into_inner()).unwrap(), LumaKind::Rec601, false).unwrap()
        };
        let near = |found: &Grid, expected: [f64; 2]| {
            let error = |(a, b): (&f32, f64)| (f64::from(*a) - b).abs();
            found.samples.iter().zip(expected).all(|pair| error(pair) < 1e-4)
        };
        // The weighted sum, scaled from 65,535 to 255.
        let sum = |r: f64, g: f64, b: f64| (0.299 * r + 0.587 * g + 0.114 * b) / 257.0;
        let (grey, holes) = written(&|out| {
            out.write_image::<colortype::Gray16>(2, 1, &[257, 40_000]).unwrap();
        });
        assert!(near(&grey, [1.0, 40_000.0 / 257.0]) && holes.is_empty(), "{grey:?}");
        let (colour, holes) = written(&|out| {
            out.write_image::<colortype::RGB16>(2, 1, &[65_535, 0, 300, 1, 40_000, 2]).unwrap();
        });
        assert!(near(&colour, [sum(65_535.0, 0.0, 300.0), sum(1.0, 40_000.0, 2.0)]) && holes.is_empty());
        let (colour, holes) = written(&|out| {
            out.write_image::<colortype::RGBA8>(2, 1, &[10, 20, 30, 127, 10, 20, 30, 128]).unwrap();
        });
        let right = 257.0 * sum(10.0, 20.0, 30.0);
        assert!(near(&colour, [0.0, right]) && holes == [true, false], "{colour:?} {holes:?}");
        let (colour, holes) = written(&|out| {
            let pixels = [9000, 8000, 7000, 32_768, 1, 2, 3, 32_767];
            out.write_image::<colortype::RGBA16>(2, 1, &pixels).unwrap();
        });
        assert!(near(&colour, [sum(9000.0, 8000.0, 7000.0), 0.0]) && holes == [false, true], "{holes:?}");
    }
}
