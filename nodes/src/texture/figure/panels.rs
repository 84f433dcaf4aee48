//! Drawings beside each other, with the letters of a figure.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::escaped;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Width of a panel.
const WIDTH: f64 = 420.0;
/// Space around panels.
const GAP: f64 = 10.0;
/// Height of the letter below a panel.
const LETTER: f64 = 26.0;

/// Drawings of one texture beside each other, as in the figures of Picard, Tsingos and Faure (2008).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TextureDrawing {
    /// Name and SVG document of each panel.
    pub panels: Vec<(String, String)>,
}

/// Width and height of an SVG document, by its view box.
fn size(svg: &str) -> Option<[f64; 2]> {
    let numbers = svg.split_once("viewBox=\"")?.1.split_once('"')?.0;
    let numbers: Option<Vec<f64>> = numbers.split_whitespace().map(|x| x.parse().ok()).collect();
    let [_, _, width, height] = numbers?.try_into().ok()?;
    (width > 0.0 && height > 0.0).then_some([width, height])
}

impl Data for TextureDrawing {
    const NAME: &'static str = "texture drawing";
    const PLOTS: bool = true;

    fn trial(_: &mut Rng) -> Self {
        let empty = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 10 10\"></svg>\n";
        Self { panels: vec![("image".into(), empty.into()), ("isophotes".into(), empty.into())] }
    }

    /// The panels from left to right at one width, each as a document within the document, with the letters (a), (b), (c).
    fn plot(&self) -> Option<String> {
        let sizes: Vec<f64> = self
            .panels
            .iter()
            .map(|(_, svg)| size(svg).map(|[width, height]| WIDTH * height / width))
            .collect::<Option<_>>()?;
        let highest =
            sizes.iter().copied().fold(None, |a: Option<f64>, x| Some(a.map_or(x, |a| a.max(x))))?;
        let (width, height) = (GAP + (WIDTH + GAP) * self.panels.len() as f64, highest + 2.0 * GAP + LETTER);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" font-family=\"sans-serif\" \
             font-size=\"14\">\n<rect width=\"{width:.1}\" height=\"{height:.1}\" fill=\"white\"/>\n"
        );
        for (k, ((name, svg), high)) in self.panels.iter().zip(sizes).enumerate() {
            let left = GAP + (WIDTH + GAP) * k as f64;
            let place =
                format!("<svg x=\"{left:.1}\" y=\"{GAP:.1}\" width=\"{WIDTH:.1}\" height=\"{high:.1}\" ");
            out.push_str(&svg.replacen("<svg ", &place, 1));
            let letter = char::from_u32(u32::from('a') + k as u32)?;
            // Writing to a string cannot fail.
            let _ = writeln!(
                out,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">({letter}) {}</text>",
                left + WIDTH / 2.0,
                GAP + highest + LETTER - 6.0,
                escaped(name)
            );
        }
        out.push_str("</svg>\n");
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_are_nested_at_one_width() {
        let svg = |w: u32, h: u32| format!("<svg xmlns=\"s\" viewBox=\"0 0 {w} {h}\"><g id=\"{w}\"/></svg>");
        let panels = vec![("image".to_owned(), svg(100, 50)), ("a < b".to_owned(), svg(10, 10))];
        let drawing = TextureDrawing { panels }.plot().unwrap();
        for part in [
            "viewBox=\"0 0 870.0 466.0\"",
            "<svg x=\"10.0\" y=\"10.0\" width=\"420.0\" height=\"210.0\" xmlns=\"s\" viewBox=\"0 0 100 50\"><g id=\"100\"/>",
            "<svg x=\"440.0\" y=\"10.0\" width=\"420.0\" height=\"420.0\"",
            ">(a) image</text>",
            ">(b) a &lt; b</text>",
        ] {
            assert!(drawing.contains(part), "{part}: {drawing}");
        }
        assert_eq!((drawing.matches("<svg ").count(), drawing.matches("</svg>").count()), (3, 3));
        assert!(TextureDrawing::default().plot().is_none());
    }
}
