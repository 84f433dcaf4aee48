//! Figures of a cloth with its buckling vertices.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::buckle::Buckle;
use super::buckles::Buckles;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Fold, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::{archive_state, choices, params, ports};

choices! {
    /// Direction of view.
    pub enum View {
        /// From above: x to the right, y up.
        Top,
        /// From the front: x to the right, z up.
        Front,
        /// From the side: y to the right, z up.
        Side,
        /// From the front, one side and above.
        Oblique,
    }
}

impl View {
    fn project(self, [x, y, z]: [f32; 3]) -> [f32; 2] {
        match self {
            Self::Top => [x, y],
            Self::Front => [x, z],
            Self::Side => [y, z],
            Self::Oblique => [0.87 * x + 0.5 * y, 0.82 * z + 0.57 * (0.87 * y - 0.5 * x)],
        }
    }
}

/// One frame of a figure.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// Time, s.
    pub seconds: f64,
    /// Projected positions of all vertices, m.
    pub vertices: Vec<[f32; 2]>,
    /// Vertices that buckle outwards.
    pub outwards: Vec<u32>,
    /// Vertices that buckle inwards.
    pub inwards: Vec<u32>,
}

/// Some frames of a cloth with their buckling vertices: figure 6 of An, James and Marschner (2012).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BucklePicture {
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
    /// The frames.
    pub panels: Vec<Panel>,
}

/// Width of a panel in the figure.
const SIZE: f64 = 420.0;

impl Data for BucklePicture {
    const NAME: &'static str = "buckle picture";
    const PLOTS: bool = true;

    fn trial(_: &mut Rng) -> Self {
        let vertices = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        Self {
            triangles: vec![[0, 1, 2]],
            panels: vec![Panel { vertices, outwards: vec![1], ..Panel::default() }],
        }
    }

    fn plot(&self) -> Option<String> {
        let all = || self.panels.iter().flat_map(|p| &p.vertices);
        let end = |k: usize, minimum: bool| {
            all().map(|p| f64::from(p[k])).fold(None, |a: Option<f64>, x| {
                Some(a.map_or(x, |a| if minimum { a.min(x) } else { a.max(x) }))
            })
        };
        let (low, high) = ([end(0, true)?, end(1, true)?], [end(0, false)?, end(1, false)?]);
        let scale = (SIZE - 40.0) / (high[0] - low[0]).max(high[1] - low[1]).max(1e-9);
        let (wide, tall) = (SIZE, (high[1] - low[1]) * scale + 60.0);
        let width = wide * self.panels.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {tall:.0}\" font-family=\"sans-serif\" \
             font-size=\"13\">\n<rect width=\"{width}\" height=\"{tall:.0}\" fill=\"white\"/>\n"
        );
        for (k, panel) in self.panels.iter().enumerate() {
            let position = |v: u32| {
                let p = panel.vertices.get(v as usize).copied().unwrap_or_default();
                let x = wide * k as f64 + 20.0 + (f64::from(p[0]) - low[0]) * scale;
                (x, 40.0 + (high[1] - f64::from(p[1])) * scale)
            };
            let (outwards, inwards) = (panel.outwards.len(), panel.inwards.len());
            // Writing to a string cannot fail.
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"22\">{:.3} s: {outwards} outwards (red), {inwards} inwards (blue)</text>",
                wide * k as f64 + 20.0,
                panel.seconds
            );
            svg.push_str("<path fill=\"none\" stroke=\"#bbb\" stroke-width=\"0.4\" d=\"");
            for t in &self.triangles {
                let [a, b, c] = t.map(position);
                let _ = write!(svg, "M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}", a.0, a.1, b.0, b.1, c.0, c.1);
            }
            svg.push_str("\"/>\n");
            for (list, colour) in [(&panel.outwards, "#b2182b"), (&panel.inwards, "#2166ac")] {
                for v in list {
                    let (x, y) = position(*v);
                    let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2\" fill=\"{colour}\"/>");
                }
            }
        }
        svg.push_str("</svg>\n");
        Some(svg)
    }
}

params! {
    /// Draws some frames of a cloth with coloured buckling vertices: `--tap NODE=figure.svg`.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), figure 6.
    pub struct BuckleFigureParams {
        /// Times of the frames; the frame at each time or after it is drawn. Without times, the three frames with the
        /// most buckling vertices are drawn.
        times: Vec<f64> = Vec::new(), unit "s", range 0.0..=86_400.0;
        /// Direction of view.
        view: View = View::Oblique;
    }
}
ports! {
    pub struct BuckleFigurePorts / BuckleFigureIo {
        in {
            /// Buckling vertices.
            buckles: Stream<Buckles>,
        }
        out {
            /// The figure.
            picture: Fold<BucklePicture>,
        }
    }
}

/// The node `BuckleFigure`.
pub struct BuckleFigure {
    triangles: Vec<[u32; 3]>,
    frames: Vec<i64>,
    end: i64,
    view: View,
    panels: Vec<Panel>,
}

/// Number of frames that are drawn without `times`.
const DEFAULT_FRAMES: usize = 3;

fn panel(seconds: f64, frame: &[Buckle], view: View) -> Panel {
    let vertices_with =
        |label: i8| frame.iter().zip(0..).filter(move |(b, _)| b.label == label).map(|(_, v)| v).collect();
    let vertices = frame.iter().map(|b| view.project(b.position)).collect();
    Panel { seconds, vertices, outwards: vertices_with(1), inwards: vertices_with(-1) }
}

impl Node for BuckleFigure {
    type Params = BuckleFigureParams;
    type Ports = BuckleFigurePorts;
    const NAME: &'static str = "BuckleFigure";
    const CLASS: Class = Class::Offline;

    fn shape(_: &BuckleFigureParams, s: &mut Shape<'_, '_, BuckleFigurePorts>) -> Result<(), Reject> {
        if s.input(BuckleFigurePorts::buckles).end.is_none() {
            return Err(
                Reject::new("F075", "`buckles` does not end; a figure needs a finite stream").at("buckles")
            );
        }
        Ok(())
    }

    fn build(p: &BuckleFigureParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let buckles = cx.input(BuckleFigurePorts::buckles);
        let triangles = buckles.format.topology.triangles.clone();
        let frames = p.times.iter().map(|t| buckles.rate.first_at(ticks(*t))).collect();
        Ok(Self { triangles, frames, end: buckles.items().unwrap_or(0), view: p.view, panels: Vec::new() })
    }

    fn run(&mut self, io: BuckleFigureIo<'_>) -> Result<(), Fault> {
        let rate = io.buckles.rate();
        let frames =
            (io.buckles.first()..self.end).zip(io.buckles.items().chunks_exact(io.buckles.width().max(1)));
        for (number, frame) in frames {
            let seconds = crate::core::time::seconds(rate.tick(number));
            if self.frames.contains(&number) {
                self.panels.push(panel(seconds, frame, self.view));
            } else if self.frames.is_empty() {
                let count = |p: &Panel| p.outwards.len() + p.inwards.len();
                let buckling = frame.iter().filter(|b| b.label != 0).count();
                let full = self.panels.len() == DEFAULT_FRAMES;
                let fewest = self.panels.iter().map(count).min().unwrap_or(0);
                if buckling == 0 || (full && buckling <= fewest) {
                    continue;
                }
                if let Some(index) = self.panels.iter().position(|p| full && count(p) == fewest) {
                    self.panels.remove(index);
                }
                self.panels.push(panel(seconds, frame, self.view));
            }
        }
        Ok(())
    }

    fn finish(&mut self, mut io: BuckleFigureIo<'_>) -> Result<Summary, Fault> {
        let panels = std::mem::take(&mut self.panels);
        let summary = vec![("frames", panels.len().into())];
        io.picture.set(BucklePicture { triangles: std::mem::take(&mut self.triangles), panels });
        Ok(summary)
    }

    archive_state!(panels);

    fn trial(rng: &mut Rng) -> (BuckleFigureParams, MemoryFiles) {
        let times = (0..rng.below(3)).map(|_| rng.between(0.0, 0.5)).collect();
        (BuckleFigureParams { times, ..BuckleFigureParams::trial(rng) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::curvature::scenes::grid;
    use crate::mesh::MeshFormat;

    #[test]
    fn the_frames_at_the_times_or_those_with_the_most_labels_are_drawn() {
        let scene = grid(4, 3, false, |u, v| [u, v, 0.0]);
        let frame = |buckling: usize| {
            let buckle = |(v, p): (usize, &[f64; 3])| Buckle {
                label: if v < buckling { 1 - 2 * (v % 2) as i8 } else { 0 },
                position: p.map(|x| x as f32),
                ..Buckle::default()
            };
            scene.points.iter().enumerate().map(buckle).collect::<Vec<_>>()
        };
        let frames: Vec<Buckle> = [0, 3, 1, 7, 2, 7, 0].into_iter().flat_map(frame).collect();
        let run = |times: &[f64], window| {
            let p = BuckleFigureParams { times: times.to_vec(), view: View::Top };
            let standalone = Standalone::new::<BuckleFigure>(p).window(ticks(window)).input(
                BuckleFigurePorts::buckles,
                Rate::hz(10),
                MeshFormat::moving(scene.topology()),
                frames.clone(),
            );
            standalone.run().unwrap().value(0).unwrap().get::<BucklePicture>().unwrap().clone()
        };
        let times = |p: &BucklePicture| {
            p.panels.iter().map(|p| (p.seconds * 10.0).round() as i64).collect::<Vec<_>>()
        };
        let found = run(&[], 0.1);
        assert_eq!((times(&found), &found), (vec![1, 3, 5], &run(&[], 3.0)));
        let svg = found.plot().unwrap();
        assert_eq!((svg.matches("<circle").count(), svg.matches("<path").count()), (17, 3));
        assert!(svg.contains("0.300 s: 4 outwards (red), 3 inwards (blue)"));
        assert_eq!(times(&run(&[0.0, 0.35], 0.2)), [0, 4]);
        assert_eq!(BucklePicture::default().plot(), None);
    }
}
