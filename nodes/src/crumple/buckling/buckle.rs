//! Which vertices snap from one side to the other between two frames.

use serde::{Deserialize, Serialize};

use crate::curvature::{Curvature, Method};
use crate::impl_state;

/// Whether one vertex snaps in one frame, and by how much.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Buckle {
    /// 1 where the curvature rises above 0, -1 where it falls below, 0 elsewhere.
    pub label: i8,
    /// Change of mean curvature since the other side was last certain, 1/m; 0 where nothing snaps.
    pub delta: f64,
    /// Area of the vertex, the mean of this frame and the one before, m^2.
    pub area: f64,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Position, m.
    pub position: [f32; 3],
    /// Dead band that was passed, 1/m.
    pub h_eps: f32,
    /// How the curvature was measured.
    pub method: Method,
}

/// What is kept of a vertex.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Side {
    /// 1 or -1; 0 while no side is certain.
    sign: i8,
    /// Curvature in the last frame in which that side was certain.
    h: f64,
    /// Area in the last frame.
    area: f64,
}

/// Watches on which side of zero the curvature of every vertex is.
///
/// A vertex snaps outwards (label 1) when its curvature was below 0 and is not any more, and inwards (-1) when it was not and is.
/// With a dead band `h_eps` a side counts only while `|H| > h_eps`, and the change is measured from the last frame in
/// which the old side was certain; with 0 that is the frame before. A vertex begins with no side, and loses it in a
/// frame in which its curvature means nothing: then it cannot snap.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3; the dead band is an
/// addition.
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
    sides: Vec<Side>,
}
impl_state!(BuckleDetector { sides });

impl BuckleDetector {
    /// A detector for this many vertices.
    #[must_use]
    pub fn new(vertices: usize, h_eps: f64) -> Self {
        Self { h_eps, sides: vec![Side::default(); vertices] }
    }

    /// Changes the dead band from the next frame on.
    pub fn set_dead_band(&mut self, h_eps: f64) {
        self.h_eps = h_eps;
    }

    /// Goes on as another detector of as many vertices would.
    pub fn take_state(&mut self, old: &Self) {
        if old.sides.len() == self.sides.len() {
            self.sides.copy_from_slice(&old.sides);
        }
    }

    /// Labels the vertices of the next frame, one element each.
    ///
    /// # Complexity
    /// O(V), nothing allocated.
    pub fn detect(&mut self, frame: &[Curvature], out: &mut [Buckle]) {
        for ((side, c), out) in self.sides.iter_mut().zip(frame).zip(out) {
            *out = side.next(c, self.h_eps);
        }
    }
}

impl Side {
    fn next(&mut self, c: &Curvature, h_eps: f64) -> Buckle {
        let mut buckle = Buckle {
            area: 0.5 * (self.area + c.area),
            normal: c.normal,
            position: c.position,
            h_eps: h_eps as f32,
            method: c.method,
            ..Buckle::default()
        };
        let sure = match c.h {
            _ if !c.valid => {
                *self = Self::default();
                return buckle;
            }
            // The paper's rule: zero belongs to the outside.
            h if h_eps == 0.0 => 2 * i8::from(h >= 0.0) - 1,
            h => i8::from(h > h_eps) - i8::from(h < -h_eps),
        };
        self.area = c.area;
        if sure != 0 {
            if self.sign == -sure {
                (buckle.label, buckle.delta) = (sure, c.h - self.h);
            }
            (self.sign, self.h) = (sure, c.h);
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

    /// Labels over all frames, and the valid vertices of the last that lie on either side.
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
        let side = |out: bool| bent.iter().filter(|c| c.valid && (c.h > 0.0) == out).count();
        (count, [side(false), side(true)])
    }

    #[test]
    fn signs_change_as_in_the_paper_and_zero_is_outside() {
        let found = labels(&[-1.0, 0.0, 0.5, -0.25, 0.0, -2.0], 0.0);
        assert_eq!(found, [(0, 0.0), (1, 1.0), (0, 0.0), (-1, -0.75), (1, 0.25), (-1, -2.0)]);
    }

    #[test]
    fn a_frame_without_meaning_forgets_the_side() {
        assert_eq!(labels(&[-1.0, f64::NAN, 1.0, -1.0], 0.0), [(0, 0.0), (0, 0.0), (0, 0.0), (-1, -2.0)]);
    }

    #[test]
    fn in_the_dead_band_the_last_certain_frame_counts() {
        let found = labels(&[-0.05, -1.0, -0.5, -0.05, 0.1, 0.3, 0.05, -0.15, -0.3, 0.1], 0.2);
        let changes: Vec<_> =
            found.iter().enumerate().filter(|(_, f)| f.0 != 0).map(|(k, f)| (k, *f)).collect();
        assert_eq!(changes, [(5, (1, 0.8)), (8, (-1, -0.6))]);
    }

    #[test]
    fn what_only_turns_or_changes_its_size_does_not_snap() {
        // Turning may change the last bits of a curvature, never its sign: none of these sheets is flat to 1e-12 at a vertex.
        for method in [Method::Cotan, Method::Dihedral] {
            for seed in 0..6 {
                let sheet = crumpled(25, seed);
                let tumble = |k: usize| sheet.map(|p| moved(p, 0.37 * k as f64, [0.1 * k as f64, -0.2, 0.3]));
                let (labels, sides) = count(&sheet, &(0..20).map(tumble).collect::<Vec<_>>(), method);
                // The sheet has folds of both kinds: there is something that could snap.
                assert!(labels == 0 && sides.iter().all(|n| *n > 20), "{labels} labels on {sides:?}");
                let breathe = |k: usize| sheet.map(|p| p.map(|x| x * 1.4_f64.powi([0, 3, -5, 8, 1][k % 5])));
                assert_eq!(count(&sheet, &(0..10).map(breathe).collect::<Vec<_>>(), method), (0, sides));
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
