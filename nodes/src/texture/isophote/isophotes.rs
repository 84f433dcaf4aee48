//! The isophotes of an image, as a value node.

use super::contour::Saddle;
use super::curves::Isophotes;
use super::extract::{Drawing, Levels, isophotes};
use super::value::summary;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::texture::maps::Luma;
use crate::{choices, params, ports};

choices! { @param Saddle {
    /// As on the bilinear surface through the corners: curves of different levels never cross.
    Decider,
    /// The low corners.
    Low,
    /// The high corners.
    High,
} }

choices! {
    /// Spacing of levels in the luminance of an image.
    pub enum Spacing {
        /// As many pixels between each two levels.
        Quantile,
        /// Evenly spaced from the 2nd percentile to the 98th.
        Uniform,
    }
}

params! {
    /// Extracts the curves of equal luminance of an image, for textures with detail in every pixel: gravel, grass, sand.
    ///
    /// The image is blurred a little. Then curves are traced where the luminance passes a level, with the gradient of the luminance at
    /// each point. Curves of a periodic image continue across its border; holes have no curves. Points are left out if the curve moves by
    /// at most `simplify`, and its gradient changes by at most the fraction `gradient_error`. The summary has the number of curves
    /// and points, and the size of their file.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section
    /// 4.1: marching squares. The paper does not state the number of levels, their spacing, a blur or a simplification: all are choices.
    pub struct IsophotesParams {
        /// Number of levels.
        count: u16 = 8, unit "levels", range 1..=64_u16;
        /// Spacing of the levels in the luminance of the image.
        spacing: Spacing = Spacing::Quantile;
        /// Luminance of each level, in place of `count` and `spacing`.
        levels: Vec<f64> = Vec::new(), unit "", range -1000.0..=1000.0;
        /// Standard deviation of the Gaussian blur; 0 for none.
        pre_blur: f64 = 1.0, unit "px", range 0.0..=32.0;
        /// Corners that are connected in a cell of four pixels with two opposite high ones.
        saddle: Saddle = Saddle::Decider;
        /// Maximum distance of a simplified curve from the exact one; 0 retains all points.
        simplify: f64 = 0.25, unit "px", range 0.0..=8.0;
        /// Maximum relative error of the gradient at an omitted point; for gradients below 0.3 of their root mean square, relative to that.
        gradient_error: f64 = 0.05, unit "", range 0.001..=10.0;
    }
}
ports! {
    pub struct IsophotesPorts / IsophotesIo {
        in {
            /// The image.
            luma: Value<Luma>,
        }
        out {
            /// The isophotes.
            isophotes: Value<Isophotes>,
        }
    }
}

/// The node over [`isophotes`].
#[derive(Debug)]
pub struct IsophotesNode;

impl Func for IsophotesNode {
    type Params = IsophotesParams;
    type Ports = IsophotesPorts;
    const NAME: &'static str = "Isophotes";
    const VERSION: u32 = 4;

    fn check(p: &IsophotesParams, s: &mut Shape<'_, '_, IsophotesPorts>) -> Result<(), Reject> {
        if p.levels.len() > 64 {
            let message = format!("`levels` has {} numbers", p.levels.len());
            return Err(Reject::new("F125", message).at("levels").help("64 at most"));
        }
        let grid = s.value(IsophotesPorts::luma).map(|luma| [luma.grid.width, luma.grid.height]);
        match grid {
            Some([w, h]) if w < 2 || h < 2 => {
                let message = format!("the image has {w} x {h} pixels; isophotes need 2 x 2");
                Err(Reject::new("F125", message).at("luma"))
            }
            _ => Ok(()),
        }
    }

    fn eval(p: &IsophotesParams, _: &Build<'_>, mut io: IsophotesIo<'_>) -> Result<Summary, Fault> {
        let levels = match p.spacing {
            _ if !p.levels.is_empty() => Levels::These(p.levels.iter().map(|level| *level as f32).collect()),
            Spacing::Quantile => Levels::Quantiles(p.count.into()),
            Spacing::Uniform => Levels::Uniform(p.count.into()),
        };
        let drawing = Drawing {
            levels,
            pre_blur: p.pre_blur,
            saddle: p.saddle,
            simplify: p.simplify,
            gradient_error: p.gradient_error,
        };
        let field = if p.levels.is_empty() { "luma" } else { "levels" };
        let found = isophotes(io.luma, &drawing).map_err(|e| Fault::new("F125", e.to_string()).at(field))?;
        let summary = summary(&found);
        io.isophotes.set(found);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (IsophotesParams, MemoryFiles) {
        let (count, pre_blur) = (1 + rng.below(9) as u16, rng.between(0.0, 3.0));
        // Given levels may lie outside of the luminance, which is an error.
        let params = IsophotesParams { count, pre_blur, levels: Vec::new(), ..IsophotesParams::trial(rng) };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::texture::{Grid, LumaKind, Surface};

    fn luma(width: usize, height: usize) -> Luma {
        let grid = Grid::from_fn(width, height, |x, y| {
            50.0 + 30.0 * ((x as f32 * 0.9).sin() + (y as f32 * 0.7).cos())
        });
        Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() }
    }

    fn params() -> IsophotesParams {
        IsophotesParams::read(&|_| None).unwrap()
    }

    fn run(p: IsophotesParams, luma: Luma) -> Result<Isophotes, Fault> {
        let run = Standalone::func::<IsophotesNode>(p).value(IsophotesPorts::luma, luma).run()?;
        let value = run.value(0).unwrap();
        Ok(value.get::<Isophotes>().unwrap().clone())
    }

    #[test]
    fn the_isophotes_follow_the_parameters() {
        let found = run(params(), luma(40, 30)).unwrap();
        assert!(found.levels.len() == 8 && found.curves.len() > 8);
        let uniform =
            run(IsophotesParams { spacing: Spacing::Uniform, count: 3, ..params() }, luma(40, 30)).unwrap();
        let [a, b, c] = uniform.levels[..] else { panic!("{:?}", uniform.levels) };
        assert!((b - a - (c - b)).abs() < 1e-4);
        let given =
            run(IsophotesParams { levels: vec![60.0, 20.0, 400.0], ..params() }, luma(40, 30)).unwrap();
        assert_eq!(given.levels, [20.0, 60.0]);
        let all = run(IsophotesParams { simplify: 0.0, ..params() }, luma(40, 30)).unwrap();
        assert!(all.points.len() > found.points.len());
    }

    #[test]
    fn invalid_images_and_levels_are_refused() {
        let fault = run(params(), luma(1, 30)).unwrap_err();
        assert!(fault.code == "F125" && fault.message.contains("1 x 30"), "{fault}");
        let none = run(IsophotesParams { levels: vec![400.0], ..params() }, luma(40, 30)).unwrap_err();
        assert!(none.code == "F125" && none.field.as_deref() == Some("levels"), "{none}");
        let many = run(IsophotesParams { levels: vec![1.0; 65], ..params() }, luma(40, 30)).unwrap_err();
        assert!(many.message.contains("65"), "{many}");
    }
}
