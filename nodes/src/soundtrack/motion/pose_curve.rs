//! The node `PoseCurve`.

use crate::contact::vector::{dot, norm, scale, sub};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, same_rate};
use crate::core::ports::{In, Stream};
use crate::core::shape::{Build, Shape};
use crate::spatial::{Pose, Poses};
use crate::{choices, params, ports};

choices! {
    /// A measure of a motion.
    pub enum PoseMeasure {
        /// Position, three channels, m.
        Position,
        /// Height above the origin, m.
        Height,
        /// Speed, m/s.
        Speed,
        /// Magnitude of the acceleration, m/s^2.
        Acceleration,
        /// Curvature of the path, 1/m; 0 at rest.
        Curvature,
        /// Distance from the other body, m.
        Distance,
        /// Speed of approach to the other body, m/s; negative when they part.
        Approach,
    }
}

params! {
    /// Derives a curve from the poses of a body: position, speed, acceleration, curvature of the path, distance from another body.
    ///
    /// Derivatives are central differences over `span` frames on each side.
    pub struct PoseCurveParams {
        /// The measured quantity.
        measure: PoseMeasure = PoseMeasure::Speed;
        /// Frames on each side that a derivative is taken over.
        span: usize = 1, unit "frames", range 1..=1000;
        /// Factor on the measure.
        gain: f64 = 1.0, unit "", range -1.0e6..=1.0e6_f64;
    }
}
ports! {
    pub struct PoseCurvePorts / PoseCurveIo {
        in {
            /// The body.
            pose: Stream<Poses>,
            /// Another body.
            other: Option<Stream<Poses>>,
        }
        out {
            /// The measure.
            curve: Stream<f32>,
        }
    }
}

/// Speed below which a path has no curvature, m/s.
const AT_REST: f64 = 1e-3;

/// The node `PoseCurve`.
#[derive(Debug)]
pub struct PoseCurve {
    params: PoseCurveParams,
    end: Option<i64>,
}

/// Positions before, at and after a frame, and the frames between the outer ones. Beyond the ends are the first and the last position.
struct Around {
    before: [f64; 3],
    at: [f64; 3],
    after: [f64; 3],
    frames: [f64; 2],
}

impl Around {
    fn new(poses: &In<'_, Poses>, k: usize, span: usize, end: Option<i64>) -> Self {
        let index = poses.first() + k as i64;
        let position = |shift: i64| {
            poses
                .item((k as i64 + shift) as isize)
                .first()
                .map_or([0.0; 3], |pose: &Pose| pose.position.map(f64::from))
        };
        let behind = (span as i64).min(index.max(0));
        let ahead = end.map_or(span as i64, |end| (span as i64).min((end - 1 - index).max(0)));
        Self {
            before: position(-behind),
            at: position(0),
            after: position(ahead),
            frames: [behind as f64, ahead as f64],
        }
    }

    /// Velocity, m/s.
    fn velocity(&self, rate: f64) -> [f64; 3] {
        scale(sub(self.after, self.before), rate / (self.frames[0] + self.frames[1]).max(1.0))
    }

    /// Acceleration, m/s^2; 0 at the ends.
    fn acceleration(&self, rate: f64) -> [f64; 3] {
        let [a, b] = self.frames;
        if a != b || a == 0.0 {
            return [0.0; 3];
        }
        let second = std::array::from_fn(|c| self.after[c] - 2.0 * self.at[c] + self.before[c]);
        scale(second, (rate / a).powi(2))
    }
}

impl Node for PoseCurve {
    type Params = PoseCurveParams;
    type Ports = PoseCurvePorts;
    const NAME: &'static str = "PoseCurve";
    const CLASS: Class = Class::Audio;

    fn shape(p: &PoseCurveParams, s: &mut Shape<'_, '_, PoseCurvePorts>) -> Result<(), Reject> {
        let pose = s.input(PoseCurvePorts::pose);
        let needs_other = matches!(p.measure, PoseMeasure::Distance | PoseMeasure::Approach);
        match s.optional(PoseCurvePorts::other) {
            Some(other) => same_rate("other", other.rate, "`pose`", pose.rate)?,
            None if needs_other => {
                let message =
                    format!("`measure: {:?}` is between two bodies, and `other` is not linked", p.measure);
                return Err(Reject::new("F157", message)
                    .at("other")
                    .help("link the poses of the other body"));
            }
            None => {}
        }
        s.lookaround(PoseCurvePorts::pose, p.span, p.span);
        s.lookaround(PoseCurvePorts::other, p.span, p.span);
        let channels = if p.measure == PoseMeasure::Position { 3 } else { 1 };
        s.output(PoseCurvePorts::curve, pose.rate, Channels(channels));
        Ok(())
    }

    fn build(p: &PoseCurveParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { params: p.clone(), end: cx.input(PoseCurvePorts::pose).items() })
    }

    fn run(&mut self, mut io: PoseCurveIo<'_>) -> Result<(), Fault> {
        let (rate, width) = (io.pose.rate().as_f64(), io.curve.width());
        let PoseCurveParams { measure, span, gain } = self.params.clone();
        for (k, out) in io.curve.items().chunks_exact_mut(width).enumerate() {
            let own = Around::new(&io.pose, k, span, self.end);
            let relative = || {
                let other = io.other.as_ref().map(|other| Around::new(other, k, span, self.end));
                let (at, velocity) = other.map_or(([0.0; 3], [0.0; 3]), |o| (o.at, o.velocity(rate)));
                (sub(own.at, at), sub(own.velocity(rate), velocity))
            };
            let value = match measure {
                PoseMeasure::Position => {
                    out.iter_mut().zip(own.at).for_each(|(out, x)| *out = (gain * x) as f32);
                    continue;
                }
                PoseMeasure::Height => own.at[2],
                PoseMeasure::Speed => norm(own.velocity(rate)),
                PoseMeasure::Acceleration => norm(own.acceleration(rate)),
                PoseMeasure::Curvature => {
                    let (v, a) = (own.velocity(rate), own.acceleration(rate));
                    let speed = norm(v);
                    let along = dot(v, a);
                    let across = (dot(a, a) * speed * speed - along * along).max(0.0).sqrt();
                    if speed > AT_REST { across / speed.powi(3) } else { 0.0 }
                }
                PoseMeasure::Distance => norm(relative().0),
                PoseMeasure::Approach => {
                    let (distance, velocity) = relative();
                    let length = norm(distance);
                    if length > 0.0 { -dot(distance, velocity) / length } else { 0.0 }
                }
            };
            out.fill((gain * value) as f32);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::feed::Feed;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};

    const RATE: Rate = Rate::hz(100);

    fn measured(measure: PoseMeasure, path: impl Fn(f64) -> [f64; 3]) -> Vec<f32> {
        let poses: Vec<Pose> =
            (0..100).map(|k| Pose::at(path(f64::from(k) / 100.0).map(|x| x as f32))).collect();
        let p = PoseCurveParams { measure, ..PoseCurveParams::read(&|_| None).unwrap() };
        let run = |window: f64| {
            Standalone::new::<PoseCurve>(p.clone())
                .input(PoseCurvePorts::pose, RATE, (), poses.clone())
                .feed(
                    PoseCurvePorts::other.index(),
                    Feed::stream::<Poses>(RATE, (), vec![Pose::at([0.0; 3]); 100]),
                )
                .window(ticks(window))
                .run()
                .unwrap()
                .stream(PoseCurvePorts::curve)
        };
        let whole = run(10.0);
        assert_eq!(run(0.033), whole);
        whole
    }

    #[test]
    fn a_circle_has_the_curvature_of_its_radius() {
        let circle = |t: f64| [0.5 * (3.0 * t).cos(), 0.5 * (3.0 * t).sin(), t];
        let speed = (1.5_f64.powi(2) + 1.0).sqrt();
        for (measure, expected) in [
            (PoseMeasure::Speed, speed),
            (PoseMeasure::Acceleration, 4.5),
            (PoseMeasure::Curvature, 4.5 / speed.powi(2)),
        ] {
            let found = measured(measure, circle);
            for x in &found[5..95] {
                assert!((f64::from(*x) / expected - 1.0).abs() < 2e-3, "{measure:?}: {x} {expected}");
            }
        }
        assert!((measured(PoseMeasure::Height, circle)[50] - 0.5).abs() < 1e-6);
        assert!((measured(PoseMeasure::Distance, circle)[50] - 0.5_f32.hypot(0.5)).abs() < 1e-6);
        assert_eq!(measured(PoseMeasure::Position, circle).len(), 300);
    }

    #[test]
    fn bodies_that_come_closer_approach() {
        let found = measured(PoseMeasure::Approach, |t| [3.0 - 2.0 * t, 0.0, 0.0]);
        assert!(found.iter().all(|x| (x - 2.0).abs() < 1e-3), "{found:?}");
        assert!(measured(PoseMeasure::Curvature, |_| [1.0, 2.0, 3.0]).iter().all(|x| *x == 0.0));
    }
}
