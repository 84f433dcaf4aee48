//! The nodes that make isophotes of an image, and that read them.

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
    /// What the bilinear surface through the corners says: curves of different levels never cross.
    Decider,
    /// The low ones.
    Low,
    /// The high ones.
    High,
} }

choices! {
    /// How levels lie in the luminance of an image.
    pub enum Spacing {
        /// Between two levels there are always as many pixels.
        Quantile,
        /// Evenly from the 2nd percentile to the 98th.
        Uniform,
    }
}

params! {
    /// Draws the lines of equal luminance of an image, for textures whose every pixel tells something: gravel, grass, sand.
    ///
    /// The image is blurred a little; then lines are drawn between pixels where the luminance passes a level, with the gradient of the
    /// luminance at each of their points. An image that repeats has lines across its seam; holes have none. `simplify` leaves out points
    /// that change a line by no more than it says and its gradient by no more than the share `gradient_error`.
    /// The summary tells how many curves and points there are, and the size of their file.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2, who do not say
    /// how many levels they take, nor where.
    pub struct IsophotesParams {
        /// Levels.
        count: u16 = 8, unit "levels", range 1..=64_u16;
        /// How they lie in the luminance of the image.
        spacing: Spacing = Spacing::Quantile;
        /// Luminance of each level, in place of `count` and `spacing`.
        levels: Vec<f64> = Vec::new(), unit "", range -1000.0..=1000.0;
        /// Standard deviation of the blur; 0 for none.
        pre_blur: f64 = 1.0, unit "px", range 0.0..=32.0;
        /// Which corners belong together between four pixels where two opposite ones are high.
        saddle: Saddle = Saddle::Decider;
        /// How far a curve may be off to have fewer points; 0 keeps all points.
        simplify: f64 = 0.25, unit "px", range 0.0..=8.0;
        /// Share of its gradient by which a point that is left out may be off; of gradients below 0.3 of the root mean square, of that.
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
            /// Its curves.
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
        // Levels that are given may lie outside of the luminance, which is an error.
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
    fn the_node_draws_what_its_parameters_say() {
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
    fn what_cannot_be_drawn_is_refused() {
        let fault = run(params(), luma(1, 30)).unwrap_err();
        assert!(fault.code == "F125" && fault.message.contains("1 x 30"), "{fault}");
        let none = run(IsophotesParams { levels: vec![400.0], ..params() }, luma(40, 30)).unwrap_err();
        assert!(none.code == "F125" && none.field.as_deref() == Some("levels"), "{none}");
        let many = run(IsophotesParams { levels: vec![1.0; 65], ..params() }, luma(40, 30)).unwrap_err();
        assert!(many.message.contains("65"), "{many}");
    }
}
