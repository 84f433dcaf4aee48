//! Approximate lag of cloth behind the skinned mesh that it follows.

use crate::contact::vector::{Vec3, add, cross, dot, norm, scale, sub, widen};
use crate::impl_state;

/// A damped spring between each skinned vertex of a garment and the cloth there.
///
/// With x the skinned position and y the cloth, `y'' = w^2 (x - y) + 2 d w (x' - y')`. The lag `y - x` oscillates freely while the
/// skin moves at constant velocity; a change of the skin's velocity changes the velocity of the lag. Both are exact for positions
/// that move linearly from frame to frame, so it is stable at any frame rate.
#[derive(Clone, Debug)]
pub struct Lag {
    /// Transition of (lag, velocity) over one frame: lag from lag, lag from velocity, velocity from lag, velocity from velocity.
    transition: [f64; 4],
    dt: f64,
    lags: Vec<Vec3>,
    /// Velocities of the lags, m/s.
    velocities: Vec<Vec3>,
    /// Velocities of the skin in the previous frame, m/s.
    skin_velocities: Vec<Vec3>,
    /// Positions of the skin in the previous frame.
    previous: Vec<[f32; 3]>,
    frames: u64,
}
impl_state!(Lag { lags, velocities, skin_velocities, previous, frames });

impl Lag {
    /// A lag at rest, for `vertices` at `rate` frames per second; `frequency` in Hz, `damping` less than 1.
    #[must_use]
    pub fn new(vertices: usize, rate: f64, frequency: f64, damping: f64) -> Self {
        let (dt, w) = (1.0 / rate, std::f64::consts::TAU * frequency);
        let damped_w = w * (1.0 - damping * damping).max(1e-12).sqrt();
        let (decay, sin, cos) =
            (libm::exp(-damping * w * dt), libm::sin(damped_w * dt), libm::cos(damped_w * dt));
        let damped_sin = damping * w / damped_w * sin;
        let transition = [cos + damped_sin, sin / damped_w, -w * w / damped_w * sin, cos - damped_sin];
        let zeros = vec![[0.0; 3]; vertices];
        Self {
            transition: transition.map(|x| decay * x),
            dt,
            lags: zeros.clone(),
            velocities: zeros.clone(),
            skin_velocities: zeros,
            previous: vec![[0.0; 3]; vertices],
            frames: 0,
        }
    }

    /// Advances to the next frame of skinned positions.
    pub fn advance(&mut self, positions: &[[f32; 3]]) {
        for (v, position) in positions.iter().enumerate().take(self.previous.len()) {
            let skin_velocity = scale(sub(widen(*position), widen(self.previous[v])), 1.0 / self.dt);
            // The velocity between the first two frames counts as constant before them.
            if self.frames > 1 {
                self.velocities[v] = sub(self.velocities[v], sub(skin_velocity, self.skin_velocities[v]));
            }
            if self.frames > 0 {
                let (lag, velocity) = (self.lags[v], self.velocities[v]);
                self.lags[v] = add(scale(lag, self.transition[0]), scale(velocity, self.transition[1]));
                self.velocities[v] = add(scale(lag, self.transition[2]), scale(velocity, self.transition[3]));
                self.skin_velocities[v] = skin_velocity;
            }
            self.previous[v] = *position;
        }
        self.frames += 1;
    }

    /// Computes the speed of each vertex of the cloth along the surface of the latest frame.
    ///
    /// # Shapes
    /// `normals` and `out`: one per vertex; `out` in m/s.
    pub fn slip(&self, triangles: &[[u32; 3]], normals: &mut [Vec3], out: &mut [f32]) {
        surface_normals(&self.previous, triangles, normals);
        for ((out, velocity), normal) in out.iter_mut().zip(&self.velocities).zip(&*normals) {
            let tangential = sub(*velocity, scale(*normal, dot(*velocity, *normal)));
            *out = norm(tangential) as f32;
        }
    }
}

/// Computes normals of vertices, weighted by area; zero where there is no triangle.
fn surface_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]], normals: &mut [Vec3]) {
    normals.fill([0.0; 3]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions.get(v as usize).copied().map(widen).unwrap_or_default());
        let double_area = cross(sub(b, a), sub(c, a));
        for &v in triangle {
            if let Some(normal) = normals.get_mut(v as usize) {
                *normal = add(*normal, double_area);
            }
        }
    }
    for normal in normals {
        let length = norm(*normal);
        *normal = if length > 0.0 { scale(*normal, 1.0 / length) } else { [0.0; 3] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    /// Lag and its velocity in each frame, of one vertex that moves along the x axis.
    fn lag(rate: f64, frames: usize, at: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let mut lag = Lag::new(1, rate, 3.0, 0.5);
        let position = |k: usize| [at(k as f64 / rate) as f32, 0.0, 0.0];
        (0..frames)
            .map(|k| {
                lag.advance(&[position(k)]);
                (lag.lags[0][0], lag.velocities[0][0])
            })
            .collect()
    }

    #[test]
    fn a_skin_that_stops_leaves_a_damped_oscillation_at_any_frame_rate() {
        // 1 m/s until it stops at 0.5 s.
        let at = |t: f64| t.min(0.5);
        let (w, d) = (std::f64::consts::TAU * 3.0, 0.5);
        let damped_w = w * (1.0_f64 - d * d).sqrt();
        for rate in [20.0, 60.0, 240.0] {
            let found = lag(rate, (1.5 * rate) as usize, at);
            for (k, (lag, velocity)) in found.iter().enumerate() {
                let t = k as f64 / rate - 0.5;
                let (s, c) = (damped_w * t).sin_cos();
                let expected = if t > 1e-9 {
                    let decay = (-d * w * t).exp();
                    [decay * s / damped_w, decay * (c - d * w / damped_w * s)]
                } else {
                    [0.0, 0.0]
                };
                assert!(
                    (lag - expected[0]).abs() < 2e-5 && (velocity - expected[1]).abs() < 2e-4,
                    "{rate} {k}: {lag} {velocity}"
                );
            }
        }
    }

    #[test]
    fn constant_velocity_has_no_lag_and_constant_acceleration_a_lag_of_a_over_w_squared() {
        assert!(lag(60.0, 100, |t| 3.0 * t).iter().all(|(x, v)| x.abs() < 1e-5 && v.abs() < 1e-3));
        let w = std::f64::consts::TAU * 3.0;
        let (x, v) = lag(240.0, 960, |t| 0.5 * t * t).last().copied().unwrap();
        assert!((x + 1.0 / (w * w)).abs() < 2e-5 && v.abs() < 5e-3, "{x} {v}");
    }

    #[test]
    fn only_motion_along_the_surface_is_slip() {
        let sheet = FlatSheet { vertices: [4, 4], size: [0.3, 0.3], velocity: [0.0; 3] }.topology();
        let slips = |velocity: [f32; 3]| {
            let n = sheet.rest.len();
            let mut lag = Lag::new(n, 60.0, 3.0, 0.5);
            let moved = |t: f32| -> Vec<[f32; 3]> {
                sheet.rest.iter().map(|p| std::array::from_fn(|k| p[k] + velocity[k] * t)).collect()
            };
            // It rests for two frames, and then moves.
            for t in [0.0, 0.0, 1.0 / 60.0] {
                lag.advance(&moved(t));
            }
            let (mut normals, mut out) = (vec![[0.0; 3]; n], vec![9.0; n]);
            lag.slip(&sheet.triangles, &mut normals, &mut out);
            out
        };
        assert!(slips([0.0, 0.0, 1.0]).iter().all(|s| *s < 1e-4), "away from the body");
        let along = slips([1.0, 0.0, 0.0]);
        assert!(along.iter().all(|s| (s - along[0]).abs() < 1e-4) && along[0] > 0.3, "{along:?}");
        let both = slips([1.0, 0.0, 5.0]);
        assert!((both[0] - along[0]).abs() < 1e-3);
    }
}
