//! Images of surfaces from files, as a value node.

use super::blockiness::blockiness;
use super::decode::{ImageError, decode, header};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::texture::figure::picture::encode_png;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::maps::{Luma, LumaKind, Surface};
use crate::{choices, params, ports};

/// Blockiness above which JPEG blocks are audible.
const MAX_BLOCKINESS: f32 = 0.25;
/// Bytes of a pixel while an image is read: four channels of 16 bits, luminance, and the hole flag.
const PIXEL_BYTES: u64 = 13;

choices! { @param LumaKind {
    /// CIE lightness, 0 to 100, of linear light.
    Lstar,
    /// Weighted sum of the coded channels, 0 to 255.
    Rec601,
} }

choices! { @param Wrap {
    /// Periodic repetition: tiles.
    Repeat,
    /// Reflection.
    Mirror,
    /// Repetition of the border pixel.
    Clamp,
} }

params! {
    /// The luminance of an image of a surface, and the scale of the image.
    ///
    /// Supported are PNG, JPEG and TIFF of 8 or 16 bits, in grey, colour or with a palette, of at most 16384 pixels along a side and 67
    /// million in all. Pixels with an alpha below one half are holes: their luminance is 0 and they do not count in statistics.
    ///
    /// The highest frequency of a contact is half the density times the speed: the report has `highest_hz_at_1_m_s`. The blocks of
    /// strongly compressed JPEG images sound as a tone with a period of 8 pixels; there is a warning for them.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.
    pub struct ImageLumaParams {
        /// The image.
        path: AssetPath;
        /// Measure of luminance. The defaults of features and bilateral filters are for lightness.
        kind: LumaKind = LumaKind::Lstar;
        /// Pixels per metre on the surface, along x.
        density: f64 = 512.0, unit "px/m", range 0.001..=10_000_000.0;
        /// Pixels per metre along y, if different.
        density_y: Option<f64> = None, unit "px/m", range 0.001..=10_000_000.0;
        /// Height of the full range of luminance.
        depth: f64 = 0.0001, unit "m", range 0.0..=10.0;
        /// Continuation beyond the border.
        wrap: Wrap = Wrap::Repeat;
        /// True to invert the luminance, for images with bright grooves.
        invert: bool = false;
    }
}

ports! {
    pub struct ImageLumaPorts / ImageLumaIo {
        in {}
        out {
            /// The luminance.
            luma: Value<Luma>,
        }
    }
}

/// The node over [`decode`] and [`Luma::new`].
#[derive(Debug)]
pub struct ImageLuma;

fn wrong(path: &str, e: &ImageError) -> Reject {
    Reject::new(e.code(), format!("{path:?}: {e}")).at("path")
}

/// Note on an image of one tone, or of one line, along which some or all motion is silent.
fn uniformity_warning(grid: &Grid) -> Option<String> {
    let tones =
        grid.samples.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], x| [a.min(*x), b.max(*x)]);
    if tones[0] >= tones[1] {
        let tone = tones[0];
        return Some(format!(
            "all pixels have the same tone, {tone}: no contact makes a sound on this image"
        ));
    }
    let (across, along) = if grid.height == 1 { ("high", "x") } else { ("wide", "y") };
    (grid.width == 1 || grid.height == 1)
        .then(|| format!("the image is 1 pixel {across}: only motion along {along} makes a sound on it"))
}

impl Func for ImageLuma {
    type Params = ImageLumaParams;
    type Ports = ImageLumaPorts;
    const NAME: &'static str = "ImageLuma";
    const VERSION: u32 = 3;

    fn check(p: &ImageLumaParams, s: &mut Shape<'_, '_, ImageLumaPorts>) -> Result<(), Reject> {
        let path = &p.path.0;
        let header = header(&s.bytes("path", path)?).map_err(|e| wrong(path, &e))?;
        s.hold("path", path, (header.width * header.height) as u64 * PIXEL_BYTES)
    }

    fn eval(p: &ImageLumaParams, cx: &Build<'_>, mut io: ImageLumaIo<'_>) -> Result<Summary, Fault> {
        let path = &p.path.0;
        let picture = decode(&cx.bytes("path", path)?).map_err(|e| wrong(path, &e))?;
        let density = [p.density, p.density_y.unwrap_or(p.density)];
        let surface = Surface { density, depth: p.depth, wrap: p.wrap };
        let luma = Luma::new(&picture, p.kind, p.invert, surface).map_err(|e| wrong(path, &e))?;
        let mut summary: Summary = vec![
            ("width", luma.grid.width.into()),
            ("height", luma.grid.height.into()),
            ("format", picture.format.name().into()),
            ("holes", luma.holes.iter().filter(|hole| **hole).count().into()),
            ("highest_hz_at_1_m_s", (0.5 * density[0].min(density[1])).into()),
        ];
        summary.extend(uniformity_warning(&luma.grid).map(|text| ("warning", text.into())));
        let blocks = blockiness(&luma.grid);
        if blocks > MAX_BLOCKINESS {
            let text = format!(
                "the image has JPEG blocks of 8 pixels (blockiness {blocks:.2} of 1): at 1 m/s they sound at {:.0} Hz",
                density[0] / 8.0
            );
            summary.push(("warning", text.into()));
        }
        io.luma.set(luma);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ImageLumaParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let grid = Grid { width: 1 + rng.below(20), height: 1 + rng.below(20), samples: Vec::new() };
        let bytes: Vec<u8> = (0..grid.width * grid.height).map(|_| rng.below(256) as u8).collect();
        files.insert("image.png", encode_png(&grid, &bytes).unwrap_or_default());
        (ImageLumaParams { path: "image.png".into(), ..ImageLumaParams::trial(rng) }, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Datum;
    use crate::core::standalone::{Standalone, StandaloneRun};

    fn standalone(bytes: Vec<u8>, others: &[(&'static str, Datum)]) -> Standalone {
        let all = [&[("path", Datum::Text("tex.png".into()))], others].concat();
        let get = |name: &str| all.iter().find(|(n, _)| *n == name).map(|(_, value)| value.clone());
        let mut standalone = Standalone::func::<ImageLuma>(ImageLumaParams::read(&get).unwrap());
        standalone.files.insert("tex.png", bytes);
        standalone
    }

    fn figure(run: &StandaloneRun, key: &str) -> String {
        run.summary.iter().find(|(k, _)| *k == key).map(|(_, v)| v.to_string()).unwrap_or_default()
    }

    fn shipped(name: &str) -> Vec<u8> {
        std::fs::read(format!("{}/../graphs/assets/images/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    #[test]
    fn the_surface_has_the_parameters() {
        let others = [("density_y", Datum::Float(100.0)), ("kind", Datum::Name("Rec601".into()))];
        let run = standalone(shipped("tiles.png"), &others).run().unwrap();
        let value = run.value(0).unwrap();
        let luma = value.get::<Luma>().unwrap();
        assert_eq!((luma.grid.width, luma.grid.height, luma.holes.len()), (512, 512, 0));
        assert_eq!(luma.surface.density, [512.0, 100.0]);
        assert_eq!(luma.grid.samples[0], 200.0);
        assert_eq!(figure(&run, "highest_hz_at_1_m_s"), "50.0");
    }

    #[test]
    fn shipped_images_have_no_blocks() {
        for name in ["tiles.png", "sk_brick.png", "sk_gravel.png"] {
            assert_eq!(figure(&standalone(shipped(name), &[]).run().unwrap(), "warning"), "", "{name}");
        }
    }

    #[test]
    fn the_warning_of_jpeg_blocks_names_their_tone() {
        const COARSE: &[u8] = include_bytes!("../testdata/blocks.jpg");
        const FINE: &[u8] = include_bytes!("../testdata/fine.jpg");
        let run = standalone(COARSE.to_vec(), &[("density", Datum::Float(800.0))]).run().unwrap();
        let warning = figure(&run, "warning");
        assert!(warning.contains("blocks of 8 pixels") && warning.contains("100 Hz"), "{warning}");
        assert_eq!(
            figure(&standalone(FINE.to_vec(), &[]).run().unwrap(), "warning"),
            "",
            "the same grain, hardly compressed"
        );
    }

    #[test]
    fn a_png_of_lines_with_a_pitch_of_8_pixels_causes_no_warning_of_blocks() {
        let pixels: Vec<u8> = (0..128 * 128)
            .map(|k| if k % 8 == 0 || k / 128 % 8 == 0 { 60 + (k * 7919 % 13) as u8 } else { 200 })
            .collect();
        let lines = Grid { width: 128, height: 128, samples: Vec::new() };
        let run = standalone(encode_png(&lines, &pixels).unwrap(), &[]).run().unwrap();
        assert_eq!(figure(&run, "warning"), "");
    }

    #[test]
    fn images_of_one_tone_or_of_one_line_have_a_warning_of_silence() {
        for (width, height, tones, expected) in [
            (8, 8, 1, "the same tone"),
            (64, 1, 50, "1 pixel high"),
            (1, 64, 50, "1 pixel wide"),
            (8, 8, 50, ""),
        ] {
            let grid = Grid { width, height, samples: Vec::new() };
            let pixels: Vec<u8> = (0..width * height).map(|k| 90 + (k * 31 % tones) as u8).collect();
            let run = standalone(encode_png(&grid, &pixels).unwrap(), &[]).run().unwrap();
            let warning = figure(&run, "warning");
            assert!(warning.contains(expected) && warning.is_empty() == expected.is_empty(), "{warning}");
        }
    }

    #[test]
    fn an_image_without_any_opaque_pixel_is_refused() {
        use crate::texture::image::decode::tests::png;
        let clear = png(4, 4, png::ColorType::Rgba, false, &[9; 64]);
        let fault = standalone(clear, &[]).run().err().unwrap();
        assert!(fault.code == "F123" && fault.message.contains("tex.png"), "{fault}");
    }

    #[test]
    fn errors_name_the_file_and_come_before_the_run_where_the_header_shows_them() {
        for (bytes, code, part) in [
            (Vec::new(), "F120", "\"tex.png\": the file is empty"),
            (b"GIF89a".to_vec(), "F120", "PNG, JPEG and TIFF"),
            (shipped("tiles.png")[..20].to_vec(), "F122", "the PNG is damaged or cut off"),
        ] {
            let reject = standalone(bytes, &[]).shape().unwrap_err();
            assert!(reject.code == code && reject.message.contains(part), "{reject}");
            assert_eq!(reject.field.as_deref(), Some("path"));
        }
        let cut = shipped("sk_brick.png")[..50_000].to_vec();
        let fault = standalone(cut, &[]).run().err().unwrap();
        assert!(fault.code == "F122" && fault.message.contains("tex.png"), "{fault}");
    }
}
