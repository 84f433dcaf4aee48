//! The sizes of all codes of a texture with isophotes, as a value node.

use super::report::SizeReport;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::isophote::code::encode_isophotes;
use crate::texture::isophote::curves::Isophotes;
use crate::{params, ports};
use std::f64::consts::PI;

/// Microseconds per millisecond of a contact on isophotes, by `benches/isophotes.rs`.
const ISOPHOTES_COST: f64 = 0.39;
/// Microseconds per crossing of an isophote, by `benches/isophotes.rs`.
const CROSSING_COST: f64 = 0.89;

params! {
    /// The size of the isophotes of a texture, added to the sizes of its image and other codes, and the cost of a contact on them.
    ///
    /// The number of crossings per metre follows from the length of the curves: a straight path in a random direction crosses `2/pi` times
    /// their length per area. The cost is a constant plus that of the crossings.
    ///
    /// Link the output of `MapSizes` for a list of all codes: a tap as `.json` writes it, and so does the report of a run.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2: 786 kB for an image of 512 x 512 pixels, 1.09 MB for its isophotes, 544 kB
    /// for features and noise.
    pub struct TextureReportParams {}
}
ports! {
    pub struct TextureReportPorts / TextureReportIo {
        in {
            /// The isophotes.
            isophotes: Value<Isophotes>,
            /// The sizes of the other codes.
            sizes: Option<Value<SizeReport>>,
        }
        out {
            /// All sizes.
            report: Value<SizeReport>,
        }
    }
}

/// The node over [`SizeReport`].
#[derive(Debug)]
pub struct TextureReport;

impl Func for TextureReport {
    type Params = TextureReportParams;
    type Ports = TextureReportPorts;
    const NAME: &'static str = "TextureReport";
    const VERSION: u32 = 5;

    fn eval(_: &TextureReportParams, _: &Build<'_>, mut io: TextureReportIo<'_>) -> Result<Summary, Fault> {
        let curves = io.isophotes;
        let bytes = encode_isophotes(curves).len();
        let mut report = io.sizes.cloned().unwrap_or_else(|| SizeReport::new([curves.width, curves.height]));
        report.add("isophotes", bytes);
        let crossings = crossings_per_metre(curves);
        report.add_cost("isophotes", ISOPHOTES_COST + CROSSING_COST * crossings / 1000.0);
        let each = bytes as f64 / curves.points.len().max(1) as f64;
        io.report.set(report);
        Ok(vec![
            ("isophotes", bytes.into()),
            ("points", curves.points.len().into()),
            ("bytes_per_point", each.into()),
            ("crossings_per_m", crossings.into()),
        ])
    }
}

/// Mean number of curves that a straight path crosses per metre, over all directions.
///
/// # Source
/// Buffon's needle, for curves (Barbier 1860).
fn crossings_per_metre(curves: &Isophotes) -> f64 {
    let density = curves.surface.density;
    let length = |p: &[[f32; 2]]| {
        let step: [f64; 2] = std::array::from_fn(|k| f64::from(p[1][k] - p[0][k]) / density[k]);
        step[0].hypot(step[1])
    };
    let total: f64 = curves.iter().flat_map(|(_, points, _)| points.windows(2)).map(length).sum();
    let area = curves.width as f64 / density[0] * (curves.height as f64 / density[1]);
    if area > 0.0 { 2.0 / PI * total / area } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::params::Params;
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;
    use crate::texture::{Drawing, Grid, Kernel, Luma, LumaKind, Surface, Wrap, isophotes, smooth};

    fn report(curves: Isophotes, sizes: Option<SizeReport>) -> SizeReport {
        let mut standalone = Standalone::func::<TextureReport>(TextureReportParams::read(&|_| None).unwrap())
            .value(TextureReportPorts::isophotes, curves);
        if let Some(sizes) = sizes {
            let feed = crate::core::standalone::Feed::value(crate::core::item::AnyValue::new(sizes));
            standalone = standalone.feed(TextureReportPorts::sizes.index(), feed);
        }
        let run = standalone.run().unwrap();
        run.value(0).unwrap().get::<SizeReport>().unwrap().clone()
    }

    #[test]
    fn isophotes_are_added_to_the_other_sizes() {
        let mut rng = Rng::new(2);
        let curves = Isophotes::trial(&mut rng);
        let bytes = encode_isophotes(&curves).len() as u64;
        let alone = report(curves.clone(), None);
        assert_eq!(alone.image, 3 * (curves.width * curves.height) as u64);
        let mut others = SizeReport::new([7, 5]);
        others.add("map", 35);
        let all = report(curves, Some(others));
        let list: Vec<_> = all.entries.iter().map(|e| (e.what.as_str(), e.bytes)).collect();
        assert_eq!((all.image, &list[..]), (105, &[("map", 35), ("isophotes", bytes)][..]));
    }

    #[test]
    fn crossings_per_metre_follow_from_the_length_of_the_curves() {
        // Rings of radius 20 px: counted on rows.
        let grid = Grid::from_fn(64, 64, |x, y| (x as f32 - 32.0).hypot(y as f32 - 32.0));
        let surface = Surface { density: [100.0; 2], ..Surface::default() };
        let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
        let levels = crate::texture::Levels::These(vec![20.0]);
        let curves = isophotes(&luma, &Drawing { levels, pre_blur: 0.0, ..Drawing::default() }).unwrap();
        // A ring of 0.2 m radius on 0.64 m squared.
        let right = 2.0 / PI * (2.0 * PI * 0.2) / (0.64 * 0.64);
        let found = crossings_per_metre(&curves);
        assert!((found / right - 1.0).abs() < 0.01, "{found} for {right}");
        let costs = report(curves, None).costs;
        assert!(costs.len() == 1 && costs[0].us_per_ms > ISOPHOTES_COST, "{costs:?}");
    }

    #[test]
    fn isophotes_of_the_shipped_images_have_the_sizes_in_the_book() {
        // The target is 300 kB for the 1.09 MB of the paper, in proportion to the number of points.
        for (name, max) in [("tiles", 36_000), ("sk_brick", 200_000), ("sk_gravel", 510_000)] {
            let path = format!("{}/../graphs/assets/images/{name}.png", env!("CARGO_MANIFEST_DIR"));
            let picture = crate::texture::decode::decode(&std::fs::read(path).unwrap()).unwrap();
            let (grid, holes) = crate::texture::luma::luminance(&picture, LumaKind::Lstar, false).unwrap();
            let luma = Luma { grid, holes, kind: LumaKind::Lstar, surface: Surface::default() };
            let all = isophotes(&luma, &Drawing { simplify: 0.0, ..Drawing::default() }).unwrap();
            // Position and gradient of all points, in 32 bits per number.
            let plain = 16 * all.points.len() as u64;
            let report = report(isophotes(&luma, &Drawing::default()).unwrap(), None);
            let bytes = report.entries[0].bytes;
            println!("{name}: {bytes} of {plain}");
            assert!((max / 2..=max).contains(&bytes), "{name}: {bytes}");
            assert!(bytes as f64 <= 300.0 / 1090.0 * plain as f64, "{name}: {bytes} of {plain}");
        }
    }

    #[test]
    fn isophotes_of_512_by_512_pixels_are_much_smaller_than_the_image() {
        // Stones of about fifteen pixels; finer gravel has longer curves.
        let mut rng = Rng::new(3);
        let grid = Grid::from_fn(512, 512, |_, _| rng.between(0.0, 100.0) as f32);
        let grid = smooth(&grid, &Kernel::gaussian(3.5, 4.0), Wrap::Repeat);
        let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
        let curves = isophotes(&luma, &Drawing::default()).unwrap();
        let report = report(curves, None);
        assert_eq!(report.image, 786_432);
        assert!(report.entries[0].bytes <= 300_000, "{}", report.entries[0].bytes);
    }
}
