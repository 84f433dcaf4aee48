//! Figure of the profiles of contacts along their paths over a map.

use super::padded_map::{Interp, PaddedMap};
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::scrape::path::piece::PathPiece;
use crate::texture::image_element;
use crate::texture::{Grid, Surface};
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Columns of the picture of a map.
const COLUMNS: usize = 96;

/// The path of one contact and the values along it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactProfile {
    /// Number of the link that it came from.
    pub link: usize,
    /// Number of the contact.
    pub contact: u64,
    /// Distance from its start, m.
    #[serde(rename = "way")]
    pub distance: Vec<f32>,
    /// Positions, m.
    #[serde(rename = "places")]
    pub positions: Vec<[f32; 2]>,
    /// Values of the map at these positions.
    pub values: Vec<f32>,
}

/// Paths over a map, each with its profile.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathProfile {
    /// A small picture of the map, 0 to 1.
    pub picture: Grid,
    /// Its size, m.
    pub size: [f64; 2],
    /// The contacts in the order in which they began.
    #[serde(rename = "ways")]
    pub contacts: Vec<ContactProfile>,
}

/// A small picture of a map, its numbers spread over 0 to 1.
#[must_use]
pub fn picture(map: &Grid) -> Grid {
    let width = map.width.clamp(1, COLUMNS);
    let height = (map.height * width / map.width.max(1)).clamp(1, 2 * COLUMNS);
    let ends = |(low, high): (f32, f32), x: &f32| (low.min(*x), high.max(*x));
    let (low, high) = map.samples.iter().fold((f32::MAX, f32::MIN), ends);
    let mean = |x: usize, y: usize| {
        let span = |k: usize, of: usize, len: usize| k * len / of..((k + 1) * len / of).max(k * len / of + 1);
        let (mut sum, mut count) = (0.0, 0.0);
        for row in span(y, height, map.height) {
            for column in span(x, width, map.width) {
                sum += map.samples.get(row * map.width + column).copied().unwrap_or_default();
                count += 1.0;
            }
        }
        (sum / count - low) / (high - low).max(f32::MIN_POSITIVE)
    };
    Grid::from_fn(width, height, mean)
}

/// Adds the values along a piece, at steps of at most half a pixel, to its profile.
pub fn append(
    met: &mut ContactProfile,
    piece: &PathPiece,
    padded: &PaddedMap<1>,
    surface: &Surface,
    most: usize,
) {
    let length: f64 = (0..16)
        .map(|k| {
            let [a, b] = [k, k + 1].map(|k| piece.position_at(f64::from(k) / 16.0));
            (b[0] - a[0]).hypot(b[1] - a[1])
        })
        .sum();
    let [dx, dy] = surface.density;
    let steps = ((2.0 * length * dx.max(dy)).ceil() as usize).clamp(1, 4096);
    for k in 0..steps {
        if met.values.len() >= most {
            return;
        }
        let s = k as f64 / steps as f64;
        let position = piece.position_at(s);
        let at = [position[0] * dx, position[1] * dy];
        let whole = at.map(f64::floor);
        let [x, y] = [0, 1].map(|k| (at[k] - whole[k]) as f32);
        let value = padded.value(Interp::Bspline3, whole.map(|x| x as i64), x, y);
        let before = met.positions.last().copied().unwrap_or(position.map(|x| x as f32));
        let step = (position[0] as f32 - before[0]).hypot(position[1] as f32 - before[1]);
        met.distance.push(met.distance.last().copied().unwrap_or(0.0) + step);
        met.positions.push(position.map(|x| x as f32));
        met.values.push(value);
    }
}

impl Data for PathProfile {
    const NAME: &'static str = "path profile";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let picture = Grid::from_fn(3, 2, |_, _| rng.uniform() as f32);
        let met = ContactProfile {
            distance: vec![0.0, 0.1],
            positions: vec![[0.0; 2]; 2],
            values: vec![0.5, 0.2],
            ..ContactProfile::default()
        };
        Self { picture, size: [1.0, 0.5], contacts: vec![met] }
    }

    fn plot(&self) -> Option<String> {
        let wide = 480.0;
        let tall = (wide * self.size[1] / self.size[0].max(1e-12)).clamp(20.0, 960.0);
        let (row, gap) = (70.0, 14.0);
        let height = tall + gap + (row + gap) * self.contacts.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {wide} {height:.0}\" font-family=\"sans-serif\" \
             font-size=\"11\">\n<rect width=\"{wide}\" height=\"{height:.0}\" fill=\"white\"/>\n"
        );
        svg.push_str(&image_element(&self.picture, [0.0, 1.0], [0.0, 0.0, wide, tall])?);
        // Writing to a string does not fail.
        for (k, met) in self.contacts.iter().enumerate() {
            let colour = crate::plot::colour(k, self.contacts.len());
            // A surface repeats; the figure shows it once.
            let position = |p: &[f32; 2]| {
                let part = |k: usize| (f64::from(p[k]) / self.size[k].max(1e-12)).rem_euclid(1.0);
                [part(0) * wide, part(1) * tall]
            };
            let mut line = String::new();
            let mut before: Option<[f64; 2]> = None;
            for p in met.positions.iter().map(position) {
                let far = before.is_none_or(|b| (p[0] - b[0]).hypot(p[1] - b[1]) > wide / 4.0);
                let _ = write!(line, "{}{:.1} {:.1}", if far { "M" } else { "L" }, p[0], p[1]);
                before = Some(p);
            }
            let _ =
                writeln!(svg, "<path d=\"{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>");
            svg.push_str(&self.profile(met, &colour, [0.0, tall + gap + (row + gap) * k as f64, wide, row]));
        }
        svg.push_str("</svg>\n");
        Some(svg)
    }
}

impl PathProfile {
    /// The profile of one path in a frame `[left, top, width, height]`.
    fn profile(&self, met: &ContactProfile, colour: &str, [left, top, width, height]: [f64; 4]) -> String {
        let values = self.contacts.iter().flat_map(|met| &met.values);
        let (low, high) = values.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
        let end = f64::from(met.distance.last().copied().unwrap_or(1.0)).max(1e-9);
        let points = met.distance.iter().zip(&met.values).map(|(distance, value)| {
            let up = f64::from(value - low) / f64::from(high - low).max(1e-12);
            format!("{:.1},{:.1}", left + width * f64::from(*distance) / end, top + height * (1.0 - up))
        });
        let points = points.collect::<Vec<_>>().join(" ");
        format!(
            "<rect x=\"{left}\" y=\"{top:.1}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#ccc\"/>\n\
             <polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{end:.3} m</text>\n",
            left + width - 4.0,
            top + 12.0,
        )
    }
}
