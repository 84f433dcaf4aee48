//! Paths that are drawn rather than simulated.

use super::piece::PathPiece;
use super::tracker::{END_FADE, JUMP_FADE};
use crate::core::time::{Tick, ticks};
use std::f64::consts::TAU;

/// Longest piece of a curve, s.
const PIECE: f64 = 1.0 / 60.0;
/// Pieces beyond which a stroke is too long.
const MAX_FACTOR: f64 = 1e6;

/// A position of a stroke: when, where, how fast, under which force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Time, s.
    pub time: f64,
    /// Position, m.
    pub position: [f64; 2],
    /// Velocity before and after it, m/s: a corner has two.
    pub velocity: [[f64; 2]; 2],
    /// Normal force, N.
    pub force: f64,
}

/// Common properties of all pieces of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeContact {
    /// Number of the contact.
    pub contact: u64,
    /// Number of the object.
    pub object: u32,
    /// Distance on the other surface per distance on this one: 0 for a tip, 1 for rolling; `None` without another surface.
    pub other: Option<f64>,
}

/// Waypoints `[time, x, y, force]` joined smoothly (Catmull and Rom, for uneven times).
#[must_use]
pub fn through(points: &[[f64; 4]]) -> Vec<Knot> {
    let last = points.len().saturating_sub(1);
    let knot = |k: usize, p: &[f64; 4]| {
        let ([t0, x0, y0, _], [t1, x1, y1, _]) = (points[k.saturating_sub(1)], points[(k + 1).min(last)]);
        let time = (t1 - t0).max(1e-9);
        let velocity = [(x1 - x0) / time, (y1 - y0) / time];
        Knot { time: p[0], position: [p[1], p[2]], velocity: [velocity; 2], force: p[3] }
    };
    points.iter().enumerate().map(|(k, p)| knot(k, p)).collect()
}

/// Straight lines from position to position at an even speed; `None` if there would be more than a million pieces.
#[must_use]
pub fn lines(positions: &[[f64; 2]], start: f64, speed: f64, force: f64) -> Option<Vec<Knot>> {
    let mut knots: Vec<Knot> = Vec::new();
    let mut time = start;
    for pair in positions.windows(2) {
        let [p, q] = [pair[0], pair[1]];
        let length = (q[0] - p[0]).hypot(q[1] - p[1]);
        let velocity = if length > 0.0 { [0, 1].map(|k| (q[k] - p[k]) / length * speed) } else { [0.0; 2] };
        match knots.last_mut() {
            Some(corner) => corner.velocity[1] = velocity,
            None => knots.push(Knot { time, position: p, velocity: [velocity; 2], force }),
        }
        time += length / speed;
        knots.push(Knot { time, position: q, velocity: [velocity; 2], force });
    }
    (time - start < MAX_FACTOR * PIECE).then_some(knots)
}

/// Turns around a centre at an even speed, anticlockwise for y up; `None` as for [`lines`].
#[must_use]
pub fn circle(
    centre: [f64; 2],
    radius: f64,
    turns: f64,
    start: f64,
    speed: f64,
    force: f64,
) -> Option<Vec<Knot>> {
    let time = TAU * radius * turns / speed;
    let steps = (time / PIECE).ceil().max((12.0 * turns).ceil()).max(1.0);
    let knot = |k: u32| {
        let part = f64::from(k) / steps;
        let (sin, cos) = libm::sincos(TAU * turns * part);
        let velocity = [-speed * sin, speed * cos];
        let position = [centre[0] + radius * cos, centre[1] + radius * sin];
        Knot { time: start + time * part, position, velocity: [velocity; 2], force }
    };
    (steps <= MAX_FACTOR).then(|| (0..=steps as u32).map(knot).collect())
}

/// The pieces of a stroke with their starts: it begins within 2 ms and fades out in 5 ms after its last position.
#[must_use]
pub fn pieces(knots: &[Knot], contact: StrokeContact) -> Vec<(Tick, PathPiece)> {
    let mut all = Vec::new();
    for pair in knots.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (start, end) = (ticks(a.time), ticks(b.time));
        if end <= start {
            continue;
        }
        let time = b.time - a.time;
        let part = |f: &dyn Fn(usize) -> f64| [f(0), f(1)];
        let gap: [f64; 2] = std::array::from_fn(|k| b.position[k] - a.position[k]);
        let (v, w) = (a.velocity[1].map(|v| v * time), b.velocity[0].map(|v| v * time));
        let position = [
            a.position,
            v,
            part(&|k| 3.0 * gap[k] - 2.0 * v[k] - w[k]),
            part(&|k| v[k] + w[k] - 2.0 * gap[k]),
        ];
        all.push((start, piece(contact, position, end - start, [a.force, b.force], [1.0; 2])));
    }
    if let (Some(knot), Some((start, last))) = (knots.last(), all.last().copied()) {
        let step = knot.velocity[0].map(|v| v * END_FADE);
        let position = [last.position_at(1.0), step, [0.0; 2], [0.0; 2]];
        all.push((
            start + last.duration,
            piece(contact, position, ticks(END_FADE), [knot.force; 2], [1.0, 0.0]),
        ));
    }
    fade_in(&mut all);
    all
}

fn piece(
    contact: StrokeContact,
    position: [[f64; 2]; 4],
    duration: Tick,
    force: [f64; 2],
    gain: [f32; 2],
) -> PathPiece {
    PathPiece {
        contact: contact.contact,
        jump: 0,
        object: contact.object,
        duration,
        position,
        other: contact.other.map(|share| position.map(|c| c.map(|x| share * x))),
        force: force.map(|f| f as f32),
        gain,
        mass: None,
    }
}

fn fade_in(pieces: &mut Vec<(Tick, PathPiece)>) {
    let Some((start, first)) = pieces.first().copied() else { return };
    let fade = ticks(JUMP_FADE).min(first.duration);
    let s = fade as f64 / first.duration as f64;
    let begin = PathPiece { gain: [0.0, 1.0], ..first.part(0.0, s, fade) };
    pieces[0] = (start, begin);
    if fade < first.duration {
        pieces.insert(1, (start + fade, first.part(s, 1.0, first.duration - fade)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::time::seconds;

    const STROKE: StrokeContact = StrokeContact { contact: 7, object: 2, other: Some(0.5) };

    fn at(pieces: &[(Tick, PathPiece)], time: f64) -> [f64; 2] {
        let tick = ticks(time);
        let k = pieces.partition_point(|(start, _)| *start <= tick) - 1;
        let (start, piece) = pieces[k];
        piece.position_at((tick - start) as f64 / piece.duration as f64)
    }

    #[test]
    fn a_circle_is_round_and_even() {
        let knots = circle([1.0, 2.0], 0.1, 1.5, 0.2, 0.4, 3.0).unwrap();
        let pieces = pieces(&knots, STROKE);
        for k in 0..200 {
            let time = 0.2 + f64::from(k) * 0.0117;
            let [x, y] = at(&pieces, time);
            let angle = (time - 0.2) * 0.4 / 0.1;
            let right = [1.0 + 0.1 * angle.cos(), 2.0 + 0.1 * angle.sin()];
            assert!((x - right[0]).hypot(y - right[1]) < 1e-5, "{time}: {x} {y} {right:?}");
        }
    }

    #[test]
    fn waypoints_are_passed_at_their_times_and_forces() {
        let points =
            [[0.0, 0.0, 0.0, 1.0], [0.5, 0.1, 0.0, 2.0], [0.6, 0.1, 0.1, 4.0], [2.0, -0.3, 0.2, 0.0]];
        let pieces = pieces(&through(&points), STROKE);
        for [t, x, y, _] in points {
            let [px, py] = at(&pieces, t);
            assert!((px - x).hypot(py - y) < 1e-9);
        }
        assert_eq!(pieces[2].1.force, [2.0, 4.0]);
        let joins = pieces.windows(2).all(|w| w[0].0 + w[0].1.duration == w[1].0);
        assert!(joins && pieces[0].1.gain == [0.0, 1.0]);
        let last = pieces.last().unwrap();
        assert_eq!((last.1.gain, seconds(last.1.duration)), ([1.0, 0.0], 0.005));
        assert_eq!(last.1.other.unwrap()[0][0], 0.5 * last.1.position[0][0]);
    }

    #[test]
    fn a_zigzag_turns_at_its_corners_at_an_even_speed() {
        let knots = lines(&[[0.0; 2], [0.3, 0.4], [0.3, 0.0]], 1.0, 0.5, 1.0).unwrap();
        let pieces = pieces(&knots, STROKE);
        assert!((at(&pieces, 2.0)[1] - 0.4).abs() < 1e-9 && (at(&pieces, 2.4)[1] - 0.2).abs() < 1e-9);
        assert!((at(&pieces, 1.5)[0] - 0.15).abs() < 1e-9);
        assert!(lines(&[[0.0; 2], [1e9, 0.0]], 0.0, 1e-3, 1.0).is_none());
    }
}
