//! Maps as SVG with the pixels embedded as a PNG.

use crate::plot::{Image, escaped, grey_png};
use crate::texture::filter::{Kernel, smooth};
use crate::texture::grid::{Grid, Wrap};
use crate::texture::maps::Surface;
use std::fmt::Write;

/// Maximum side of a drawn map in pixels; larger maps are halved.
const MAX_SIDE: usize = 1024;
/// Width of the drawing.
const WIDTH: f64 = 640.0;

/// Draws a map in grey, `low` black and `high` white, with a scale bar.
pub(in crate::texture) fn picture(
    title: &str,
    map: &Grid,
    [low, high]: [f32; 2],
    surface: &Surface,
) -> Option<String> {
    let mut small = map.clone();
    while small.width.max(small.height) > MAX_SIDE {
        let soft = smooth(&small, &Kernel::binomial(), Wrap::Clamp);
        let (width, height) = (small.width.div_ceil(2), small.height.div_ceil(2));
        small = Grid::from_fn(width, height, |x, y| {
            soft.samples.get(2 * y * soft.width + 2 * x).copied().unwrap_or_default()
        });
    }
    let metres = [map.width as f64 / surface.density[0], map.height as f64 / surface.density[1]];
    let height = WIDTH * metres[1] / metres[0];
    // The largest of 1, 2 and 5 times a power of ten that fits a quarter of the width.
    let power = 10_f64.powf((metres[0] / 4.0).log10().floor());
    let bar = [5.0, 2.0, 1.0].into_iter().map(|k| k * power).find(|bar| *bar <= metres[0] / 4.0)?;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w:.1} {h:.1}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{w:.1}\" height=\"{h:.1}\" fill=\"white\"/>\n",
        w = WIDTH + 20.0,
        h = height + 70.0
    );
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<text x=\"10\" y=\"20\" font-weight=\"bold\">{}</text>\n\
         {}\n\
         <rect x=\"10\" y=\"{:.1}\" width=\"{:.1}\" height=\"4\" fill=\"black\"/>\n\
         <text x=\"10\" y=\"{:.1}\">{} m</text>\n</svg>",
        escaped(title),
        image_element(&small, [low, high], [10.0, 30.0, WIDTH, height])?,
        height + 38.0,
        WIDTH * bar / metres[0],
        height + 58.0,
        (bar * 1e6).round() / 1e6
    );
    Some(svg)
}

/// Encodes one byte per pixel of a map as a grey PNG.
pub(in crate::texture) fn encode_png(map: &Grid, bytes: &[u8]) -> Option<Vec<u8>> {
    grey_png([map.width, map.height], bytes)
}

/// An SVG element of a map in grey, at `[left, top, width, height]`; `low > high` inverts it.
pub(crate) fn image_element(map: &Grid, [low, high]: [f32; 2], frame: [f64; 4]) -> Option<String> {
    let scale = if high == low { 0.0 } else { 255.0 / (high - low) };
    let grey = |x: &f32| ((x - low) * scale).round().clamp(0.0, 255.0) as u8;
    let pixels: Vec<u8> = map.samples.iter().map(grey).collect();
    Some(Image::grey([map.width, map.height], &pixels)?.element(frame))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_has_the_pixels_and_a_scale_bar() {
        let map = Grid::from_fn(512, 256, |x, _| x as f32);
        let svg = picture("a < b", &map, [0.0, 511.0], &Surface::default()).unwrap();
        // 1 m wide: the bar is 0.2 m, a fifth of 640.
        assert!(svg.contains("a &lt; b") && svg.contains("width=\"128.0\" height=\"4\""), "{svg}");
        assert!(svg.contains(">0.2 m<") && svg.contains("base64,iVBORw0KGgo"));
        let inverted = picture("a < b", &map, [511.0, 0.0], &Surface::default()).unwrap();
        let white = picture("a < b", &map, [-2.0, -1.0], &Surface::default()).unwrap();
        assert!(inverted != svg && inverted != white);
        let large = Grid::from_fn(3000, 10, |x, _| x as f32);
        assert!(picture("", &large, [0.0, 1.0], &Surface::default()).unwrap().len() < 20_000);
    }
}
