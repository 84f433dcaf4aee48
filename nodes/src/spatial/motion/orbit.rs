//! The node `Orbit`.

use std::f64::consts::TAU;

use super::item::Poses;
use super::pose::{Pose, unit};
use crate::contact::vector::{add, cross, scale};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::{params, ports};

params! {
    /// Moves a body around a point at constant speed; the body faces the point. It provides a source or a listener of known motion.
    ///
    /// The body starts in the direction of the scene's x axis, projected onto the plane of the circle (of y, if the axis is x). It turns
    /// by the right-hand rule about the axis: to the left of a listener who looks along x with z above.
    pub struct OrbitParams {
        /// Centre of the circle.
        centre: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Radius of the circle.
        radius: f64 = 1.0, unit "m", range 0.0..=100_000.0;
        /// Revolutions per second.
        frequency: f64 = 0.25, unit "Hz", range -100.0..=100.0;
        /// Angle at time zero.
        start: f64 = 0.0, unit "degrees", range -360.0..=360.0;
        /// Axis of the circle: a direction of any length.
        axis: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Poses per second.
        rate: Rate = Rate::hz(60);
        /// Length; None is endless.
        duration: Option<f64> = None, unit "s", range 0.0..=86_400.0;
    }
}
ports! {
    pub struct OrbitPorts / OrbitIo {
        in {}
        out {
            /// The poses.
            pose: Stream<Poses>,
        }
    }
}

/// The node `Orbit`.
#[derive(Debug)]
pub struct Orbit {
    /// Axis, direction at angle 0, and direction a quarter turn later.
    axes: [[f64; 3]; 3],
    params: OrbitParams,
}

fn axes(p: &OrbitParams) -> Result<[[f64; 3]; 3], Reject> {
    let reject = || {
        let message = format!("`axis` is {:?}, which has no direction", p.axis);
        Reject::new("F067", message).at("axis").help("write [0, 0, 1] for a circle in the plane of x and y")
    };
    let axis = unit(p.axis).ok_or_else(reject)?;
    let reference = if axis[0].abs() < 0.99 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let quarter = unit(cross(axis, reference)).ok_or_else(reject)?;
    Ok([axis, cross(quarter, axis), quarter])
}

impl Node for Orbit {
    type Params = OrbitParams;
    type Ports = OrbitPorts;
    const NAME: &'static str = "Orbit";
    const CLASS: Class = Class::Audio;

    fn shape(p: &OrbitParams, s: &mut Shape<'_, '_, OrbitPorts>) -> Result<(), Reject> {
        axes(p)?;
        s.ends(p.duration.map(ticks));
        s.output(OrbitPorts::pose, p.rate, ());
        Ok(())
    }

    fn build(p: &OrbitParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { axes: axes(p)?, params: p.clone() })
    }

    fn run(&mut self, mut io: OrbitIo<'_>) -> Result<(), Fault> {
        let (first, period) = (io.pose.first(), 1.0 / io.pose.rate().as_f64());
        let (p, [axis, start, quarter]) = (&self.params, self.axes);
        for (k, out) in (first..).zip(io.pose.items()) {
            // With the fraction the angle stays exact after hours.
            let turns = (p.frequency * k as f64 * period).fract();
            let angle = TAU * turns + p.start.to_radians();
            let offset = add(scale(start, libm::cos(angle)), scale(quarter, libm::sin(angle)));
            let position = add(p.centre, scale(offset, p.radius));
            *out = Pose::looking(position, scale(offset, -1.0), axis).unwrap_or_default();
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (OrbitParams, MemoryFiles) {
        let duration = [None, Some(rng.between(0.0, 0.5))][rng.below(2)];
        let rate = Rate::hz([25, 60, 1000][rng.below(3)]);
        (OrbitParams { duration, rate, ..OrbitParams::trial(rng) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    fn params() -> OrbitParams {
        OrbitParams::read(&|_| None).unwrap()
    }

    #[test]
    fn after_a_quarter_turn_the_body_is_to_the_left_and_faces_the_centre() {
        let p = OrbitParams { centre: [1.0, 2.0, 3.0], radius: 2.0, duration: Some(4.0), ..params() };
        let poses = Standalone::new::<Orbit>(p.clone()).run().unwrap().stream(OrbitPorts::pose);
        assert_eq!(poses.len(), 240);
        assert_eq!(poses[0].position, [3.0, 2.0, 3.0]);
        assert!(poses[60].position.iter().zip([1.0, 4.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-6));
        for pose in poses {
            let centre = pose.to_local(p.centre);
            assert!((centre[0] - 2.0).abs() < 1e-5 && centre[1].abs() < 1e-5 && centre[2].abs() < 1e-5);
        }
    }

    #[test]
    fn other_axes_start_as_documented_and_a_zero_axis_is_refused() {
        let start = |axis| {
            let p = OrbitParams { axis, duration: Some(0.1), ..params() };
            Standalone::new::<Orbit>(p).run().unwrap().stream(OrbitPorts::pose)[0].position
        };
        assert_eq!(start([0.0, 5.0, 0.0]), [1.0, 0.0, 0.0]);
        assert_eq!(start([-1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        let reject =
            Standalone::new::<Orbit>(OrbitParams { axis: [0.0; 3], ..params() }).shape().unwrap_err();
        assert_eq!((reject.code, reject.field.as_deref()), ("F067", Some("axis")));
    }
}
