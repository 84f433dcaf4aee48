//! Animation channels: values between keys.

use std::sync::Arc;

use ::gltf::animation::Interpolation;

/// One animated value of a node.
#[derive(Clone, Debug)]
pub(super) struct Track {
    pub(super) times: Arc<Vec<f32>>,
    pub(super) values: Arc<Vec<f32>>,
    pub(super) width: usize,
    pub(super) interpolation: Interpolation,
    /// Rotations go along the great circle.
    pub(super) quaternion: bool,
}

impl Track {
    /// Values that the channel needs for its keys.
    pub(super) fn needed(keys: usize, width: usize, interpolation: Interpolation) -> Option<usize> {
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        keys.checked_mul(width)?.checked_mul(per_key)
    }

    /// Writes the value at `time` into `out`, which has `width` numbers; the ends are held.
    ///
    /// # Source
    /// glTF 2.0 specification, appendix C (interpolation modes).
    pub(super) fn at(&self, time: f64, out: &mut [f64]) {
        let keys = &self.times;
        // The last key not after the time, a nanosecond allowed for sums of frame times.
        let a = keys.partition_point(|&t| f64::from(t) <= time + 1e-9).saturating_sub(1);
        let b = (a + 1).min(keys.len() - 1);
        let (t0, t1) = (f64::from(keys[a]), f64::from(keys[b]));
        let step = t1 - t0;
        let way = if step > 0.0 { ((time - t0) / step).clamp(0.0, 1.0) } else { 0.0 };
        match self.interpolation {
            Interpolation::Step => self.key(a, 1, 0).zip(out).for_each(|(v, o)| *o = v),
            Interpolation::Linear if self.quaternion => {
                let (mut p, mut q) = ([0.0; 4], [0.0; 4]);
                p.iter_mut().zip(self.key(a, 1, 0)).for_each(|(x, v)| *x = v);
                q.iter_mut().zip(self.key(b, 1, 0)).for_each(|(x, v)| *x = v);
                out.iter_mut().zip(slerp(p, q, way)).for_each(|(o, v)| *o = v);
            }
            Interpolation::Linear => {
                let pairs = self.key(a, 1, 0).zip(self.key(b, 1, 0));
                pairs.zip(out).for_each(|((p, q), o)| *o = p + (q - p) * way);
            }
            Interpolation::CubicSpline => {
                let (s, s2, s3) = (way, way * way, way * way * way);
                let points = self.key(a, 3, 1).zip(self.key(b, 3, 1));
                let tangents = self.key(a, 3, 2).zip(self.key(b, 3, 0));
                for (((p, q), (leave, arrive)), o) in points.zip(tangents).zip(out) {
                    *o = (2.0 * s3 - 3.0 * s2 + 1.0) * p
                        + step * (s3 - 2.0 * s2 + s) * leave
                        + (3.0 * s2 - 2.0 * s3) * q
                        + step * (s3 - s2) * arrive;
                }
            }
        }
    }

    /// Part `part` of the `parts` (tangent in, value, tangent out) of a key.
    fn key(&self, key: usize, parts: usize, part: usize) -> impl Iterator<Item = f64> + '_ {
        let start = (key * parts + part) * self.width;
        self.values[start..start + self.width].iter().map(|&v| f64::from(v))
    }
}

/// The rotation between two unit quaternions, the shorter way.
fn slerp(p: [f64; 4], q: [f64; 4], way: f64) -> [f64; 4] {
    let dot: f64 = p.iter().zip(&q).map(|(a, b)| a * b).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let angle = libm::acos(dot.abs().min(1.0));
    let sine = libm::sin(angle);
    let (u, v) = if sine > 1e-9 {
        (libm::sin((1.0 - way) * angle) / sine, sign * libm::sin(way * angle) / sine)
    } else {
        (1.0 - way, sign * way)
    };
    std::array::from_fn(|k| u * p[k] + v * q[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(times: &[f32], values: &[f32], width: usize, interpolation: Interpolation) -> Track {
        Track {
            times: Arc::new(times.to_vec()),
            values: Arc::new(values.to_vec()),
            width,
            interpolation,
            quaternion: width == 4,
        }
    }

    #[test]
    fn a_step_holds_and_a_line_blends() {
        let mut out = [0.0; 2];
        let step = track(&[0.0, 1.0], &[1.0, 2.0, 3.0, 6.0], 2, Interpolation::Step);
        step.at(0.999, &mut out);
        assert_eq!(out, [1.0, 2.0]);
        step.at(1.0, &mut out);
        assert_eq!(out, [3.0, 6.0]);
        let line = track(&[0.0, 1.0], &[1.0, 2.0, 3.0, 6.0], 2, Interpolation::Linear);
        line.at(0.25, &mut out);
        assert_eq!(out, [1.5, 3.0]);
        line.at(9.0, &mut out);
        assert_eq!(out, [3.0, 6.0]);
        line.at(-9.0, &mut out);
        assert_eq!(out, [1.0, 2.0]);
    }

    #[test]
    fn a_cubic_spline_reproduces_a_parabola() {
        // y = t^2 at keys 1 and 3: tangents 2 and 6.
        let spline = track(&[1.0, 3.0], &[0.0, 1.0, 2.0, 6.0, 9.0, 0.0], 1, Interpolation::CubicSpline);
        for t in [1.0, 1.5, 2.0, 2.75, 3.0] {
            let mut out = [0.0];
            spline.at(t, &mut out);
            assert!((out[0] - t * t).abs() < 1e-12, "{t} {}", out[0]);
        }
    }

    #[test]
    fn a_rotation_goes_the_shorter_way_at_even_speed() {
        let h = std::f32::consts::FRAC_1_SQRT_2;
        let turn = track(&[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -h, -h], 4, Interpolation::Linear);
        let mut out = [0.0; 4];
        turn.at(1.0 / 3.0, &mut out);
        let angle = 2.0 * out[2].atan2(out[3]);
        assert!((angle - std::f64::consts::FRAC_PI_6).abs() < 1e-6, "{angle}");
    }
}
