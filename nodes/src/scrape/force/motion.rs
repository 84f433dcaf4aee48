//! The motion of a contact over a surface: speed, direction, rest and reversals.

use super::segment::{CELL, Cell, Segment};
use serde::{Deserialize, Serialize};

/// Speed below which a contact counts as at rest, m/s.
pub const AT_REST: f32 = 1e-4;
/// Fade of a contact that comes to rest, s.
pub const FADE: f64 = 0.005;
/// Speeds beyond this count as this, m/s: no number leaves the range of single precision.
const FASTEST: f32 = 1e6;

/// State of the motion of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    /// Unit vector of its last motion.
    direction: [f32; 2],
    /// 1, or -1 after an odd number of reversals.
    sign: f32,
    /// 1 in motion, 0 at rest.
    gate: f32,
    begun: bool,
}

/// The motion of a contact over one segment.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Displacement from the anchor, m.
    pub x: Cell,
    /// Displacement from the anchor, m.
    pub y: Cell,
    /// Speed, m/s.
    pub speed: Cell,
    /// Direction in pixels.
    pub tx: Cell,
    /// Direction in pixels.
    pub ty: Cell,
    /// 1 in motion, down to 0 at rest.
    pub gate: Cell,
    /// Sign of the direction along the path: it changes with each reversal.
    pub sign: Cell,
}

impl Motion {
    /// Room for one segment.
    #[must_use]
    pub fn new() -> Self {
        let cell = [0.0; CELL];
        Self { x: cell, y: cell, speed: cell, tx: cell, ty: cell, gate: cell, sign: cell }
    }

    /// Follows a path, a polynomial in samples from the anchor, m.
    ///
    /// `aspect` is the density along x and along y over a common one: directions are those of pixels.
    #[inline(always)]
    pub fn follow(
        &mut self,
        segment: &Segment,
        path: &[[f64; 2]; 4],
        aspect: [f32; 2],
        heading: &mut Heading,
    ) {
        let [b, c, d] = [1, 2, 3].map(|k| path[k].map(|x| x as f32));
        let rate = segment.rate as f32;
        for n in 0..CELL {
            let t = n as f32;
            self.x[n] = t * (b[0] + t * (c[0] + t * d[0]));
            self.y[n] = t * (b[1] + t * (c[1] + t * d[1]));
            let vx = rate * (b[0] + t * (2.0 * c[0] + t * 3.0 * d[0]));
            let vy = rate * (b[1] + t * (2.0 * c[1] + t * 3.0 * d[1]));
            self.speed[n] = (vx * vx + vy * vy).sqrt().min(FASTEST);
            let (px, py) = (vx * aspect[0], vy * aspect[1]);
            let length = (px * px + py * py).sqrt().max(f32::MIN_POSITIVE);
            self.tx[n] = px / length;
            self.ty[n] = py / length;
        }
        self.head(segment, heading);
    }

    /// Returns true if the contact neither rests nor reverses: then no work per sample is needed.
    #[inline(always)]
    fn goes_on(&self, segment: &Segment, direction: [f32; 2]) -> bool {
        let (from, to) = (segment.from, segment.to.min(CELL));
        let (Some(speed), Some(tx), Some(ty)) =
            (self.speed.get(from..to), self.tx.get(from..to), self.ty.get(from..to))
        else {
            return false;
        };
        let (Some(x), Some(y)) = (tx.first(), ty.first()) else { return true };
        let moving = speed.iter().fold(true, |all, v| all & (*v >= AT_REST));
        let turns = tx
            .windows(2)
            .zip(ty.windows(2))
            .fold(false, |any, (x, y)| any | (x[0] * x[1] + y[0] * y[1] < 0.0));
        moving && !turns && direction[0] * x + direction[1] * y >= 0.0
    }

    /// Directions at rest, reversals and the fade to rest, sample by sample.
    #[inline(always)]
    fn head(&mut self, segment: &Segment, heading: &mut Heading) {
        let range = segment.from..segment.to.min(CELL);
        let Some(first) = self.speed.get(range.start) else { return };
        if !heading.begun {
            let gate = if *first >= AT_REST { 1.0 } else { 0.0 };
            *heading = Heading { sign: 1.0, gate, begun: true, direction: [0.0; 2] };
        }
        if heading.gate == 1.0 && self.goes_on(segment, heading.direction) {
            self.gate = [1.0; CELL];
            self.sign = [heading.sign; CELL];
            let last = range.end.saturating_sub(1).min(CELL - 1);
            heading.direction = [self.tx[last], self.ty[last]];
            return;
        }
        let step = (1.0 / (FADE * segment.rate)) as f32;
        for n in range {
            let moving = self.speed[n] >= AT_REST;
            let target = if moving { 1.0 } else { 0.0 };
            heading.gate += (target - heading.gate).clamp(-step, step);
            self.gate[n] = heading.gate;
            let [x, y] = heading.direction;
            if moving {
                if x * self.tx[n] + y * self.ty[n] < 0.0 {
                    heading.sign = -heading.sign;
                }
                heading.direction = [self.tx[n], self.ty[n]];
            } else {
                (self.tx[n], self.ty[n]) = (x, y);
            }
            self.sign[n] = heading.sign;
        }
    }
}

impl Default for Motion {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::time::Rate;
    use crate::scrape::force::voices::Voices;
    use crate::scrape::path::PathPiece;
    use crate::scrape::testing::piece;

    #[test]
    fn below_a_tenth_of_a_millimetre_a_second_the_last_direction_is_held() {
        let go = piece([0.0; 2], [0.3, 0.4], 0.1);
        for (back, turned) in [(0.9e-4, false), (1.1e-4, true)] {
            let creep = piece(go.position_at(1.0), [-back, 0.0], 0.1);
            let rate = Rate::hz(10_000);
            let mut voices = Voices::new(2, rate, Heading::default());
            let (mut motion, mut directions) = (Motion::new(), Vec::new());
            voices.play(
                &[(0, go), (rate.tick(1000), creep)],
                None,
                0,
                &mut [0.0; 2000],
                |_| Heading::default(),
                |heading, segment, _| {
                    motion.follow(segment, &segment.path(), [1.0; 2], heading);
                    let (x, y) =
                        (segment.part(&mut motion.tx).to_vec(), segment.part(&mut motion.ty).to_vec());
                    directions.extend(x.into_iter().zip(y));
                },
            );
            let near = |(x, y): (f32, f32), right: (f32, f32)| (x - right.0).hypot(y - right.1) < 1e-4;
            assert!(near(directions[500], (0.6, 0.8)));
            assert!(
                near(directions[1500], if turned { (-1.0, 0.0) } else { (0.6, 0.8) }),
                "{back}: {:?}",
                directions[1500]
            );
        }
    }

    #[test]
    fn a_reversal_turns_the_sign_and_a_bend_does_not() {
        let rate = Rate::hz(10_000);
        let circle: Vec<PathPiece> = (0..8)
            .map(|k| {
                let angle = std::f64::consts::FRAC_PI_4 * f64::from(k);
                piece([0.0; 2], [angle.cos(), angle.sin()], 0.1)
            })
            .collect();
        let back = piece([0.0; 2], [-0.5, 0.8], 0.1);
        let mut voices = Voices::new(2, rate, Heading::default());
        let (mut signs, mut motion) = (Vec::new(), Motion::new());
        let all = circle.into_iter().chain([back]);
        let events: Vec<_> = (0..).map(|k| rate.tick(1000 * k)).zip(all).collect();
        voices.play(
            &events,
            None,
            0,
            &mut [0.0; 9000],
            |_| Heading::default(),
            |heading, segment, _| {
                motion.follow(segment, &segment.path(), [1.0; 2], heading);
                signs.extend_from_slice(segment.part(&mut motion.sign));
            },
        );
        assert!(signs[..8000].iter().all(|s| *s == 1.0) && signs[8000..].iter().all(|s| *s == -1.0));
    }
}
