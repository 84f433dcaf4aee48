//! Feature space before and after a warp, as figure 11 of the paper.

use serde::{Deserialize, Serialize};
use std::fmt::Write;

use super::report::FitReport;
use crate::warp::spline::tps::evenly_spaced;
use crate::warp::spline::{Pair, Tps, Warper};

const SIDE: f64 = 360.0;
const MARGIN: f64 = 44.0;

/// Some vectors of the target and of the database, and some of the pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cloud {
    /// Vectors of the target, `[n, d]`.
    pub target: Vec<f32>,
    /// Vectors of the database, `[n, d]`.
    pub database: Vec<f32>,
    /// Both ends of pairs, `[n, 2, d]`.
    pub pairs: Vec<f32>,
}

impl Cloud {
    /// At most `max_points` of each, evenly spread.
    #[must_use]
    pub fn new(pairs: &[Pair], target: &[f32], database: &[f32], d: usize, max_points: usize) -> Self {
        let some = |x: &[f32]| {
            let rows =
                evenly_spaced(x.len() / d.max(1), max_points).filter_map(|k| x.get(k * d..(k + 1) * d));
            rows.flatten().copied().collect()
        };
        let ends = evenly_spaced(pairs.len(), max_points).filter_map(|k| pairs.get(k));
        let ends = ends.flat_map(|p| p.from.iter().chain(&p.to)).map(|x| *x as f32);
        Self { target: some(target), database: some(database), pairs: ends.collect() }
    }
}

/// The first two numbers of a vector; a second of 0 where there is one alone.
fn flat(x: &[f32]) -> [f64; 2] {
    [0, 1].map(|k| x.get(k).map_or(0.0, |x| f64::from(*x)))
}

struct Panel {
    left: f64,
    low: [f64; 2],
    span: [f64; 2],
}

impl Panel {
    fn position(&self, p: [f64; 2]) -> [f64; 2] {
        let u = [0, 1].map(|k| (p[k] - self.low[k]) / self.span[k]);
        [self.left + u[0] * SIDE, MARGIN + (1.0 - u[1]) * SIDE]
    }

    fn dots(&self, svg: &mut String, points: &[[f64; 2]], radius: f64, colour: &str) {
        for p in points {
            let [x, y] = self.position(*p);
            // Writing to a string does not fail.
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{colour}\"/>");
        }
    }

    fn frame(&self, svg: &mut String, title: &str) {
        let (left, right, middle) = (self.left, self.left + SIDE, self.left + SIDE / 2.0);
        let bottom = MARGIN + SIDE;
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{MARGIN}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#888\"/>\n\
             <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\" font-weight=\"bold\">{title}</text>\n\
             <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">coefficient 0 (loudness)</text>\n\
             <text x=\"{left}\" y=\"{}\">{:.1}</text><text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{:.1}</text>\n\
             <text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{:.1}</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{:.1}</text>",
            MARGIN - 10.0,
            bottom + 30.0,
            bottom + 15.0,
            self.low[0],
            bottom + 15.0,
            self.low[0] + self.span[0],
            left - 4.0,
            self.low[1],
            left - 4.0,
            MARGIN + 10.0,
            self.low[1] + self.span[1],
        );
    }
}

/// Draws the first two dimensions: grey the database, blue the target, orange lines the pairs; before and after the warp.
pub(super) fn draw(spline: &Tps, cloud: &Cloud, report: &FitReport) -> String {
    let d = spline.dims.max(1);
    let rows = |x: &[f32]| x.chunks_exact(d).map(flat).collect::<Vec<_>>();
    let mut warper = Warper::new(spline);
    let mut out = vec![0.0; d];
    let mut warped = |x: &[f32]| {
        x.chunks_exact(d)
            .map(|x| {
                warper.warp(x, &mut out);
                flat(&out)
            })
            .collect::<Vec<_>>()
    };
    let (database, before, after) = (rows(&cloud.database), rows(&cloud.target), warped(&cloud.target));
    let ends = rows(&cloud.pairs);
    let moved = warped(&cloud.pairs);
    let all: Vec<[f64; 2]> = [&database, &before, &after, &ends].into_iter().flatten().copied().collect();
    let bounds = [0, 1].map(|k| {
        let finite = all.iter().map(|p| p[k]).filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if low < high { (low, high - low) } else { (if low.is_finite() { low } else { 0.0 } - 0.5, 1.0) }
    });
    let width = 2.0 * (SIDE + 1.5 * MARGIN);
    let height = SIDE + 2.5 * MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let titles = ["Before the warp", "After the warp"];
    for (k, (title, target)) in titles.iter().zip([&before, &after]).enumerate() {
        let left = MARGIN + k as f64 * (SIDE + 1.5 * MARGIN);
        let panel = Panel { left, low: bounds.map(|b| b.0), span: bounds.map(|b| b.1) };
        panel.frame(&mut svg, title);
        panel.dots(&mut svg, &database, 1.6, "#bbb");
        panel.dots(&mut svg, target, 1.6, "#2166ac");
        for (pair, moved) in ends.chunks_exact(2).zip(moved.chunks_exact(2)) {
            let from = if k == 0 { pair[0] } else { moved[0] };
            let ([x1, y1], [x2, y2]) = (panel.position(from), panel.position(pair[1]));
            let _ = writeln!(
                svg,
                "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"#e66101\" stroke-width=\"0.8\"/>"
            );
        }
    }
    let _ = writeln!(
        svg,
        "<text x=\"{MARGIN}\" y=\"16\"><tspan fill=\"#999\">database</tspan> <tspan fill=\"#2166ac\">target</tspan> \
         <tspan fill=\"#e66101\">pairs</tspan>, dimensions 0 and 1; lambda {:.3e}, {:.1} degrees of freedom</text>\n</svg>",
        report.lambda, report.freedom
    );
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::{Stiffness, WarpMap};

    fn draw(map: &WarpMap) -> String {
        super::draw(&map.spline, &map.cloud, &map.report)
    }

    #[test]
    fn the_figure_has_both_panels_and_a_dot_per_vector() {
        let pair = Pair { from: vec![0.0, 1.0], to: vec![2.0, 1.0], weight: 1.0 };
        let map =
            WarpMap::fit(&[pair], 2, Stiffness::Lambda(0.0), &[0.0, 1.0, 3.0, 3.0], &[2.0, 2.0]).unwrap();
        let svg = draw(&map);
        assert_eq!(svg.matches("<circle").count(), 2 * (2 + 1));
        assert_eq!(svg.matches("<line").count(), 2);
        assert!(svg.contains("Before") && svg.contains("After") && !svg.contains("NaN"));
        assert!(!draw(&WarpMap::fit(&[], 3, Stiffness::Auto, &[], &[]).unwrap()).contains("NaN"));
    }
}
