//! Interpolation of speeds by the shape-preserving cubic (PCHIP), which does not overshoot below 0.
//!
//! Catmull-Rom tangents through 0, 0, 0, 1, 1, 1 reach -0.074 and 1.074. PCHIP stays between neighbouring samples.
//!
//! # Source
//! Fritsch and Butland 1984: slopes are weighted harmonic means of the neighbouring secants, as in SciPy and MATLAB. It is
//! not the algorithm of Fritsch and Carlson 1980.

/// Computes the slopes of the cubic at its knots.
///
/// # Shapes
/// `times`, strictly increasing, `values` and `slopes` have the same length; the shortest counts. One knot has slope 0.
///
/// # Complexity
/// O(n). Never allocates.
pub fn slopes(times: &[f64], values: &[f64], slopes: &mut [f64]) {
    let n = times.len().min(values.len()).min(slopes.len());
    let step = |k: usize| times[k + 1] - times[k];
    let secant = |k: usize| (values[k + 1] - values[k]) / step(k);
    match n {
        0 => {}
        1 => slopes[0] = 0.0,
        2 => slopes[..2].fill(secant(0)),
        _ => {
            slopes[0] = end_slope(step(0), step(1), secant(0), secant(1));
            for (k, slope) in slopes.iter_mut().enumerate().take(n - 1).skip(1) {
                *slope = inner_slope(step(k - 1), step(k), secant(k - 1), secant(k));
            }
            slopes[n - 1] = end_slope(step(n - 2), step(n - 3), secant(n - 2), secant(n - 3));
        }
    }
}

/// Returns the value of the cubic at time `t`: 0 before the first knot and after the last, and never below 0.
///
/// # Complexity
/// O(log n).
#[must_use]
pub fn evaluate(times: &[f64], values: &[f64], slopes: &[f64], t: f64) -> f64 {
    let n = times.len().min(values.len()).min(slopes.len());
    let times = &times[..n];
    let after = times.partition_point(|&knot| knot <= t);
    if after == 0 {
        return 0.0;
    }
    let k = after - 1;
    if after == n {
        return if t == times[k] { values[k].max(0.0) } else { 0.0 };
    }
    let h = times[k + 1] - times[k];
    let u = (t - times[k]) / h;
    hermite(u, values[k], h * slopes[k], values[k + 1], h * slopes[k + 1]).max(0.0)
}

#[inline]
fn hermite(u: f64, s0: f64, m0: f64, s1: f64, m1: f64) -> f64 {
    let v = 1.0 - u;
    // The four Hermite weights, with those of s0 and s1 combined, so that equal samples are reproduced exactly.
    s0 + u * u * (3.0 - 2.0 * u) * (s1 - s0) + u * v * (v * m0 - u * m1)
}

/// Slope at the knot between two segments of lengths `h0`, `h1` with secants `d0`, `d1`.
#[inline]
fn inner_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
    (w0 + w1) / (w0 / d0 + w1 / d1)
}

/// Slope at an end, from the segment there and the next one.
#[inline]
fn end_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    // Compared by sign, with 0 as a third sign, as in SciPy; products of tiny speeds would underflow.
    let sign = |x: f64| i32::from(x > 0.0) - i32::from(x < 0.0);
    if sign(slope) != sign(d0) {
        0.0
    } else if sign(d0) != sign(d1) && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

/// Existence of the two outer samples around a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OuterSamples {
    /// False if the segment is the first of the series.
    pub before: bool,
    /// False if the segment is the last of the series.
    pub after: bool,
}

/// Evaluates one segment of several series together, for equally spaced samples.
///
/// `samples` are those at k - 1, k, k + 1 and k + 2; `u` in 0 ..= 1 is the position between k and k + 1. The slice of an absent
/// sample may be empty. The result is that of [`slopes`] and [`evaluate`], with the spacing as the unit of time.
///
/// # Shapes
/// One series per element of `out`; the samples that exist have at least that many elements.
///
/// # Complexity
/// O(V). Never allocates.
pub fn eval_uniform(samples: [&[f32]; 4], outer: OuterSamples, u: f64, out: &mut [f32]) {
    let [before, start, end, after] = samples;
    let mut count = out.len().min(start.len()).min(end.len());
    if outer.before {
        count = count.min(before.len());
    }
    if outer.after {
        count = count.min(after.len());
    }
    for (v, out) in out.iter_mut().take(count).enumerate() {
        let (s0, s1) = (f64::from(start[v]), f64::from(end[v]));
        let d = s1 - s0;
        let d_before = if outer.before { s0 - f64::from(before[v]) } else { d };
        let d_after = if outer.after { f64::from(after[v]) - s1 } else { d };
        let m0 = match outer {
            OuterSamples { before: true, .. } => inner_slope(1.0, 1.0, d_before, d),
            OuterSamples { after: true, .. } => end_slope(1.0, 1.0, d, d_after),
            _ => d,
        };
        let m1 = match outer {
            OuterSamples { after: true, .. } => inner_slope(1.0, 1.0, d, d_after),
            OuterSamples { before: true, .. } => end_slope(1.0, 1.0, d, d_before),
            _ => d,
        };
        *out = hermite(u, s0, m0, s1, m1).max(0.0) as f32;
    }
}

/// Evaluates linear interpolation between two samples of several series, for live use.
///
/// # Complexity
/// O(V). Never allocates.
pub fn eval_linear(start: &[f32], end: &[f32], u: f32, out: &mut [f32]) {
    for ((out, &s0), &s1) in out.iter_mut().zip(start).zip(end) {
        *out = ((1.0 - u) * s0 + u * s1).max(0.0);
    }
}

#[cfg(test)]
mod tests;
