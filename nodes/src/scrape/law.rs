//! How strongly a surface answers: the law of force and speed that all excitations share, and the motion it is fed with.

use super::slew::Slew;
use super::strength::SpeedCurve;
use super::voices::{CELL, Cell, Stretch};
use serde::{Deserialize, Serialize};

/// Speed below which a contact counts as at rest, m/s.
pub const AT_REST: f32 = 1e-4;
/// How long a contact that comes to rest takes to fall silent, s.
pub const FADE: f64 = 0.005;
/// Speeds beyond this count as this, m/s: no number leaves the range of single precision.
const FASTEST: f32 = 1e6;

/// Amplitude `kappa (f/f_ref)^a (v/v_ref)^b` with `f_ref` = 1 N and `v_ref` = 1 m/s, every part of which can be turned while
/// it sounds.
///
/// # Source
/// Picard, Tsingos and Faure (VRIPHYS 2008), section 4, say that position, force and velocity are used; the law is a choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Factor.
    pub kappa: Slew,
    /// Exponent of the force.
    pub a: Slew,
    /// Exponent of the speed.
    pub b: Slew,
    /// What the factor is worth at each speed, where that is known.
    pub curve: Option<SpeedCurve>,
}

impl Law {
    /// A law at rest.
    #[must_use]
    pub fn new([kappa, a, b]: [f64; 3], rate: f64) -> Self {
        Self { kappa: Slew::new(kappa, rate), a: Slew::new(a, rate), b: Slew::new(b, rate), curve: None }
    }

    /// Sets off for another law at a sample.
    pub fn go_to(&mut self, [kappa, a, b]: [f64; 3], sample: i64) {
        self.kappa.go_to(kappa, sample);
        self.a.go_to(a, sample);
        self.b.go_to(b, sample);
    }

    /// What the curve makes of a speed on a surface of a size: what is twice as large is met half as fast, and then the law, which
    /// knows nothing of that, counts the whole speed; a relief is twice as high.
    #[inline]
    #[must_use]
    pub fn bend(&self, speed: f32, size: f64, sample: i64) -> f32 {
        let Some(curve) = &self.curve else { return 1.0 };
        let size = size as f32;
        curve.at(speed / size) * power(size, curve.growth - self.b.at(sample) as f32)
    }

    /// Multiplies `out` by the amplitude over a stretch: law, amplitude of the piece, and rest. `sizes` are those of the surface at
    /// the first and the last sample of the cell.
    #[inline(always)]
    pub fn apply(&self, stretch: &Stretch, moves: &Moves, sizes: [f64; 2], out: &mut Cell) {
        if self.curve.is_some() {
            // Within 64 samples a speed changes so little that a straight line will do.
            let [a, b] = [(0, sizes[0]), (CELL - 1, sizes[1])]
                .map(|(n, size)| self.bend(moves.speed[n], size, stretch.anchor + n as i64));
            let step = (b - a) / (CELL - 1) as f32;
            for (n, out) in out.iter_mut().enumerate() {
                *out *= a + n as f32 * step;
            }
        }
        let (mut force, mut gain) = ([0.0; CELL], [0.0; CELL]);
        stretch.force(&mut force);
        stretch.gain(&mut gain);
        let from = stretch.anchor;
        let settled = [self.kappa, self.a, self.b].map(|slew| slew.settled(from));
        if let [Some(kappa), Some(a), Some(b)] = settled {
            raise(&mut force, a as f32);
            // At rest it is the gate that falls.
            let mut speed = if b == 0.0 { [1.0; CELL] } else { moves.speed };
            raise(&mut speed, b as f32);
            let kappa = kappa as f32;
            for n in 0..CELL {
                out[n] *= kappa * gain[n] * force[n] * speed[n] * moves.gate[n];
            }
            return;
        }
        for n in stretch.from..stretch.to.min(CELL) {
            let at = from + n as i64;
            let [kappa, a, b] = [self.kappa, self.a, self.b].map(|slew| slew.at(at) as f32);
            let speed = if b == 0.0 { 1.0 } else { power(moves.speed[n], b) };
            out[n] *= kappa * gain[n] * power(force[n], a) * speed * moves.gate[n];
        }
    }
}

/// What an excitation remembers of the motion of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    /// Unit vector along which it went last.
    direction: [f32; 2],
    /// 1, or -1 after an odd number of reversals.
    sign: f32,
    /// 1 in motion, 0 at rest.
    gate: f32,
    begun: bool,
}

/// The motion of a contact over one stretch.
#[derive(Clone, Copy, Debug)]
pub struct Moves {
    /// Way from the anchor, m.
    pub x: Cell,
    /// Way from the anchor, m.
    pub y: Cell,
    /// Speed, m/s.
    pub speed: Cell,
    /// Direction in pixels.
    pub tx: Cell,
    /// Direction in pixels.
    pub ty: Cell,
    /// 1 in motion, down to 0 at rest.
    pub gate: Cell,
    /// Sign of the direction along the way: it changes with each reversal.
    pub sign: Cell,
}

impl Moves {
    /// Room for one stretch.
    #[must_use]
    pub fn new() -> Self {
        let cell = [0.0; CELL];
        Self { x: cell, y: cell, speed: cell, tx: cell, ty: cell, gate: cell, sign: cell }
    }

    /// Follows a way, given as a polynomial in samples from the anchor, m.
    ///
    /// `aspect` is the density along x and along y over a common one: directions are those of pixels.
    #[inline(always)]
    pub fn follow(
        &mut self,
        stretch: &Stretch,
        way: &[[f64; 2]; 4],
        aspect: [f32; 2],
        heading: &mut Heading,
    ) {
        let [b, c, d] = [1, 2, 3].map(|k| way[k].map(|x| x as f32));
        let rate = stretch.rate as f32;
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
        self.head(stretch, heading);
    }

    /// Whether the contact neither rests nor turns back: then there is nothing to do sample by sample.
    #[inline(always)]
    fn goes_on(&self, stretch: &Stretch, direction: [f32; 2]) -> bool {
        let (from, to) = (stretch.from, stretch.to.min(CELL));
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
    fn head(&mut self, stretch: &Stretch, heading: &mut Heading) {
        let range = stretch.from..stretch.to.min(CELL);
        let Some(first) = self.speed.get(range.start) else { return };
        if !heading.begun {
            let gate = if *first >= AT_REST { 1.0 } else { 0.0 };
            *heading = Heading { sign: 1.0, gate, begun: true, direction: [0.0; 2] };
        }
        if heading.gate == 1.0 && self.goes_on(stretch, heading.direction) {
            self.gate = [1.0; CELL];
            self.sign = [heading.sign; CELL];
            let last = range.end.saturating_sub(1).min(CELL - 1);
            heading.direction = [self.tx[last], self.ty[last]];
            return;
        }
        let step = (1.0 / (FADE * stretch.rate)) as f32;
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

impl Default for Moves {
    fn default() -> Self {
        Self::new()
    }
}

/// Raises all to a power; 0 stays 0, also to the power of 0.
#[inline(always)]
fn raise(x: &mut Cell, exponent: f32) {
    if exponent == 1.0 {
    } else if exponent == 0.5 {
        x.iter_mut().for_each(|x| *x = x.sqrt());
    } else if exponent == 0.0 {
        x.iter_mut().for_each(|x| *x = if *x > 0.0 { 1.0 } else { 0.0 });
    } else {
        x.iter_mut().for_each(|x| *x = power(*x, exponent));
    }
}

/// `x^a` for `x >= 0`, to 1e-6; 0 stays 0.
///
/// Made of sums and products alone: loops over it become vectors, and every machine gives the same bits.
#[inline(always)]
fn power(x: f32, a: f32) -> f32 {
    if x > f32::MIN_POSITIVE { exp2(a * log2(x)) } else { 0.0 }
}

/// Logarithm of a normal number above 0.
#[inline(always)]
pub(super) fn log2(x: f32) -> f32 {
    // The mantissa within a factor of sqrt 2 of 1.
    let bits = x.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (bits as i32) >> 23;
    let m = f32::from_bits((bits & 0x007f_ffff).wrapping_add(0x3f35_04f3));
    let t = (m - 1.0) / (m + 1.0);
    let s = t * t;
    // 2 / ln 2 times the series of the inverse hyperbolic tangent.
    let series = 2.885_39 + s * (0.961_796_7 + s * (0.577_078 + s * (0.412_198_6 + s * 0.320_598_9)));
    exponent as f32 + t * series
}

/// `2^y`, held within the range of single precision.
#[inline(always)]
fn exp2(y: f32) -> f32 {
    let y = y.clamp(-126.0, 126.0);
    let whole = (y + 0.5).floor();
    let f = y - whole;
    // Taylor's series; half a power of two to either side.
    let series = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5
                + f * (0.055_504_11 + f * (0.009_618_13 + f * (0.001_333_356 + f * 0.000_154_035)))));
    series * f32::from_bits(((whole as i32 + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::time::Rate;
    use crate::scrape::item::PathPiece;
    use crate::scrape::testing::piece;
    use crate::scrape::voices::Voices;

    #[test]
    fn powers_are_right_to_a_millionth() {
        for k in -40..40 {
            for a in [0.1, 0.37, 0.5, 1.0, 1.7, 2.0] {
                let x = 1.37_f64.powi(k);
                let error = f64::from(power(x as f32, a as f32)) / x.powf(a) - 1.0;
                assert!(error.abs() < 4e-6, "{x}^{a}: {error}");
            }
        }
        assert_eq!([power(0.0, 0.0), power(0.0, 0.5), power(1.0, 0.3)], [0.0, 0.0, 1.0]);
    }

    /// What `law` makes of ones over pieces of 0.1 s each.
    fn over(pieces: &[PathPiece], law: Law) -> Vec<f32> {
        let rate = Rate::hz(10_000);
        let mut voices = Voices::new(2, rate, Heading::default());
        let events: Vec<_> = (0..).map(|k| rate.tick(1000 * k)).zip(pieces.iter().copied()).collect();
        let mut out = vec![0.0; 1000 * pieces.len()];
        let mut moves = Moves::new();
        voices.play(
            &events,
            None,
            0,
            &mut out,
            |_| Heading::default(),
            |heading, stretch, out| {
                moves.follow(stretch, &stretch.way(), [1.0; 2], heading);
                let mut cell = [1.0; CELL];
                law.apply(stretch, &moves, [1.0; 2], &mut cell);
                out.iter_mut().zip(stretch.part(&mut cell)).for_each(|(out, x)| *out += *x);
            },
        );
        out
    }

    #[test]
    fn force_and_speed_enter_by_their_exponents() {
        let fast = PathPiece { force: [4.0; 2], ..piece([0.0; 2], [0.09, 0.0], 0.1) };
        let out = over(&[fast], Law::new([2.0, 0.5, 0.5], 10_000.0));
        assert!((out[500] - 2.0 * 2.0 * 0.3).abs() < 1e-5, "{}", out[500]);
        let mut law = Law::new([2.0, 1.0, 0.0], 10_000.0);
        assert!((over(&[fast], law)[500] - 8.0).abs() < 1e-5);
        law.go_to([1.0, 0.5, 0.0], 400);
        let out = over(&[fast], law);
        assert!((out[399] - 8.0).abs() < 1e-4 && (out[600] - 2.0).abs() < 1e-4);
        assert!(out.windows(2).all(|w| (w[1] - w[0]).abs() < 0.05), "no step");
    }

    #[test]
    fn rest_and_no_force_are_silent_after_five_milliseconds() {
        let go = piece([0.0; 2], [0.1, 0.0], 0.1);
        let rest = PathPiece { place: [go.place_at(1.0), [0.0; 2], [0.0; 2], [0.0; 2]], ..go };
        let out = over(&[go, rest], Law::new([1.0, 1.0, 0.0], 10_000.0));
        assert!((out[1024] - 0.5).abs() < 0.03 && out[1051..].iter().all(|x| *x == 0.0));
        let lifted = PathPiece { force: [0.0; 2], ..go };
        assert!(over(&[lifted], Law::new([1.0, 0.0, 0.0], 10_000.0)).iter().all(|x| *x == 0.0));
    }

    #[test]
    fn below_a_tenth_of_a_millimetre_a_second_the_last_direction_is_kept() {
        let go = piece([0.0; 2], [0.3, 0.4], 0.1);
        for (back, turned) in [(0.9e-4, false), (1.1e-4, true)] {
            let creep = piece(go.place_at(1.0), [-back, 0.0], 0.1);
            let rate = Rate::hz(10_000);
            let mut voices = Voices::new(2, rate, Heading::default());
            let (mut moves, mut seen) = (Moves::new(), Vec::new());
            voices.play(
                &[(0, go), (rate.tick(1000), creep)],
                None,
                0,
                &mut [0.0; 2000],
                |_| Heading::default(),
                |heading, stretch, _| {
                    moves.follow(stretch, &stretch.way(), [1.0; 2], heading);
                    let (x, y) = (stretch.part(&mut moves.tx).to_vec(), stretch.part(&mut moves.ty).to_vec());
                    seen.extend(x.into_iter().zip(y));
                },
            );
            let near = |(x, y): (f32, f32), right: (f32, f32)| (x - right.0).hypot(y - right.1) < 1e-4;
            assert!(near(seen[500], (0.6, 0.8)));
            assert!(
                near(seen[1500], if turned { (-1.0, 0.0) } else { (0.6, 0.8) }),
                "{back}: {:?}",
                seen[1500]
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
        let (mut signs, mut moves) = (Vec::new(), Moves::new());
        let all = circle.into_iter().chain([back]);
        let events: Vec<_> = (0..).map(|k| rate.tick(1000 * k)).zip(all).collect();
        voices.play(
            &events,
            None,
            0,
            &mut [0.0; 9000],
            |_| Heading::default(),
            |heading, stretch, _| {
                moves.follow(stretch, &stretch.way(), [1.0; 2], heading);
                signs.extend_from_slice(stretch.part(&mut moves.sign));
            },
        );
        assert!(signs[..8000].iter().all(|s| *s == 1.0) && signs[8000..].iter().all(|s| *s == -1.0));
    }
}
