//! Transitions of cloth parts from slack to taut, and the normal speed that is lost in them.

use crate::contact::vector::{Vec3, add, cross, dot, norm, scale, sub, widen};
use crate::impl_state;
use crate::mesh::{Regions, Topology};
use crate::warp::spline::linear::principal;
use serde::{Deserialize, Serialize};

/// Ratio of the second to the first principal extent of a part below which it is a thread.
const THREAD: f64 = 1e-3;

/// Thresholds of the stretch of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TautParams {
    /// Maximum size of a part, m.
    pub size: f64,
    /// Ratio of length to rest length at which a part becomes taut.
    pub taut: f64,
    /// Decrease of the stretch below `taut` after which a part is slack.
    pub band: f64,
    /// Minimum strain rate of a snap, 1/s; a slower transition makes no sound.
    pub rate: f64,
}

/// Transition of a part from slack to taut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snap {
    /// Index of the last frame in which the part was slack.
    pub frame: u64,
    /// Fraction of the frame interval after which it became taut, above 0 and at most 1.
    pub fraction: f64,
    /// Strain rate at that time, 1/s.
    pub rate: f64,
    /// Lost speed along the normal, m/s.
    pub lost_speed: f64,
    /// Rest area, m^2.
    pub area: f64,
    /// Centroid, m.
    pub position: [f32; 3],
}

/// A part of a cloth: the weights of its centroid and its affine map as sums over the positions of its vertices.
#[derive(Clone, Debug)]
struct Part {
    vertices: Vec<u32>,
    /// Fractions of the area, of sum 1.
    weights: Vec<f64>,
    /// Weights of a position in the two columns of the affine map from the rest pose, of sum 0.
    slopes: Vec<[f64; 2]>,
    area: f64,
}

/// A part in one frame.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Pose {
    /// Singular values of the affine map, the larger first.
    stretches: [f64; 2],
    centroid: Vec3,
    normal: Vec3,
}

impl Part {
    /// Returns `None` for a part without area and for a thread.
    fn new(vertices: &[u32], rest: &[[f32; 3]], areas: &[f32]) -> Option<Self> {
        let position = |v: &u32| rest.get(*v as usize).copied().map(widen).unwrap_or_default();
        let vertex_area = |v: &u32| f64::from(areas.get(*v as usize).copied().unwrap_or(0.0));
        let area: f64 = vertices.iter().map(vertex_area).sum();
        if area <= 0.0 {
            return None;
        }
        let weights: Vec<f64> = vertices.iter().map(|v| vertex_area(v) / area).collect();
        let centroid =
            vertices.iter().zip(&weights).fold([0.0; 3], |sum, (v, w)| add(sum, scale(position(v), *w)));
        let offsets: Vec<Vec3> = vertices.iter().map(|v| sub(position(v), centroid)).collect();
        let weighted: Vec<f64> =
            offsets.iter().zip(&weights).flat_map(|(offset, w)| scale(*offset, w.sqrt())).collect();
        let [(length, u), (width, v)] =
            principal(&weighted, 3).into_iter().take(2).collect::<Vec<_>>().try_into().ok()?;
        if width <= THREAD * length || !width.is_finite() {
            return None;
        }
        let along = |offset: &Vec3, axis: &[f64]| offset.iter().zip(axis).map(|(a, b)| a * b).sum::<f64>();
        // In principal axes the least-squares map needs no matrix inverse.
        let slopes = offsets.iter().zip(&weights).map(|(offset, w)| {
            [w * along(offset, &u) / (length * length), w * along(offset, &v) / (width * width)]
        });
        Some(Self { slopes: slopes.collect(), vertices: vertices.to_vec(), weights, area })
    }

    /// Fits the least-squares affine map to the positions. It leaves out wrinkles, so that a folded part has a small stretch.
    fn pose(&self, positions: &[[f32; 3]]) -> Pose {
        let first = self
            .vertices
            .first()
            .and_then(|v| positions.get(*v as usize))
            .copied()
            .map(widen)
            .unwrap_or_default();
        let (mut centroid, mut columns) = ([0.0; 3], [[0.0; 3]; 2]);
        for ((v, weight), slopes) in self.vertices.iter().zip(&self.weights).zip(&self.slopes) {
            // Relative to one of the vertices, to avoid cancellation far from the origin.
            let offset = sub(positions.get(*v as usize).copied().map(widen).unwrap_or_default(), first);
            centroid = add(centroid, scale(offset, *weight));
            for (column, slope) in columns.iter_mut().zip(slopes) {
                *column = add(*column, scale(offset, *slope));
            }
        }
        let [a, b] = columns;
        let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
        let (mean, deviation) = (0.5 * (aa + bb), (0.25 * (aa - bb).powi(2) + ab * ab).sqrt());
        let stretches = [mean + deviation, (mean - deviation).max(0.0)].map(f64::sqrt);
        let product = cross(a, b);
        let length = norm(product);
        let normal = if length > 0.0 { scale(product, 1.0 / length) } else { [0.0; 3] };
        Pose { stretches, centroid: add(first, centroid), normal }
    }
}

impl Pose {
    fn is_finite(&self) -> bool {
        self.stretches.iter().chain(&self.centroid).all(|x| x.is_finite())
    }
}

/// Decrease of the displacement per frame along the normal, from the first two of four poses to the last two.
fn lost_displacement([first, before, after, now]: &[Pose; 4]) -> f64 {
    let lost = sub(sub(before.centroid, first.centroid), sub(now.centroid, after.centroid));
    dot(lost, after.normal).abs()
}

impl TautParams {
    /// The first principal direction that turns from slack to taut between two frames: fraction of the interval, and strain rate.
    fn first_taut(
        &self,
        slack: &mut [bool; 2],
        before: [f64; 2],
        after: [f64; 2],
        fps: f64,
    ) -> Option<(f64, f64)> {
        let mut first: Option<(f64, f64)> = None;
        for ((slack, before), after) in slack.iter_mut().zip(before).zip(after) {
            if !*slack || after < self.taut {
                continue;
            }
            *slack = false;
            let (fraction, rate) = ((self.taut - before) / (after - before), (after - before) * fps);
            if rate >= self.rate && first.is_none_or(|(known, _)| fraction < known) {
                first = Some((fraction, rate));
            }
        }
        first
    }

    /// Sets directions slack whose stretch is below the band.
    fn set_slack(&self, slack: &mut [bool; 2], stretches: [f64; 2], known: bool) {
        for (slack, stretch) in slack.iter_mut().zip(stretches) {
            *slack |= known && stretch < self.taut - self.band;
        }
    }
}

/// The stretch of the parts of a cloth, frame by frame.
///
/// The stretches of a part are the two singular values of the least-squares affine map from its rest pose. A folded or wrinkled part
/// has a small stretch although no thread of it is shorter; a rigid motion does not change the stretches. Each of the two turns from
/// slack to taut by itself, at the time at which the linearly interpolated stretch passes the threshold. The lost speed is the
/// normal speed between the frames before, less that between the frames after; so the frame that follows must be known. Momentum
/// between the same frames is lost once.
///
/// # Complexity
/// O(vertices) per frame.
#[derive(Clone, Debug)]
pub struct Tightness {
    parts: Vec<Part>,
    params: TautParams,
    /// Frames per second.
    fps: f64,
    /// Poses of the last three frames, in order of time.
    history: [Vec<Pose>; 3],
    slack: Vec<[bool; 2]>,
    /// First frame at which a part may snap again.
    next_snap: Vec<u64>,
    frames: u64,
}
impl_state!(Tightness { history, slack, next_snap, frames });

impl Tightness {
    /// Divides a cloth into parts; `areas` are the rest areas of its vertices, m^2.
    #[must_use]
    pub fn new(topology: &Topology, areas: &[f32], params: TautParams, fps: f64) -> Self {
        let regions = Regions::new(&topology.rest, params.size);
        let part = |vertices: &Vec<u32>| Part::new(vertices, &topology.rest, areas);
        let parts: Vec<Part> = regions.vertices.iter().filter_map(part).collect();
        let history = std::array::from_fn(|_| vec![Pose::default(); parts.len()]);
        let (slack, next_snap) = (vec![[false; 2]; parts.len()], vec![3; parts.len()]);
        Self { slack, next_snap, parts, params, fps, history, frames: 0 }
    }

    /// Number of parts.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Processes the positions of the next frame. Calls `found` for the parts that became taut in the interval before the previous
    /// frame.
    ///
    /// # Errors
    /// The first vertex of a part whose position is not finite.
    pub fn process(&mut self, positions: &[[f32; 3]], mut found: impl FnMut(Snap)) -> Result<(), u32> {
        for (k, part) in self.parts.iter().enumerate() {
            let now = part.pose(positions);
            if !now.is_finite() {
                return Err(part.vertices.first().copied().unwrap_or(0));
            }
            let poses @ [_, before, after, _] =
                [self.history[0][k], self.history[1][k], self.history[2][k], now];
            let taut =
                self.params.first_taut(&mut self.slack[k], before.stretches, after.stretches, self.fps);
            if let Some((fraction, rate)) = taut
                && self.frames >= self.next_snap[k]
            {
                self.next_snap[k] = self.frames + 3;
                let lost_speed = lost_displacement(&poses) * self.fps;
                let position = after.centroid.map(|x| x as f32);
                found(Snap { frame: self.frames - 2, fraction, rate, lost_speed, area: part.area, position });
            }
            self.params.set_slack(&mut self.slack[k], after.stretches, self.frames > 0);
            (self.history[0][k], self.history[1][k], self.history[2][k]) = (before, after, now);
        }
        self.frames += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{FlatSheet, Synthetic};
    use crate::mesh::vertex_areas;

    const PARAMS: TautParams = TautParams { size: 10.0, taut: 1.0, band: 0.05, rate: 0.1 };

    fn sheet() -> (Topology, Vec<f32>) {
        let sheet = FlatSheet { vertices: [9, 6], size: [0.8, 0.5], velocity: [0.0; 3] }.topology();
        let areas = vertex_areas(&sheet.rest, &sheet.triangles);
        (sheet, areas)
    }

    /// Snaps of a sheet whose vertices are at `at(rest position, time)`, at 60 frames per second.
    fn found(params: TautParams, frames: usize, at: impl Fn([f64; 3], f64) -> [f64; 3]) -> Vec<Snap> {
        let (sheet, areas) = sheet();
        let mut tightness = Tightness::new(&sheet, &areas, params, 60.0);
        let mut snaps = Vec::new();
        for k in 0..frames {
            let position = |p: &[f32; 3]| at(widen(*p), k as f64 / 60.0).map(|x| x as f32);
            let positions: Vec<[f32; 3]> = sheet.rest.iter().map(position).collect();
            tightness.process(&positions, |snap| snaps.push(snap)).unwrap();
        }
        snaps
    }

    /// Stretch that passes 1 at `moment`, with a strain rate of 1/s, from 0.9 to 1.02.
    fn pulled(t: f64, moment: f64) -> f64 {
        (1.0 + (t - moment)).clamp(0.9, 1.02)
    }

    #[test]
    fn a_sheet_snaps_once_when_it_becomes_taut_and_loses_its_speed() {
        // It flies upwards at 3 m/s and stops when it becomes taut, a third of the interval after frame 20.
        let moment = (20.0 + 1.0 / 3.0) / 60.0;
        let fly = |p: [f64; 3], t: f64| [p[0] * pulled(t, moment), 1.05 * p[1], p[2] + 3.0 * t.min(moment)];
        let snaps = found(PARAMS, 60, fly);
        assert_eq!(snaps.len(), 1, "{snaps:?}");
        let snap = snaps[0];
        assert_eq!(snap.frame, 20);
        assert!((snap.fraction - 1.0 / 3.0).abs() < 1e-4 && (snap.rate - 1.0).abs() < 1e-4, "{snap:?}");
        assert!((snap.lost_speed - 3.0).abs() < 1e-4 && (snap.area - 0.4).abs() < 1e-6, "{snap:?}");
        assert!((snap.position[2] - 3.0 * moment as f32).abs() < 1e-5);
        // All parts snap at the same time, each with its own area.
        let parts = found(TautParams { size: 0.25, ..PARAMS }, 60, fly);
        assert_eq!(parts.len(), 8);
        assert!((parts.iter().map(|s| s.area).sum::<f64>() - 0.4).abs() < 1e-6);
        assert!(parts.iter().all(|s| (s.lost_speed - 3.0).abs() < 1e-3 && s.frame == 20), "{parts:?}");
    }

    #[test]
    fn only_speed_along_the_normal_counts_for_any_orientation_of_the_sheet() {
        let moment = 0.4;
        let (s, c) = 0.7_f64.sin_cos();
        // Rotated about y, with a tangential speed as well.
        let at = |p: [f64; 3], t: f64| {
            let (x, z) = (p[0] * pulled(t, moment) + 5.0 * t.min(moment), -2.0 * t.min(moment));
            [c * x - s * z, 1.05 * p[1], s * x + c * z]
        };
        let snaps = found(PARAMS, 60, at);
        assert!(snaps.len() == 1 && (snaps[0].lost_speed - 2.0).abs() < 1e-3, "{snaps:?}");
    }

    #[test]
    fn slack_cloth_and_rigid_motion_make_no_snaps() {
        let slack =
            |p: [f64; 3], t: f64| [p[0] * (0.9 + 0.08 * (9.0 * t).sin()), 0.8 * p[1], p[2] + (5.0 * t).cos()];
        assert_eq!(found(PARAMS, 120, slack), []);
        let tumble = |p: [f64; 3], t: f64| {
            let (s, c) = (8.0 * t).sin_cos();
            [c * p[0] - s * p[1] + 4.0 * t, s * p[0] + c * p[1], p[2] + 2.0 * (7.0 * t).sin()]
        };
        assert_eq!(found(TautParams { band: 1e-4, rate: 0.0, ..PARAMS }, 120, tumble), []);
    }

    #[test]
    fn slow_tightening_is_silent_and_trembling_within_the_band_snaps_once() {
        let slowly = |p: [f64; 3], t: f64| [p[0] * (0.9 + 0.05 * t), p[1] * 0.8, p[2]];
        assert_eq!(found(PARAMS, 200, slowly), []);
        assert_eq!(found(TautParams { rate: 0.01, ..PARAMS }, 200, slowly).len(), 1);
        let trembling = |p: [f64; 3], t: f64| {
            let stretch = if t < 0.2 { 0.9 } else { 1.0 + 0.03 * (40.0 * t).sin() };
            [p[0] * stretch, p[1] * 0.8, p[2]]
        };
        assert_eq!(found(PARAMS, 200, trembling).len(), 1);
        assert!(found(TautParams { band: 0.01, ..PARAMS }, 200, trembling).len() > 5);
    }

    #[test]
    fn a_folded_part_has_a_small_stretch_although_no_edge_is_shorter() {
        let (sheet, areas) = sheet();
        let part = Part::new(&(0..54).collect::<Vec<_>>(), &sheet.rest, &areas).unwrap();
        assert!((part.pose(&sheet.rest).stretches[1] - 1.0).abs() < 1e-6);
        // In a zigzag along both directions at 45 degrees no edge is shorter than at rest.
        let zigzag: Vec<[f32; 3]> = sheet
            .rest
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let up = 0.1 * ((k % 9 + k / 9) % 2) as f32;
                [p[0] * 0.5_f32.sqrt(), p[1] * 0.5_f32.sqrt(), up]
            })
            .collect();
        assert!((part.pose(&zigzag).stretches[0] - 0.5_f64.sqrt()).abs() < 0.02, "{:?}", part.pose(&zigzag));
    }

    #[test]
    fn a_sheet_that_is_pulled_along_both_directions_snaps_along_each_but_loses_its_speed_once() {
        let at = |late: f64| {
            move |p: [f64; 3], t: f64| {
                [p[0] * pulled(t, 0.4), p[1] * pulled(t, 0.4 + late), p[2] + 2.0 * t.min(0.4)]
            }
        };
        let together = found(PARAMS, 60, at(0.01));
        assert!(together.len() == 1 && (together[0].lost_speed - 2.0).abs() < 1e-3, "{together:?}");
        let apart = found(PARAMS, 60, at(0.1));
        assert!(apart.len() == 2 && apart[1].lost_speed < 1e-3, "{apart:?}");
    }

    #[test]
    fn threads_and_single_vertices_are_no_parts() {
        let line: Vec<[f32; 3]> = (0..5).map(|k| [k as f32, 0.0, 0.0]).collect();
        assert!(Part::new(&[0, 1, 2, 3, 4], &line, &[1.0; 5]).is_none());
        assert!(Part::new(&[0], &line, &[1.0; 5]).is_none() && Part::new(&[], &line, &[]).is_none());
        let mut none = Tightness::new(&Topology::default(), &[], PARAMS, 60.0);
        assert_eq!((none.parts(), none.process(&[], |_| ())), (0, Ok(())));
    }

    #[test]
    fn a_position_that_is_not_finite_is_named() {
        let (sheet, areas) = sheet();
        let mut tightness = Tightness::new(&sheet, &areas, PARAMS, 60.0);
        let mut positions = sheet.rest.clone();
        positions[7][1] = f32::NAN;
        assert_eq!(tightness.process(&positions, |_| ()), Err(0));
    }
}
