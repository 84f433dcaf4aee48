//! Isophotes as data of ports: drawing, file, report and random trials.

use super::code::encode_isophotes;
use super::curves::Isophotes;
use super::extract::{Drawing, Levels, isophotes};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::texture::maps::Luma;
use std::fmt::Write;

/// Maximum number of points in a drawing; above it, only every n-th curve is drawn.
const MAX_DRAWN: usize = 400_000;

impl Data for Isophotes {
    const NAME: &'static str = "isophotes";
    const PLOTS: bool = true;
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let luma = Luma::trial(rng);
        let levels = Levels::Quantiles(1 + rng.below(4));
        isophotes(&luma, &Drawing { levels, ..Drawing::default() }).unwrap_or_default()
    }

    fn plot(&self) -> Option<String> {
        let (w, h) = (self.width, self.height);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-0.5 -0.5 {w} {h}\">\n<rect x=\"-0.5\" y=\"-0.5\" \
             width=\"{w}\" height=\"{h}\" fill=\"white\"/>\n<g fill=\"none\" stroke-width=\"0.5\">\n"
        );
        let every = self.points.len() / MAX_DRAWN + 1;
        for (k, level) in self.levels.iter().enumerate() {
            let colour = colour(k, self.levels.len());
            // Writing to a string cannot fail.
            let _ = write!(svg, "<path stroke=\"{colour}\" data-level=\"{level}\" d=\"");
            let own = self.iter().filter(|(curve, ..)| usize::from(curve.level) == k);
            for (curve, points, _) in own.step_by(every) {
                let mut letter = 'M';
                for [x, y] in points {
                    let _ = write!(svg, "{letter}{:.2} {:.2}", x, y);
                    letter = 'L';
                }
                if curve.closed && points.first() == points.last() {
                    svg.push('Z');
                }
            }
            svg.push_str("\"/>\n");
        }
        svg.push_str("</g>\n</svg>\n");
        Some(svg)
    }

    fn file(&self) -> Option<Vec<u8>> {
        Some(encode_isophotes(self))
    }
}

/// Colour of level `k`: from dark blue for the lowest over green to orange for the highest.
fn colour(k: usize, count: usize) -> String {
    const STOPS: [[f64; 3]; 3] = [[25.0, 40.0, 120.0], [40.0, 140.0, 110.0], [235.0, 130.0, 20.0]];
    let along = 2.0 * k as f64 / (count.max(2) - 1) as f64;
    let (from, t) = if along < 1.0 { (0, along) } else { (1, along - 1.0) };
    let mix = |c: usize| (STOPS[from][c] + (STOPS[from + 1][c] - STOPS[from][c]) * t).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// Figures of isophotes for the report of a run.
pub(super) fn summary(found: &Isophotes) -> Summary {
    let bytes = encode_isophotes(found).len();
    vec![
        ("levels", found.levels.len().into()),
        ("curves", found.curves.len().into()),
        ("points", found.points.len().into()),
        ("bytes", bytes.into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Grid, LumaKind, Surface, decode_isophotes};

    #[test]
    fn a_drawing_has_each_level_and_a_file_is_read_again() {
        let grid = Grid::from_fn(24, 20, |x, y| (x as f32 - 12.0).hypot(y as f32 - 10.0));
        let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
        let levels = Levels::These(vec![3.0, 6.0]);
        let found = isophotes(&luma, &Drawing { levels, ..Drawing::default() }).unwrap();
        let svg = found.plot().unwrap();
        assert_eq!((svg.matches("<path").count(), svg.matches('Z').count()), (2, found.curves.len()));
        assert!(svg.contains("#192878") && svg.contains("#eb8214") && svg.ends_with("</svg>\n"));
        let file = found.file().unwrap();
        assert_eq!(decode_isophotes(&file).unwrap().points, found.points);
    }

    #[test]
    fn trials_have_curves() {
        let found = Isophotes::trial(&mut Rng::new(1));
        assert!(!found.curves.is_empty() && found.points.len() == found.gradients.len());
    }
}
