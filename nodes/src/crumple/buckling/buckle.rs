//! Vertices whose mean curvature changes sign between two frames.

use serde::{Deserialize, Serialize};

use crate::curvature::{Curvature, Method};
use crate::impl_state;

/// The buckling of one vertex in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Buckle {
    /// 1 if the curvature rises above 0, -1 if it falls below 0, 0 if the vertex does not buckle.
    pub label: i8,
    /// Change of mean curvature since the last frame with the other sign, 1/m; 0 if the vertex does not buckle.
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

/// State of a vertex.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SignState {
    /// Sign of the curvature, 1 or -1; 0 while it is unknown.
    sign: i8,
    /// Curvature in the last frame outside of the dead band, 1/m.
    h: f64,
    /// Area in the last frame, m^2.
    area: f64,
}

/// Detects changes of the sign of the mean curvature of every vertex.
///
/// A vertex buckles outwards (label 1) when its curvature `H` changes from below 0 to 0 or above, and inwards (-1) when
/// it changes back. With a dead band `h_eps` the sign is known only while `|H| > h_eps`. The change of curvature is
/// measured from the last frame in which the previous sign was known; without a dead band that is the previous frame.
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
/// let (mut detector, mut found) = (BuckleDetector::new(1, 0.0), [Buckle::default()]);
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
}
impl_state!(BuckleDetector { states });

impl BuckleDetector {
    /// Creates a detector for a number of vertices.
    #[must_use]
    pub fn new(vertices: usize, h_eps: f64) -> Self {
        Self { h_eps, states: vec![SignState::default(); vertices] }
    }

    /// Changes the dead band from the next frame on.
    pub fn set_dead_band(&mut self, h_eps: f64) {
        self.h_eps = h_eps;
    }

    /// Copies the state of a detector of the same number of vertices.
    pub fn take_state(&mut self, old: &Self) {
        if old.states.len() == self.states.len() {
            self.states.copy_from_slice(&old.states);
        }
    }

    /// Detects the buckling vertices of the next frame, one element per vertex.
    ///
    /// # Complexity
    /// O(V); no allocation.
    pub fn detect(&mut self, frame: &[Curvature], out: &mut [Buckle]) {
        for ((state, c), out) in self.states.iter_mut().zip(frame).zip(out) {
            *out = state.next(c, self.h_eps);
        }
    }
}

impl SignState {
    /// Updates the sign with the curvature of the next frame.
    fn next(&mut self, c: &Curvature, h_eps: f64) -> Buckle {
        let mut buckle = Buckle {
            area: 0.5 * (self.area + c.area),
            normal: c.normal,
            position: c.position,
            h_eps: h_eps as f32,
            method: c.method,
            ..Buckle::default()
        };
        let sign = match c.h {
            _ if !c.valid => {
                *self = Self::default();
                return buckle;
            }
            // The paper's rule: zero counts as positive.
            h if h_eps == 0.0 => 2 * i8::from(h >= 0.0) - 1,
            h => i8::from(h > h_eps) - i8::from(h < -h_eps),
        };
        self.area = c.area;
        if sign != 0 {
            if self.sign == -sign {
                (buckle.label, buckle.delta) = (sign, c.h - self.h);
            }
            (self.sign, self.h) = (sign, c.h);
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
        let mut detector = BuckleDetector::new(1, h_eps);
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
        let mut detector = BuckleDetector::new(n, 0.0);
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
        let found = labels(&[-0.05, -1.0, -0.5, -0.05, 0.1, 0.3, 0.05, -0.15, -0.3, 0.1], 0.2);
        let changes: Vec<_> =
            found.iter().enumerate().filter(|(_, f)| f.0 != 0).map(|(k, f)| (k, *f)).collect();
        assert_eq!(changes, [(5, (1, 0.8)), (8, (-1, -0.6))]);
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
                // Labels alternate.
                let mut signs = found.iter().map(|f| f.0).filter(|s| *s != 0);
                let mut last = signs.next().unwrap_or(0);
                prop_assert!(signs.all(|s| std::mem::replace(&mut last, s) == -s));
            }
            // Without a dead band the change is that of two frames.
            for (k, (label, delta)) in labels(&h, 0.0).into_iter().enumerate() {
                prop_assert!(label == 0 || delta == h[k] - h[k - 1]);
            }
        }
    }
}
