//! The node `Stroke`.

use super::knots::{Knot, StrokeContact, circle, lines, pieces, through};
use super::piece::PathPiece;
use super::tracker::END_FADE;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, ticks};
use crate::{choices, params, ports};

choices! {
    /// Shape of the stroke.
    pub enum StrokeShape {
        /// A smooth curve through `points`.
        Points,
        /// A straight line from `from` to `to`, and back and forth with more `laps`.
        Line,
        /// `laps` turns around `from` with `radius`.
        Circle,
        /// Zigzag of `laps` strokes between `from` and `to`, with `width`.
        Zigzag,
    }
}

params! {
    /// Generates the path of one contact from a drawn shape, without a physics engine.
    ///
    /// It begins within 2 ms and fades out in 5 ms after its last position. All shapes but `Points` have a constant `speed` and a
    /// constant `force`. Link it to any node that reads paths.
    ///
    /// # Source
    /// The drawn trajectories of figure 6 in Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008).
    pub struct StrokeParams {
        /// Shape of the stroke.
        shape: StrokeShape = StrokeShape::Line;
        /// Waypoints [time in s, x in m, y in m, force in N] in the order of their times, for the shape `Points`.
        points: Vec<[f64; 4]> = Vec::new(), unit "s, m, m, N", range -100_000.0..=100_000.0;
        /// Start, or the centre of a circle.
        from: [f64; 2] = [0.0; 2], unit "m", range -10_000.0..=10_000.0;
        /// End.
        to: [f64; 2] = [0.5, 0.0], unit "m", range -10_000.0..=10_000.0;
        /// Radius of a circle.
        radius: f64 = 0.1, unit "m", range 0.0001..=1000.0;
        /// Width of a zigzag from side to side.
        width: f64 = 0.1, unit "m", range 0.0..=1000.0;
        /// Passages of a line, turns of a circle, strokes of a zigzag.
        laps: f64 = 1.0, unit "", range 0.01..=10_000.0;
        /// Speed.
        speed: f64 = 0.25, unit "m/s", range 0.000001..=100.0;
        /// Normal force.
        force: f64 = 1.0, unit "N", range 0.0..=100_000.0;
        /// Time of the start.
        start: f64 = 0.0, unit "s", range 0.0..=86_400.0;
        /// Distance travelled on the other surface per distance on this one: 0 for a sliding tip, 1 for rolling; None for no
        /// other surface.
        other: Option<f64> = None, unit "", range -100.0..=100.0;
        /// Number of the contact: strokes read by the same node need different numbers.
        contact: u32 = 0, unit "", range 0..=4_294_967_295_u32;
        /// Number of the object that is excited.
        object: u32 = 0, unit "", range 0..=4_294_967_295_u32;
    }
}
ports! {
    pub struct StrokePorts / StrokeIo {
        in {}
        out {
            /// The path as polynomials.
            paths: Events<PathPiece>,
        }
    }
}

/// The node `Stroke`.
#[derive(Debug)]
pub struct Stroke {
    pieces: Vec<(Tick, PathPiece)>,
}

fn knots(p: &StrokeParams) -> Result<Vec<Knot>, Reject> {
    let refuse = |field: &str, message: String| Reject::new("F130", message).at(field);
    let drawn = match p.shape {
        StrokeShape::Points => {
            if p.points.len() < 2 {
                return Err(refuse(
                    "points",
                    format!("`points` has {} waypoints; 2 or more are needed", p.points.len()),
                ));
            }
            let rising = |w: &[[f64; 4]]| w[0][0] < w[1][0];
            let before = p.points.iter().any(|point| point[0] + p.start < 0.0);
            if before || !p.points.windows(2).all(rising) {
                return Err(refuse("points", "the times of `points` do not rise from 0 on".into())
                    .help("waypoints are [time, x, y, force], in the order of their times"));
            }
            let later = |point: &[f64; 4]| [point[0] + p.start, point[1], point[2], point[3].max(0.0)];
            Some(through(&p.points.iter().map(later).collect::<Vec<_>>()))
        }
        StrokeShape::Line => {
            let laps = p.laps.ceil().max(1.0) as usize;
            let mut positions: Vec<_> =
                (0..=laps).map(|k| if k.is_multiple_of(2) { p.from } else { p.to }).collect();
            // The last passage may be a part of one.
            if let [.., a, b] = positions.as_mut_slice() {
                let part = p.laps - (laps as f64 - 1.0);
                *b = [0, 1].map(|k| a[k] + part * (b[k] - a[k]));
            }
            lines(&positions, p.start, p.speed, p.force)
        }
        StrokeShape::Circle => circle(p.from, p.radius, p.laps, p.start, p.speed, p.force),
        StrokeShape::Zigzag => lines(&zigzag(p), p.start, p.speed, p.force),
    };
    let too_long = || {
        let help = "a faster or a shorter one; 16,000 s are the most";
        refuse("speed", format!("at {} m/s the stroke takes too long", p.speed)).help(help)
    };
    drawn.ok_or_else(too_long)
}

fn zigzag(p: &StrokeParams) -> Vec<[f64; 2]> {
    let offset = [p.to[0] - p.from[0], p.to[1] - p.from[1]];
    let length = offset[0].hypot(offset[1]).max(1e-12);
    let side = [-offset[1] / length * p.width / 2.0, offset[0] / length * p.width / 2.0];
    let strokes = p.laps.ceil().max(1.0) as usize;
    let corner = |k: usize| {
        let along = k as f64 / strokes as f64;
        let sign = if k.is_multiple_of(2) { -1.0 } else { 1.0 };
        [0, 1].map(|i| p.from[i] + along * offset[i] + sign * side[i])
    };
    (0..=strokes).map(corner).collect()
}

impl Node for Stroke {
    type Params = StrokeParams;
    type Ports = StrokePorts;
    const NAME: &'static str = "Stroke";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;

    fn shape(p: &StrokeParams, s: &mut Shape<'_, '_, StrokePorts>) -> Result<(), Reject> {
        let end = knots(p)?.last().map_or(p.start, |knot| knot.time);
        s.ends(Some(ticks(end + END_FADE)));
        Ok(())
    }

    fn build(p: &StrokeParams, _: &Build<'_>) -> Result<Self, Fault> {
        let contact = StrokeContact { contact: p.contact.into(), object: p.object, other: p.other };
        Ok(Self { pieces: pieces(&knots(p)?, contact) })
    }

    fn run(&mut self, mut io: StrokeIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.paths.window();
        let at = self.pieces.partition_point(|(tick, _)| *tick < from);
        for (tick, piece) in self.pieces[at..].iter().take_while(|(tick, _)| *tick < to) {
            io.paths.push(*tick, *piece);
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (StrokeParams, MemoryFiles) {
        let params = StrokeParams::trial(rng);
        let mut time = 0.0;
        let point = |_| {
            time += rng.between(0.01, 0.1);
            [time, rng.between(-0.1, 0.1), rng.between(-0.1, 0.1), rng.between(0.0, 5.0)]
        };
        let points = (0..4).map(point).collect();
        let laps = rng.between(0.1, 2.5);
        let radius = rng.between(0.001, 0.02);
        let (from, to) = ([rng.between(-0.1, 0.1), 0.0], [0.1, rng.between(-0.1, 0.1)]);
        let (speed, start, width) = (rng.between(0.5, 2.0), rng.between(0.0, 0.1), rng.between(0.0, 0.05));
        (
            StrokeParams { points, laps, radius, from, to, speed, start, width, ..params },
            MemoryFiles::default(),
        )
    }
}
