//! Compact coding of isophotes.
//!
//! Points are quantised to 1/64 pixel. A point lies where a curve enters a pixel, so that one coordinate is an integer. It is coded by
//! the step from the pixel of the previous point, predicted as half of the last step, and by its position on the side of the pixel.
//! A gradient is coded by its magnitude in ninths of an octave, and by its angle to the normal of the curve in 1/128 of a full turn;
//! its error is at most 5 %, 3 % on average. Each kind of number has an adaptive Rice code.

use super::curves::{Curve, Isophotes, STEPS};
use super::rice::{Reader, Rice, Writer};
use crate::texture::grid::Wrap;
use crate::texture::maps::Surface;
use std::f64::consts::TAU;

/// First bytes of a file.
const MAGIC: &[u8; 4] = b"fISO";
const VERSION: u8 = 3;
/// Bits of a position within a pixel: the binary logarithm of [`STEPS`].
const FRACTION_BITS: u32 = 6;
/// Quantisation steps of the magnitude per octave.
const OCTAVE_STEPS: f64 = 9.0;
/// Quantisation steps of the magnitude per octave in files of version 2.
const OCTAVE_STEPS_2: f64 = 8.0;
/// Quantisation steps of the angle per full turn.
const TURN_STEPS: f64 = 128.0;
/// Binary logarithm of the magnitude at and below which a gradient is 0.
const MIN_OCTAVE: f64 = -20.0;
/// Maximum side of an image, in pixels.
const MAX_SIDE: u64 = 1 << 27;
/// Maximum number of pixels of an image.
const MAX_PIXELS: u64 = 1 << 28;
/// Maximum step between points along an axis, in pixels: curves are simplified 256 points at a time.
const MAX_STEP: u64 = 512;

/// One code for each kind of number.
struct Codes {
    start: [Rice; 2],
    step: [Rice; 2],
    periods: Rice,
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
            periods: rice(),
            count: rice(),
            level: rice(),
            size: rice(),
            angle: rice(),
        }
    }
}

/// Splits a point into its pixel and the position within it.
fn split(point: [i64; 2]) -> ([i64; 2], [i64; 2]) {
    (point.map(|x| x >> FRACTION_BITS), point.map(|x| x & ((1 << FRACTION_BITS) - 1)))
}

/// Predicts the next step along an axis from the last one.
fn predicted(step: i64) -> i64 {
    (step + 1) >> 1
}

/// Returns true if all points of a curve after the first have an integer coordinate.
fn on_sides(points: &[[i64; 2]]) -> bool {
    points.iter().skip(1).all(|p| split(*p).1.contains(&0))
}

/// Angle of the normal of a curve at point `k`, to its high side, in turns.
fn normal(points: &[[i64; 2]], closed: bool, k: usize) -> f64 {
    let last = points.len() - 1;
    let step = |a: usize, b: usize| [0, 1].map(|i| points[b][i] - points[a][i]);
    let along = match k {
        // The first and the last point of a closed curve are the same.
        k if closed && (k == 0 || k == last) => {
            let (a, b) = (step(last - 1, last), step(0, 1));
            [a[0] + b[0], a[1] + b[1]]
        }
        k => step(k.saturating_sub(1), (k + 1).min(last)),
    };
    libm::atan2(-along[0] as f64, along[1] as f64) / TAU
}

/// Quantises a gradient to magnitude and angle relative to the normal.
fn code_gradient(g: [f32; 2], normal: f64) -> [i64; 2] {
    let [x, y] = g.map(f64::from);
    let size = (OCTAVE_STEPS * x.hypot(y).log2()).round().clamp(OCTAVE_STEPS * MIN_OCTAVE, 1000.0) as i64;
    let turn = libm::atan2(y, x) / TAU - normal;
    let turn = if size as f64 > OCTAVE_STEPS * MIN_OCTAVE { (turn - turn.round()) * TURN_STEPS } else { 0.0 };
    [size, turn.round() as i64]
}

fn decode_gradient([size, turn]: [i64; 2], normal: f64, octave_steps: f64) -> [f32; 2] {
    if size as f64 <= octave_steps * MIN_OCTAVE {
        return [0.0; 2];
    }
    let size = (size.min(1000) as f64 / octave_steps).exp2();
    let angle = TAU * (normal + turn as f64 / TURN_STEPS);
    [(size * libm::cos(angle)) as f32, (size * libm::sin(angle)) as f32]
}

/// Points in steps of 1/64 pixel.
fn quantised(points: &[[f32; 2]]) -> Vec<[i64; 2]> {
    points.iter().map(|p| p.map(|x| (f64::from(x) * STEPS).round() as i64)).collect()
}

/// Writes isophotes as bytes, about 2.5 per point.
///
/// Points of simplified curves are coded exactly, others with an error of at most 1/128 pixel.
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
        let points = quantised(points);
        let (Some(first), Some(last)) = (points.first(), points.last()) else { continue };
        codes.level.write(&mut out, i64::from(curve.level) - level);
        codes.count.write(&mut out, points.len() as i64);
        out.bits(curve.closed.into(), 1);
        for axis in 0..2 {
            codes.start[axis].write(&mut out, first[axis] - start[axis]);
        }
        // The last point of a closed curve follows from the first.
        let coded = points.len() - usize::from(curve.closed);
        if curve.closed {
            let periods = periods_between(*first, *last, all);
            periods.iter().for_each(|periods| codes.periods.write(&mut out, *periods));
        }
        let coded_points = points.get(..coded).unwrap_or_default();
        let sides = on_sides(coded_points);
        out.bits(sides.into(), 1);
        let mut step = [0; 2];
        for pair in coded_points.windows(2) {
            let ((from, _), (to, fraction)) = (split(pair[0]), split(pair[1]));
            for (axis, code) in codes.step.iter_mut().enumerate() {
                let next = to[axis] - from[axis];
                code.write(&mut out, next - predicted(step[axis]));
                step[axis] = next;
            }
            let integer_x = sides && fraction[0] == 0;
            if sides {
                out.bits(integer_x.into(), 1);
            }
            if !integer_x {
                out.bits(fraction[0] as u64, FRACTION_BITS);
            }
            if integer_x || !sides {
                out.bits(fraction[1] as u64, FRACTION_BITS);
            }
        }
        let mut previous = 0;
        for (k, gradient) in gradients.iter().take(coded).enumerate() {
            let [size, turn] = code_gradient(*gradient, normal(&points, curve.closed, k));
            codes.size.write(&mut out, size - previous);
            codes.angle.write(&mut out, turn);
            previous = size;
        }
        (start, level) = (*first, curve.level.into());
    }
    out.finish()
}

/// Number of periods of the image from one point to another.
fn periods_between(first: [i64; 2], last: [i64; 2], all: &Isophotes) -> [i64; 2] {
    let size = [all.width, all.height].map(|n| n.max(1) as f64 * STEPS);
    [0, 1].map(|i| ((last[i] - first[i]) as f64 / size[i]).round() as i64)
}

/// Reads isophotes from bytes, also of version 2.
///
/// # Errors
/// A message with the defect.
pub fn decode_isophotes(bytes: &[u8]) -> Result<Isophotes, String> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("these are not isophotes: they do not begin with `fISO`")?;
    let mut from = Reader::new(rest);
    let version = from.bits(8).ok_or("it ends in its first bytes")?;
    let octave_steps = match version {
        2 => OCTAVE_STEPS_2,
        version if version == u64::from(VERSION) => OCTAVE_STEPS,
        _ => return Err(format!("version {version}; this foley reads versions 2 and {VERSION}")),
    };
    let header = read_header(&mut from).ok_or("it ends in its header, or has impossible sizes")?;
    let (curves, points) = (header.curves.len(), header.points.len());
    read_curves(&mut from, header, octave_steps).ok_or_else(|| {
        format!("it is damaged: {} bytes do not hold {curves} curves of {points} points", bytes.len())
    })
}

/// Reads everything before the curves, and makes curves and points of the right number.
fn read_header(from: &mut Reader<'_>) -> Option<Isophotes> {
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
    // A point takes at least four bits, which bounds the allocation by the size of the file.
    let max_points = 2 * from.remaining() as u64;
    let plausible = width.max(height) < MAX_SIDE
        && width * height <= MAX_PIXELS
        && levels <= 65_535
        && curves <= points
        && points <= max_points;
    if !plausible || !floats.iter().all(|x| x.is_finite() && *x > 0.0) {
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

/// The next point, by the step from pixel to pixel and the position in the new pixel.
fn next(last: [i64; 2], step: [i64; 2], fraction: [u64; 2]) -> Option<[i64; 2]> {
    let (pixel, _) = split(last);
    let mut next = last;
    for (axis, x) in next.iter_mut().enumerate() {
        let step = Some(step[axis]).filter(|step| step.unsigned_abs() <= MAX_STEP)?;
        *x = ((pixel[axis] + step) << FRACTION_BITS) + fraction[axis] as i64;
        Some(*x).filter(|x| x.unsigned_abs() < MAX_SIDE * 64)?;
    }
    Some(next)
}

fn read_curves(from: &mut Reader<'_>, mut all: Isophotes, octave_steps: f64) -> Option<Isophotes> {
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
            *x = x.checked_add(code.read(from)?).filter(|x| x.unsigned_abs() < MAX_SIDE * 64)?;
        }
        let mut end = start;
        if closed {
            for (x, size) in end.iter_mut().zip(size) {
                *x += codes.periods.read(from).filter(|n| n.unsigned_abs() < MAX_SIDE)? * size;
            }
        }
        points.clear();
        points.push(start);
        let coded = len as usize - usize::from(closed);
        let sides = from.bits(1)? == 1;
        let mut step = [0; 2];
        for _ in 1..coded {
            let last = *points.last()?;
            for (code, step) in codes.step.iter_mut().zip(&mut step) {
                *step = code.read(from)?.checked_add(predicted(*step))?;
            }
            let integer_x = sides && from.bits(1)? == 1;
            let fraction = [
                if integer_x { 0 } else { from.bits(FRACTION_BITS)? },
                if sides && !integer_x { 0 } else { from.bits(FRACTION_BITS)? },
            ];
            points.push(next(last, step, fraction)?);
        }
        if closed {
            points.push(end);
        }
        let (mut size, first) = (0_i64, all.gradients.len());
        for k in 0..coded {
            size = size.checked_add(codes.size.read(from)?)?;
            let turn = codes.angle.read(from)?;
            all.gradients.push(decode_gradient([size, turn], normal(&points, closed, k), octave_steps));
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
