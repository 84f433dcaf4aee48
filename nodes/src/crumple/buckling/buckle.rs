//! Vertices whose mean curvature changes sign between two frames.

use serde::{Deserialize, Serialize};

use crate::curvature::{Curvature, Method};
use crate::impl_state;

/// The buckling of one vertex in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Buckle {
    /// 1 if the curvature rises above 0, -1 if it falls below 0, 0 if the vertex does not buckle.
    pub label: i8,
    /// Change of mean curvature from the other side, 1/m; 0 if the vertex does not buckle.
    pub delta: f64,
    /// Area of the vertex, the mean of this frame and the previous one, m^2.
    pub area: f64,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Position, m.
    pub position: [f32; 3],
    /// Dead band of the detector, 1/m.
    pub h_eps: f32,
    /// Method of the curvature measurement.
    pub method: Method,
}

/// Longest interval over which a change of curvature is measured, s: a snap is shorter, and the change over a longer one
/// would make an impact of a slow bend.
pub const MAX_INTERVAL: f64 = 1.0 / 30.0;

/// Number of frames over which a change of curvature is measured at a frame rate in hertz: as many as [`MAX_INTERVAL`] has, at least one.
pub(crate) fn frames_of_change(fps: f64) -> usize {
    // Rates in files are decimals.
    (MAX_INTERVAL * fps + 1e-6).floor().max(1.0) as usize
}

/// Number of frames outside of the dead band after which a curvature is no outlier of the noise.
const SURE: u8 = 2;

/// State of a vertex.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SignState {
    /// Side on which the curvature was last, 1 or -1.
    sign: i8,
    /// Frames since the curvature was outside of the dead band on that side; `None` if it has not been there.
    age: Option<u32>,
    /// Number of frames for which it was there in sequence, at most [`SURE`].
    outside: u8,
    /// Area in the last frame, m^2.
    area: f64,
}

/// Detects changes of the sign of the mean curvature of every vertex.
///
/// A vertex buckles outwards (label 1) in the frame in which its curvature `H` changes from below 0 to 0 or above, and
/// inwards (-1) when it changes back. Noise around 0 is excluded by a dead band `|H| <= h_eps`: the vertex must have been
/// outside of it in two frames in sequence since its sign last changed. After a single frame, which may be an outlier, it
/// buckles only when its curvature has left the band on the other side.
///
/// The change of curvature is measured from the last frame outside of the dead band, which is at most [`MAX_INTERVAL`] and
/// at least one frame ago; without a dead band that is the previous frame. So the energy of a bend grows with the square of
/// its speed, with and without a dead band.
///
/// The sign of a vertex is unknown in the first frame and after a frame with an invalid curvature. Such a vertex cannot
/// buckle.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3; the
/// dead band is an addition.
///
/// # Example
/// ```
/// use foley_nodes::crumple::{Buckle, BuckleDetector};
/// use foley_nodes::curvature::Curvature;
///
/// let bent = |h| [Curvature { h, valid: true, ..Curvature::default() }];
/// let (mut detector, mut found) = (BuckleDetector::new(1, 60.0, 0.0), [Buckle::default()]);
/// let mut label = |h| {
///     detector.detect(&bent(h), &mut found);
///     (found[0].label, found[0].delta)
/// };
/// assert_eq!(label(-2.0), (0, 0.0));
/// assert_eq!(label(1.0), (1, 3.0));
/// ```
#[derive(Clone, Debug)]
pub struct BuckleDetector {
    h_eps: f64,
    states: Vec<SignState>,
    /// Curvatures of the last frames, `[interval, vertices]`, as a ring.
    history: Vec<f64>,
    /// Frames so far.
    frames: u64,
}
impl_state!(BuckleDetector { states, history, frames });

impl BuckleDetector {
    /// Creates a detector for a number of vertices at a frame rate in hertz.
    #[must_use]
    pub fn new(vertices: usize, fps: f64, h_eps: f64) -> Self {
        let interval = frames_of_change(fps);
        Self {
            h_eps,
            states: vec![SignState::default(); vertices],
            history: vec![0.0; interval * vertices],
            frames: 0,
        }
    }

    /// Changes the dead band from the next frame on.
    pub fn set_dead_band(&mut self, h_eps: f64) {
        self.h_eps = h_eps;
    }

    /// Copies the state of a detector of the same number of vertices and the same rate.
    pub fn take_state(&mut self, old: &Self) {
        if old.states.len() == self.states.len() && old.history.len() == self.history.len() {
            self.states.copy_from_slice(&old.states);
            self.history.copy_from_slice(&old.history);
            self.frames = old.frames;
        }
    }

    /// Detects the buckling vertices of the next frame, one element per vertex.
    ///
    /// # Complexity
    /// O(V); no allocation.
    pub fn detect(&mut self, frame: &[Curvature], out: &mut [Buckle]) {
        let vertices = self.states.len().max(1);
        let interval = self.history.len() / vertices;
        for (v, ((state, c), out)) in self.states.iter_mut().zip(frame).zip(out).enumerate() {
            let now = self.frames;
            let history = &self.history;
            let h_before = |frames: u32| {
                let frames = u64::from(frames).min(interval as u64);
                history[((now - frames) % interval as u64) as usize * vertices + v]
            };
            *out = state.next(c, self.h_eps, h_before);
            self.history[(now % interval as u64) as usize * vertices + v] = c.h;
        }
        self.frames += 1;
    }
}

impl SignState {
    /// Updates the sign with the curvature of the next frame; `h_before` is the curvature of a number of frames ago.
    fn next(&mut self, c: &Curvature, h_eps: f64, h_before: impl Fn(u32) -> f64) -> Buckle {
        let mut buckle = Buckle {
            area: 0.5 * (self.area + c.area),
            normal: c.normal,
            position: c.position,
            h_eps: h_eps as f32,
            method: c.method,
            ..Buckle::default()
        };
        if !c.valid {
            *self = Self::default();
            return buckle;
        }
        self.area = c.area;
        self.age = self.age.map(|age| age.saturating_add(1));
        // The paper's rule: zero counts as positive.
        let sign = if c.h >= 0.0 { 1 } else { -1 };
        let is_outside = h_eps == 0.0 || c.h.abs() > h_eps;
        if sign != self.sign {
            let sure = h_eps == 0.0 || self.outside >= SURE;
            if let Some(age) = self.age.filter(|_| sure || is_outside) {
                (buckle.label, buckle.delta) = (sign, c.h - h_before(age));
                (self.sign, self.age) = (sign, None);
            }
            if sure || is_outside {
                self.outside = 0;
            }
        }
        if is_outside {
            (self.sign, self.age) = (sign, Some(0));
            self.outside = SURE.min(self.outside + 1);
        } else if self.outside < SURE {
            self.outside = 0;
        }
        buckle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curvature::scenes::{Scene, crumpled, icosphere, moved, paraboloid};
    use crate::curvature::{MeanCurvature, Method};
    use proptest::prelude::*;

    fn labels(h: &[f64], h_eps: f64) -> Vec<(i8, f64)> {
        let mut detector = BuckleDetector::new(1, 60.0, h_eps);
        let mut out = [Buckle::default()];
        let label = |&h: &f64| {
            let valid = h.is_finite();
            detector.detect(&[Curvature { h, valid, area: 1.0, ..Curvature::default() }], &mut out);
            (out[0].label, out[0].delta)
        };
        h.iter().map(label).collect()
    }

    /// Number of labels over all frames, and of valid vertices of either sign in the last frame.
    fn count(scene: &Scene, frames: &[Vec<[f64; 3]>], method: Method) -> (usize, [usize; 2]) {
        let n = scene.points.len();
        let mut measure = MeanCurvature::new(&scene.topology(), method).unwrap();
        let mut detector = BuckleDetector::new(n, 60.0, 0.0);
        let (mut bent, mut found) = (vec![Curvature::default(); n], vec![Buckle::default(); n]);
        let mut count = 0;
        for frame in frames {
            measure.measure(frame, &mut bent).unwrap();
            detector.detect(&bent, &mut found);
            count += found.iter().filter(|b| b.label != 0).count();
        }
        let count_sign = |positive: bool| bent.iter().filter(|c| c.valid && (c.h > 0.0) == positive).count();
        (count, [count_sign(false), count_sign(true)])
    }

    #[test]
    fn signs_change_as_in_the_paper_and_zero_is_positive() {
        let found = labels(&[-1.0, 0.0, 0.5, -0.25, 0.0, -2.0], 0.0);
        assert_eq!(found, [(0, 0.0), (1, 1.0), (0, 0.0), (-1, -0.75), (1, 0.25), (-1, -2.0)]);
    }

    #[test]
    fn the_sign_is_unknown_after_an_invalid_frame() {
        assert_eq!(labels(&[-1.0, f64::NAN, 1.0, -1.0], 0.0), [(0, 0.0), (0, 0.0), (0, 0.0), (-1, -2.0)]);
    }

    #[test]
    fn the_change_is_measured_from_the_last_frame_outside_of_the_dead_band() {
        // The sign changes at 0.1, two frames after -0.5; noise in the dead band does not count. After 0.3, a single frame,
        // it changes only at -0.3, two frames after 0.05.
        let found = labels(&[-0.05, -1.0, -0.5, -0.05, 0.1, -0.1, 0.1, 0.3, 0.05, -0.15, -0.3, 0.1], 0.2);
        let changes: Vec<_> =
            found.iter().enumerate().filter(|(_, f)| f.0 != 0).map(|(k, f)| (k, *f)).collect();
        let expected = [(4, 1, 0.6), (10, -1, -0.35)];
        assert_eq!(changes.len(), expected.len(), "{changes:?}");
        for ((k, (label, delta)), wanted) in changes.into_iter().zip(expected) {
            assert!((k, label) == (wanted.0, wanted.1) && (delta - wanted.2).abs() < 1e-12, "{delta}");
        }
    }

    #[test]
    fn the_change_is_measured_over_a_thirtieth_of_a_second_at_most() {
        for (fps, frames) in [(24.0, 1), (30.0, 1), (29.97, 1), (60.0, 2), (240.0, 8)] {
            let mut detector = BuckleDetector::new(1, fps, 0.2);
            let mut out = [Buckle::default()];
            let mut last = 0.0;
            // From -1 to 1 in 400 frames.
            for k in 0..400 {
                let h = -1.0 + (f64::from(k) + 0.5) / 200.0;
                detector.detect(&[Curvature { h, valid: true, ..Curvature::default() }], &mut out);
                if out[0].label != 0 {
                    assert_eq!((k, last), (200, 0.0), "once, where the sign changes");
                    last = out[0].delta;
                }
            }
            assert!((last - f64::from(frames) / 200.0).abs() < 1e-9, "{fps}: {last}");
        }
    }

    #[test]
    fn the_energy_of_a_bend_grows_with_the_square_of_its_speed_with_and_without_a_dead_band() {
        // A bowl that is bent back and forth once, slowly and a hundred times faster, at 60 frames per second.
        let energy = |hertz: f64, h_eps: f64| {
            let mut detector = BuckleDetector::new(1, 60.0, h_eps);
            let mut out = [Buckle::default()];
            let frames = (0..(60.0 / hertz) as u32).map(|k| (f64::from(k) + 0.3) * hertz / 60.0);
            let mut found: Vec<(f64, f64)> = Vec::new();
            for turn in frames {
                let h = 1.3 * (std::f64::consts::TAU * turn).cos();
                detector.detect(&[Curvature { h, valid: true, ..Curvature::default() }], &mut out);
                found.extend((out[0].label != 0).then_some((turn, out[0].delta.powi(2))));
            }
            assert_eq!(found.len(), 2, "one for each change of sign");
            let late = found.iter().zip([0.25, 0.75]).map(|(f, turn)| (f.0 - turn) / hertz);
            assert!(late.clone().all(|s| (0.0..=1.0 / 60.0).contains(&s)), "{:?}", late.collect::<Vec<_>>());
            found.iter().map(|f| f.1).sum::<f64>()
        };
        for h_eps in [0.0, 0.5] {
            let ratio = energy(5.0, h_eps) / energy(0.05, h_eps);
            assert!((6_000.0..12_000.0).contains(&ratio), "{h_eps}: {ratio}");
        }
    }

    #[test]
    fn rotation_and_scaling_do_not_buckle() {
        // Rotation may change the last bits of a curvature, but not its sign: no vertex of these sheets is flat to
        // 1e-12.
        for method in [Method::Cotan, Method::Dihedral] {
            for seed in 0..6 {
                let sheet = crumpled(25, seed);
                let tumble = |k: usize| sheet.map(|p| moved(p, 0.37 * k as f64, [0.1 * k as f64, -0.2, 0.3]));
                let (labels, signs) = count(&sheet, &(0..20).map(tumble).collect::<Vec<_>>(), method);
                // The sheet has folds of both signs, so it could buckle.
                assert!(labels == 0 && signs.iter().all(|n| *n > 20), "{labels} labels on {signs:?}");
                let breathe = |k: usize| sheet.map(|p| p.map(|x| x * 1.4_f64.powi([0, 3, -5, 8, 1][k % 5])));
                assert_eq!(count(&sheet, &(0..10).map(breathe).collect::<Vec<_>>(), method), (0, signs));
            }
            for sphere in [icosphere(3), icosphere(3).flipped()] {
                let size = |k: usize| sphere.map(|p| p.map(|x| x * [1.0, 1.3, 4.0, 0.2, 0.01, 30.0][k % 6]));
                assert_eq!(count(&sphere, &(0..12).map(size).collect::<Vec<_>>(), method).0, 0);
            }
        }
        let bowl = paraboloid(1.3);
        assert_eq!(count(&bowl, &[bowl.points.clone(), paraboloid(-1.3).points], Method::Cotan).0, 1521);
    }

    proptest! {
        #[test]
        fn the_change_has_the_sign_of_the_label(h in prop::collection::vec(-3.0..3.0, 1..60), h_eps in 0.0..1.0) {
            for h_eps in [0.0, h_eps] {
                let found = labels(&h, h_eps);
                prop_assert!(found.iter().all(|(label, delta)| f64::from(*label) * delta >= 0.0));
            }
            // Without a dead band the change is that of two frames.
            for (k, (label, delta)) in labels(&h, 0.0).into_iter().enumerate() {
                prop_assert!(label == 0 || delta == h[k] - h[k - 1]);
            }
        }
    }
}
