//! Isophotes in few bytes.
//!
//! Points are whole 64ths of a pixel. They lie where a curve enters a pixel, so that one coordinate is whole: each is told by the step
//! from the pixel of the one before, which goes on about half as far as the last step did, and by its place on the side of its
//! pixel. Gradients are told by their size in
//! ninths of an octave, and by how far they turn, in 128ths of a turn, from the direction across the curve; they come back to
//! 5 % each, 3 % on the mean. All these numbers are small, and are written in the bits that numbers of their kind have needed so far.

use super::curves::{Curve, Isophotes, STEPS};
use super::rice::{Reader, Rice, Writer};
use crate::texture::grid::Wrap;
use crate::texture::maps::Surface;
use std::f64::consts::TAU;

/// First bytes of a file.
const MAGIC: &[u8; 4] = b"fISO";
const VERSION: u8 = 3;
/// Bits of a place within a pixel: as many as [`STEPS`] has.
const PLACE: u32 = 6;
/// Parts of an octave and of a turn.
const OCTAVE: f64 = 9.0;
const TURN: f64 = 128.0;
/// Parts of an octave in files of version 2, which are read as well.
const COARSE: f64 = 8.0;
/// Octaves of a gradient's size from which down it is 0.
const FLAT: f64 = -20.0;
/// Most pixels along a side, and of an image, of a file that is read.
const MOST: u64 = 1 << 27;
const MOST_PIXELS: u64 = 1 << 28;
/// Longest step from one point to the next along an axis, px: curves are simplified 256 points at a time.
const LONGEST: u64 = 512;

/// One code for each kind of number.
struct Codes {
    start: [Rice; 2],
    step: [Rice; 2],
    turns: Rice,
    count: Rice,
    level: Rice,
    size: Rice,
    angle: Rice,
}

impl Codes {
    fn new() -> Self {
        let rice = Rice::new;
        Self {
            start: [rice(), rice()],
            step: [rice(), rice()],
            turns: rice(),
            count: rice(),
            level: rice(),
            size: rice(),
            angle: rice(),
        }
    }
}

/// The pixel of a point, and the place in it.
fn split(point: [i64; 2]) -> ([i64; 2], [i64; 2]) {
    (point.map(|x| x >> PLACE), point.map(|x| x & ((1 << PLACE) - 1)))
}

/// How far a curve probably goes on along an axis, after a step.
fn onward(step: i64) -> i64 {
    (step + 1) >> 1
}

/// Whether all points of a curve but the first have a whole coordinate.
fn on_sides(points: &[[i64; 2]]) -> bool {
    points.iter().skip(1).all(|p| split(*p).1.contains(&0))
}

/// The direction across a curve at point `k`, to its high side, in turns.
fn across(points: &[[i64; 2]], closed: bool, k: usize) -> f64 {
    let last = points.len() - 1;
    let step = |a: usize, b: usize| [0, 1].map(|i| points[b][i] - points[a][i]);
    let along = match k {
        // A closed curve goes on through the point that is both its first and its last.
        k if closed && (k == 0 || k == last) => {
            let (a, b) = (step(last - 1, last), step(0, 1));
            [a[0] + b[0], a[1] + b[1]]
        }
        k => step(k.saturating_sub(1), (k + 1).min(last)),
    };
    libm::atan2(-along[0] as f64, along[1] as f64) / TAU
}

/// Size and turn of a gradient as whole numbers.
fn code_gradient(g: [f32; 2], across: f64) -> [i64; 2] {
    let [x, y] = g.map(f64::from);
    let size = (OCTAVE * x.hypot(y).log2()).round().clamp(OCTAVE * FLAT, 1000.0) as i64;
    let turn = libm::atan2(y, x) / TAU - across;
    let turn = if size as f64 > OCTAVE * FLAT { (turn - turn.round()) * TURN } else { 0.0 };
    [size, turn.round() as i64]
}

fn decode_gradient([size, turn]: [i64; 2], across: f64, octave: f64) -> [f32; 2] {
    if size as f64 <= octave * FLAT {
        return [0.0; 2];
    }
    let size = (size.min(1000) as f64 / octave).exp2();
    let angle = TAU * (across + turn as f64 / TURN);
    [(size * libm::cos(angle)) as f32, (size * libm::sin(angle)) as f32]
}

fn whole(points: &[[f32; 2]]) -> Vec<[i64; 2]> {
    points.iter().map(|p| p.map(|x| (f64::from(x) * STEPS).round() as i64)).collect()
}

/// Writes isophotes as bytes: about two and a half for each point.
///
/// Points come back exactly where curves were simplified, and to 1/128 of a pixel otherwise.
#[must_use]
pub fn encode_isophotes(all: &Isophotes) -> Vec<u8> {
    let mut out = Writer::new(MAGIC);
    out.bits(VERSION.into(), 8);
    for number in [all.width, all.height, all.levels.len(), all.curves.len(), all.points.len()] {
        out.bits(number as u64 & 0xFFFF_FFFF, 32);
    }
    let Surface { density, depth, wrap } = all.surface;
    for number in [density[0], density[1], depth] {
        let bits = number.to_bits();
        out.bits(bits & 0xFFFF_FFFF, 32);
        out.bits(bits >> 32, 32);
    }
    out.bits(wrap as u64, 8);
    for level in &all.levels {
        out.bits(level.to_bits().into(), 32);
    }
    let (mut codes, mut start, mut level) = (Codes::new(), [0; 2], 0);
    for (curve, points, gradients) in all.iter() {
        let points = whole(points);
        let (Some(first), Some(last)) = (points.first(), points.last()) else { continue };
        codes.level.write(&mut out, i64::from(curve.level) - level);
        codes.count.write(&mut out, points.len() as i64);
        out.bits(curve.closed.into(), 1);
        for axis in 0..2 {
            codes.start[axis].write(&mut out, first[axis] - start[axis]);
        }
        // The last point of a closed curve follows from the first.
        let told = points.len() - usize::from(curve.closed);
        if curve.closed {
            let turns = turns_between(*first, *last, all);
            turns.iter().for_each(|turns| codes.turns.write(&mut out, *turns));
        }
        let points_told = points.get(..told).unwrap_or_default();
        let sides = on_sides(points_told);
        out.bits(sides.into(), 1);
        let mut step = [0; 2];
        for pair in points_told.windows(2) {
            let ((from, _), (to, place)) = (split(pair[0]), split(pair[1]));
            for (axis, code) in codes.step.iter_mut().enumerate() {
                let next = to[axis] - from[axis];
                code.write(&mut out, next - onward(step[axis]));
                step[axis] = next;
            }
            let whole = sides && place[0] == 0;
            if sides {
                out.bits(whole.into(), 1);
            }
            if !whole {
                out.bits(place[0] as u64, PLACE);
            }
            if whole || !sides {
                out.bits(place[1] as u64, PLACE);
            }
        }
        let mut before = 0;
        for (k, gradient) in gradients.iter().take(told).enumerate() {
            let [size, turn] = code_gradient(*gradient, across(&points, curve.closed, k));
            codes.size.write(&mut out, size - before);
            codes.angle.write(&mut out, turn);
            before = size;
        }
        (start, level) = (*first, curve.level.into());
    }
    out.finish()
}

/// Whole turns around a repeated image from one point to another.
fn turns_between(first: [i64; 2], last: [i64; 2], all: &Isophotes) -> [i64; 2] {
    let size = [all.width, all.height].map(|n| n.max(1) as f64 * STEPS);
    [0, 1].map(|i| ((last[i] - first[i]) as f64 / size[i]).round() as i64)
}

/// Reads isophotes from bytes.
///
/// # Errors
/// Says what is wrong with them.
pub fn decode_isophotes(bytes: &[u8]) -> Result<Isophotes, String> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("these are no isophotes: they do not begin with `fISO`")?;
    let mut from = Reader::new(rest);
    let version = from.bits(8).ok_or("it ends in its first bytes")?;
    let octave = match version {
        2 => COARSE,
        version if version == u64::from(VERSION) => OCTAVE,
        _ => return Err(format!("version {version}; this foley reads versions 2 and {VERSION}")),
    };
    let head = read_head(&mut from).ok_or("it ends in its head, or says sizes that cannot be")?;
    let (curves, points) = (head.curves.len(), head.points.len());
    read_curves(&mut from, head, octave).ok_or_else(|| {
        format!("it is damaged: no {curves} curves of {points} points in {} bytes", bytes.len())
    })
}

/// Everything before the curves; these are there in number only.
fn read_head(from: &mut Reader<'_>) -> Option<Isophotes> {
    let mut numbers = [0; 5];
    for number in &mut numbers {
        *number = from.bits(32)?;
    }
    let mut floats = [0.0; 3];
    for float in &mut floats {
        *float = f64::from_bits(from.bits(32)? | from.bits(32)? << 32);
    }
    let wrap = match from.bits(8)? {
        0 => Wrap::Repeat,
        1 => Wrap::Mirror,
        2 => Wrap::Clamp,
        _ => return None,
    };
    let [width, height, levels, curves, points] = numbers;
    // A point takes four bits at least, so that no number is believed before its bytes are there.
    let left = 2 * from.remaining() as u64;
    let sound = width.max(height) < MOST
        && width * height <= MOST_PIXELS
        && levels <= 65_535
        && curves <= points
        && points <= left;
    if !sound || !floats.iter().all(|x| x.is_finite() && *x > 0.0) {
        return None;
    }
    let level = |_| from.bits(32).map(|bits| f32::from_bits(bits as u32)).filter(|level| level.is_finite());
    let levels = (0..levels).map(level).collect::<Option<_>>()?;
    Some(Isophotes {
        width: width as usize,
        height: height as usize,
        surface: Surface { density: [floats[0], floats[1]], depth: floats[2], wrap },
        levels,
        curves: vec![Curve { level: 0, closed: false, len: 0 }; curves as usize],
        points: vec![[0.0; 2]; points as usize],
        gradients: Vec::with_capacity(points as usize),
    })
}

/// The point after one, by the step from pixel to pixel and the place in the new one.
fn next(last: [i64; 2], step: [i64; 2], place: [u64; 2]) -> Option<[i64; 2]> {
    let (pixel, _) = split(last);
    let mut next = last;
    for (axis, x) in next.iter_mut().enumerate() {
        let step = Some(step[axis]).filter(|step| step.unsigned_abs() <= LONGEST)?;
        *x = ((pixel[axis] + step) << PLACE) + place[axis] as i64;
        Some(*x).filter(|x| x.unsigned_abs() < MOST * 64)?;
    }
    Some(next)
}

fn read_curves(from: &mut Reader<'_>, mut all: Isophotes, octave: f64) -> Option<Isophotes> {
    let (count, size) = (all.points.len(), [all.width, all.height].map(|n| n as i64 * STEPS as i64));
    all.points.clear();
    let (mut codes, mut start, mut level) = (Codes::new(), [0_i64; 2], 0_i64);
    let mut points: Vec<[i64; 2]> = Vec::new();
    for k in 0..all.curves.len() {
        level += codes.level.read(from)?;
        let len = codes.count.read(from).filter(|n| (1..=(count - all.points.len()) as i64).contains(n))?;
        let closed = from.bits(1)? == 1;
        if closed && len < 2 {
            return None;
        }
        for (code, x) in codes.start.iter_mut().zip(&mut start) {
            *x = x.checked_add(code.read(from)?).filter(|x| x.unsigned_abs() < MOST * 64)?;
        }
        let mut end = start;
        if closed {
            for (x, size) in end.iter_mut().zip(size) {
                *x += codes.turns.read(from).filter(|n| n.unsigned_abs() < MOST)? * size;
            }
        }
        points.clear();
        points.push(start);
        let told = len as usize - usize::from(closed);
        let sides = from.bits(1)? == 1;
        let mut step = [0; 2];
        for _ in 1..told {
            let last = *points.last()?;
            for (code, step) in codes.step.iter_mut().zip(&mut step) {
                *step = code.read(from)?.checked_add(onward(*step))?;
            }
            let whole = sides && from.bits(1)? == 1;
            let place = [
                if whole { 0 } else { from.bits(PLACE)? },
                if sides && !whole { 0 } else { from.bits(PLACE)? },
            ];
            points.push(next(last, step, place)?);
        }
        if closed {
            points.push(end);
        }
        let (mut before, first) = (0_i64, all.gradients.len());
        for k in 0..told {
            before = before.checked_add(codes.size.read(from)?)?;
            let turn = codes.angle.read(from)?;
            all.gradients.push(decode_gradient([before, turn], across(&points, closed, k), octave));
        }
        if closed {
            all.gradients.push(*all.gradients.get(first)?);
        }
        all.points.extend(points.iter().map(|p| p.map(|x| (x as f64 / STEPS) as f32)));
        let level = u16::try_from(level).ok().filter(|l| usize::from(*l) < all.levels.len())?;
        all.curves[k] = Curve { level, closed, len: points.len() as u32 };
    }
    (all.points.len() == count).then_some(all)
}

#[cfg(test)]
mod tests;
