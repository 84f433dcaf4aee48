//! Animation channels: interpolation of values between keys.

use std::sync::Arc;

use ::gltf::animation::Interpolation;

/// One animated property of a node.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub(super) times: Arc<Vec<f32>>,
    pub(super) values: Arc<Vec<f32>>,
    pub(super) width: usize,
    pub(super) interpolation: Interpolation,
    /// True for rotations, which are interpolated spherically.
    pub(super) quaternion: bool,
}

impl Channel {
    /// Number of values that the keys of a channel need; `None` on overflow.
    pub(super) fn value_count(keys: usize, width: usize, interpolation: Interpolation) -> Option<usize> {
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        keys.checked_mul(width)?.checked_mul(per_key)
    }

    /// Writes the value at `time` into `out`, which has `width` numbers. Before the first key and after the last the value
    /// is constant.
    ///
    /// # Source
    /// glTF 2.0 specification, appendix C (interpolation modes).
    pub(super) fn evaluate(&self, time: f64, out: &mut [f64]) {
        let keys = &self.times;
        // The last key that is not after the time; 1 ns allows for rounding in sums of frame times.
        let a = keys.partition_point(|&t| f64::from(t) <= time + 1e-9).saturating_sub(1);
        let b = (a + 1).min(keys.len() - 1);
        let (t0, t1) = (f64::from(keys[a]), f64::from(keys[b]));
        let step = t1 - t0;
        let fraction = if step > 0.0 { ((time - t0) / step).clamp(0.0, 1.0) } else { 0.0 };
        match self.interpolation {
            Interpolation::Step => self.key(a, 1, 0).zip(out).for_each(|(v, o)| *o = v),
            Interpolation::Linear if self.quaternion => {
                let (mut p, mut q) = ([0.0; 4], [0.0; 4]);
                p.iter_mut().zip(self.key(a, 1, 0)).for_each(|(x, v)| *x = v);
                q.iter_mut().zip(self.key(b, 1, 0)).for_each(|(x, v)| *x = v);
                out.iter_mut().zip(slerp(p, q, fraction)).for_each(|(o, v)| *o = v);
            }
            Interpolation::Linear => {
                let pairs = self.key(a, 1, 0).zip(self.key(b, 1, 0));
                pairs.zip(out).for_each(|((p, q), o)| *o = p + (q - p) * fraction);
            }
            Interpolation::CubicSpline => {
                let (s, s2, s3) = (fraction, fraction * fraction, fraction * fraction * fraction);
                let points = self.key(a, 3, 1).zip(self.key(b, 3, 1));
                let tangents = self.key(a, 3, 2).zip(self.key(b, 3, 0));
                for (((p, q), (out_tangent, in_tangent)), o) in points.zip(tangents).zip(out) {
                    *o = (2.0 * s3 - 3.0 * s2 + 1.0) * p
                        + step * (s3 - 2.0 * s2 + s) * out_tangent
                        + (3.0 * s2 - 2.0 * s3) * q
                        + step * (s3 - s2) * in_tangent;
                }
            }
        }
    }

    /// Part `part` of the `parts` of a key; a cubic spline has in-tangent, value and out-tangent.
    fn key(&self, key: usize, parts: usize, part: usize) -> impl Iterator<Item = f64> + '_ {
        let start = (key * parts + part) * self.width;
        self.values[start..start + self.width].iter().map(|&v| f64::from(v))
    }
}

/// Spherical linear interpolation between two unit quaternions along the shorter arc.
fn slerp(p: [f64; 4], q: [f64; 4], fraction: f64) -> [f64; 4] {
    let dot: f64 = p.iter().zip(&q).map(|(a, b)| a * b).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let angle = libm::acos(dot.abs().min(1.0));
    let sine = libm::sin(angle);
    let (u, v) = if sine > 1e-9 {
        (libm::sin((1.0 - fraction) * angle) / sine, sign * libm::sin(fraction * angle) / sine)
    } else {
        (1.0 - fraction, sign * fraction)
    };
    std::array::from_fn(|k| u * p[k] + v * q[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(times: &[f32], values: &[f32], width: usize, interpolation: Interpolation) -> Channel {
        Channel {
            times: Arc::new(times.to_vec()),
            values: Arc::new(values.to_vec()),
            width,
            interpolation,
            quaternion: width == 4,
        }
    }

    #[test]
    fn step_channels_are_constant_and_linear_channels_interpolate() {
        let mut out = [0.0; 2];
        let step = channel(&[0.0, 1.0], &[1.0, 2.0, 3.0, 6.0], 2, Interpolation::Step);
        step.evaluate(0.999, &mut out);
        assert_eq!(out, [1.0, 2.0]);
        step.evaluate(1.0, &mut out);
        assert_eq!(out, [3.0, 6.0]);
        let linear = channel(&[0.0, 1.0], &[1.0, 2.0, 3.0, 6.0], 2, Interpolation::Linear);
        linear.evaluate(0.25, &mut out);
        assert_eq!(out, [1.5, 3.0]);
        linear.evaluate(9.0, &mut out);
        assert_eq!(out, [3.0, 6.0]);
        linear.evaluate(-9.0, &mut out);
        assert_eq!(out, [1.0, 2.0]);
    }

    #[test]
    fn a_cubic_spline_reproduces_a_parabola() {
        // y = t^2 at keys 1 and 3: tangents 2 and 6.
        let spline = channel(&[1.0, 3.0], &[0.0, 1.0, 2.0, 6.0, 9.0, 0.0], 1, Interpolation::CubicSpline);
        for t in [1.0, 1.5, 2.0, 2.75, 3.0] {
            let mut out = [0.0];
            spline.evaluate(t, &mut out);
            assert!((out[0] - t * t).abs() < 1e-12, "{t} {}", out[0]);
        }
    }

    #[test]
    fn a_rotation_follows_the_shorter_arc_at_constant_speed() {
        let h = std::f32::consts::FRAC_1_SQRT_2;
        let rotation =
            channel(&[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -h, -h], 4, Interpolation::Linear);
        let mut out = [0.0; 4];
        rotation.evaluate(1.0 / 3.0, &mut out);
        let angle = 2.0 * out[2].atan2(out[3]);
        assert!((angle - std::f64::consts::FRAC_PI_6).abs() < 1e-6, "{angle}");
    }
}
