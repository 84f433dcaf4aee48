//! When parts of a cloth go from slack to taut, and how fast they went along their normal until then.

use crate::contact::vector::{Vec3, add, cross, dot, norm, scale, sub, widen};
use crate::impl_state;
use crate::mesh::{Regions, Topology};
use crate::warp::linear::principal;
use serde::{Deserialize, Serialize};

/// Spread of a part across its longest direction, relative to along it, below which it is a thread.
const THREAD: f64 = 1e-3;

/// When a part counts as taut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TautParams {
    /// Largest size of a part, m.
    pub size: f64,
    /// Length over length at rest from which on a part is taut.
    pub taut: f64,
    /// How far below that it has to fall before it is slack.
    pub band: f64,
    /// Least strain per second with which it is caught; what tightens more slowly does so without a sound.
    pub rate: f64,
}

/// A part that was slack and is taut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snap {
    /// Frame before which it was slack, from 0.
    pub frame: u64,
    /// How far on the way to the next frame it became taut, above 0 and at most 1.
    pub within: f64,
    /// Strain per second at that moment.
    pub rate: f64,
    /// Speed along its normal that it lost, m/s.
    pub lost: f64,
    /// Its area at rest, m^2.
    pub area: f64,
    /// Its middle, m.
    pub position: [f32; 3],
}

/// A part of a cloth: what makes its middle and its stretch out of the places of its vertices.
#[derive(Clone, Debug)]
struct Part {
    vertices: Vec<u32>,
    /// Shares of the area, which sum to 1.
    shares: Vec<f64>,
    /// What a place adds to the two columns of the map from the flat part to where it is; they sum to 0.
    slopes: Vec<[f64; 2]>,
    area: f64,
}

/// A part in one frame.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Pose {
    /// Length over length at rest where that is largest, and across.
    stretches: [f64; 2],
    middle: Vec3,
    normal: Vec3,
}

impl Part {
    /// `None` for what has no area or is a thread.
    fn new(vertices: &[u32], rest: &[[f32; 3]], areas: &[f32]) -> Option<Self> {
        let place = |v: &u32| rest.get(*v as usize).copied().map(widen).unwrap_or_default();
        let weight = |v: &u32| f64::from(areas.get(*v as usize).copied().unwrap_or(0.0));
        let area: f64 = vertices.iter().map(weight).sum();
        if area <= 0.0 {
            return None;
        }
        let shares: Vec<f64> = vertices.iter().map(|v| weight(v) / area).collect();
        let middle = vertices.iter().zip(&shares).fold([0.0; 3], |sum, (v, s)| add(sum, scale(place(v), *s)));
        let arms: Vec<Vec3> = vertices.iter().map(|v| sub(place(v), middle)).collect();
        let spread: Vec<f64> = arms.iter().zip(&shares).flat_map(|(arm, s)| scale(*arm, s.sqrt())).collect();
        let [(long, u), (wide, v)] =
            principal(&spread, 3).into_iter().take(2).collect::<Vec<_>>().try_into().ok()?;
        if wide <= THREAD * long || !wide.is_finite() {
            return None;
        }
        let along = |arm: &Vec3, axis: &[f64]| arm.iter().zip(axis).map(|(a, b)| a * b).sum::<f64>();
        // Along principal directions the least-squares map needs no inverse of a matrix.
        let slopes = arms
            .iter()
            .zip(&shares)
            .map(|(arm, s)| [s * along(arm, &u) / (long * long), s * along(arm, &v) / (wide * wide)]);
        Some(Self { slopes: slopes.collect(), vertices: vertices.to_vec(), shares, area })
    }

    /// The affine map that is nearest to where the part is, of which wrinkles are no part: what is folded is short.
    fn pose(&self, places: &[[f32; 3]]) -> Pose {
        let first = self
            .vertices
            .first()
            .and_then(|v| places.get(*v as usize))
            .copied()
            .map(widen)
            .unwrap_or_default();
        let (mut middle, mut columns) = ([0.0; 3], [[0.0; 3]; 2]);
        for ((v, share), slopes) in self.vertices.iter().zip(&self.shares).zip(&self.slopes) {
            // Measured from one of its vertices, so that nothing cancels far from the origin.
            let arm = sub(places.get(*v as usize).copied().map(widen).unwrap_or_default(), first);
            middle = add(middle, scale(arm, *share));
            for (column, slope) in columns.iter_mut().zip(slopes) {
                *column = add(*column, scale(arm, *slope));
            }
        }
        let [a, b] = columns;
        let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
        let (middle_square, apart) = (0.5 * (aa + bb), (0.25 * (aa - bb).powi(2) + ab * ab).sqrt());
        let stretches = [middle_square + apart, (middle_square - apart).max(0.0)].map(f64::sqrt);
        let across = cross(a, b);
        let length = norm(across);
        let normal = if length > 0.0 { scale(across, 1.0 / length) } else { [0.0; 3] };
        Pose { stretches, middle: add(first, middle), normal }
    }
}

impl Pose {
    fn is_finite(&self) -> bool {
        self.stretches.iter().chain(&self.middle).all(|x| x.is_finite())
    }
}

/// Way along the normal that a part no longer goes in a frame, from the first two of four poses to the last two.
fn lost([first, before, after, now]: &[Pose; 4]) -> f64 {
    let fell = sub(sub(before.middle, first.middle), sub(now.middle, after.middle));
    dot(fell, after.normal).abs()
}

impl TautParams {
    /// The first direction that turns from slack to taut on the way from one frame to the next: how far on that way, and the
    /// strain per second.
    fn caught(
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
            let (within, rate) = ((self.taut - before) / (after - before), (after - before) * fps);
            if rate >= self.rate && first.is_none_or(|(known, _)| within < known) {
                first = Some((within, rate));
            }
        }
        first
    }

    /// What falls below the band is slack.
    fn loosen(&self, slack: &mut [bool; 2], stretches: [f64; 2], known: bool) {
        for (slack, stretch) in slack.iter_mut().zip(stretches) {
            *slack |= known && stretch < self.taut - self.band;
        }
    }
}

/// How far the parts of a cloth are stretched, frame by frame.
///
/// The stretches of a part are the two of the affine map that takes its rest pose nearest to where it is: a part that is folded or
/// wrinkled is short although no thread of it is, and one that turns as a whole keeps its stretches. Either of them turns from slack
/// into taut: pulled along one direction, or flat at last along both. It does between two frames, where the stretch, on a straight
/// line from one to the other, passes the limit. The speed that is lost is that along the normal between the frames before, less
/// that between the frames after, so the frame that follows has to be known; momentum between the same frames is lost once.
///
/// # Complexity
/// O(vertices) per frame.
#[derive(Clone, Debug)]
pub struct Tightness {
    parts: Vec<Part>,
    params: TautParams,
    /// Frames per second.
    fps: f64,
    /// Poses of the last three frames, the latest last.
    past: [Vec<Pose>; 3],
    slack: Vec<[bool; 2]>,
    /// Frame from which on a part may snap again.
    rested: Vec<u64>,
    frames: u64,
}
impl_state!(Tightness { past, slack, rested, frames });

impl Tightness {
    /// Cuts a cloth into parts; `areas` are those of its vertices at rest, m^2.
    #[must_use]
    pub fn new(topology: &Topology, areas: &[f32], params: TautParams, fps: f64) -> Self {
        let regions = Regions::new(&topology.rest, params.size);
        let part = |vertices: &Vec<u32>| Part::new(vertices, &topology.rest, areas);
        let parts: Vec<Part> = regions.vertices.iter().filter_map(part).collect();
        let past = std::array::from_fn(|_| vec![Pose::default(); parts.len()]);
        let (slack, rested) = (vec![[false; 2]; parts.len()], vec![3; parts.len()]);
        Self { slack, rested, parts, params, fps, past, frames: 0 }
    }

    /// How many parts there are.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Takes the next frame, and gives the parts that became taut on the way to the frame before it.
    ///
    /// # Errors
    /// The first vertex of a part whose place is no number.
    pub fn take(&mut self, places: &[[f32; 3]], mut found: impl FnMut(Snap)) -> Result<(), u32> {
        for (k, part) in self.parts.iter().enumerate() {
            let now = part.pose(places);
            if !now.is_finite() {
                return Err(part.vertices.first().copied().unwrap_or(0));
            }
            let poses @ [_, before, after, _] = [self.past[0][k], self.past[1][k], self.past[2][k], now];
            let caught = self.params.caught(&mut self.slack[k], before.stretches, after.stretches, self.fps);
            if let Some((within, rate)) = caught
                && self.frames >= self.rested[k]
            {
                self.rested[k] = self.frames + 3;
                let (lost, position) = (lost(&poses) * self.fps, after.middle.map(|x| x as f32));
                found(Snap { frame: self.frames - 2, within, rate, lost, area: part.area, position });
            }
            self.params.loosen(&mut self.slack[k], after.stretches, self.frames > 0);
            (self.past[0][k], self.past[1][k], self.past[2][k]) = (before, after, now);
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

    /// What is found where every vertex goes to `at(place at rest, frame)`, 60 frames per second.
    fn found(params: TautParams, frames: usize, at: impl Fn([f64; 3], f64) -> [f64; 3]) -> Vec<Snap> {
        let (sheet, areas) = sheet();
        let mut tightness = Tightness::new(&sheet, &areas, params, 60.0);
        let mut snaps = Vec::new();
        for k in 0..frames {
            let place = |p: &[f32; 3]| at(widen(*p), k as f64 / 60.0).map(|x| x as f32);
            let places: Vec<[f32; 3]> = sheet.rest.iter().map(place).collect();
            tightness.take(&places, |snap| snaps.push(snap)).unwrap();
        }
        snaps
    }

    /// Stretch along x that passes 1 at `t`: from 0.9 on, by 1 per second.
    fn pulled(t: f64, moment: f64) -> f64 {
        (1.0 + (t - moment)).clamp(0.9, 1.02)
    }

    #[test]
    fn a_sheet_that_is_caught_snaps_once_at_that_time_and_loses_its_speed() {
        // It flies upwards with 3 m/s and is stopped as it becomes taut, a third of the way from frame 20 to 21.
        let moment = (20.0 + 1.0 / 3.0) / 60.0;
        let fly = |p: [f64; 3], t: f64| [p[0] * pulled(t, moment), 1.05 * p[1], p[2] + 3.0 * t.min(moment)];
        let snaps = found(PARAMS, 60, fly);
        assert_eq!(snaps.len(), 1, "{snaps:?}");
        let snap = snaps[0];
        assert_eq!(snap.frame, 20);
        assert!((snap.within - 1.0 / 3.0).abs() < 1e-4 && (snap.rate - 1.0).abs() < 1e-4, "{snap:?}");
        assert!((snap.lost - 3.0).abs() < 1e-4 && (snap.area - 0.4).abs() < 1e-6, "{snap:?}");
        assert!((snap.position[2] - 3.0 * moment as f32).abs() < 1e-5);
        // Parts of it do the same at the same time, each with its share of the area.
        let parts = found(TautParams { size: 0.25, ..PARAMS }, 60, fly);
        assert_eq!(parts.len(), 8);
        assert!((parts.iter().map(|s| s.area).sum::<f64>() - 0.4).abs() < 1e-6);
        assert!(parts.iter().all(|s| (s.lost - 3.0).abs() < 1e-3 && s.frame == 20), "{parts:?}");
    }

    #[test]
    fn only_speed_along_the_normal_counts_whichever_way_the_sheet_faces() {
        let moment = 0.4;
        let (s, c) = 0.7_f64.sin_cos();
        // Turned about y, with a speed along its own surface as well.
        let at = |p: [f64; 3], t: f64| {
            let (x, z) = (p[0] * pulled(t, moment) + 5.0 * t.min(moment), -2.0 * t.min(moment));
            [c * x - s * z, 1.05 * p[1], s * x + c * z]
        };
        let snaps = found(PARAMS, 60, at);
        assert!(snaps.len() == 1 && (snaps[0].lost - 2.0).abs() < 1e-3, "{snaps:?}");
    }

    #[test]
    fn what_stays_slack_or_moves_as_a_whole_makes_nothing() {
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
    fn a_folded_part_is_short_although_no_thread_of_it_is() {
        let (sheet, areas) = sheet();
        let part = Part::new(&(0..54).collect::<Vec<_>>(), &sheet.rest, &areas).unwrap();
        assert!((part.pose(&sheet.rest).stretches[1] - 1.0).abs() < 1e-6);
        // A zigzag along both directions at half a right angle keeps every edge as long as it was, or longer.
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
        assert!(together.len() == 1 && (together[0].lost - 2.0).abs() < 1e-3, "{together:?}");
        let apart = found(PARAMS, 60, at(0.1));
        assert!(apart.len() == 2 && apart[1].lost < 1e-3, "{apart:?}");
    }

    #[test]
    fn threads_and_lone_vertices_are_no_parts() {
        let line: Vec<[f32; 3]> = (0..5).map(|k| [k as f32, 0.0, 0.0]).collect();
        assert!(Part::new(&[0, 1, 2, 3, 4], &line, &[1.0; 5]).is_none());
        assert!(Part::new(&[0], &line, &[1.0; 5]).is_none() && Part::new(&[], &line, &[]).is_none());
        let mut none = Tightness::new(&Topology::default(), &[], PARAMS, 60.0);
        assert_eq!((none.parts(), none.take(&[], |_| ())), (0, Ok(())));
    }

    #[test]
    fn a_place_that_is_no_number_is_named() {
        let (sheet, areas) = sheet();
        let mut tightness = Tightness::new(&sheet, &areas, PARAMS, 60.0);
        let mut places = sheet.rest.clone();
        places[7][1] = f32::NAN;
        assert_eq!(tightness.take(&places, |_| ()), Err(0));
    }
}
