//! Poses and velocities of bodies, from a file.

use super::bodies::{Bodies, MAX_BODIES};
use super::columns::{Columns, Field, POSES};
use super::error::LogFault;
use super::row::{MAX_ROWS, MAX_TIME};
use super::table::{Cells, read_table};
use crate::contact::vector::{Vec3, add, cross, norm, rotate, rotate_back, scale, sub};
use crate::core::time::{Tick, seconds, ticks};
use std::collections::HashMap;

/// Largest deviation of the length of a quaternion from 1.
const TOLERANCE: f64 = 0.01;

/// Rounding of times in files: about 2 microseconds.
const ROUNDING: Tick = 1500;

/// Pose and velocities of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    pub position: Vec3,
    /// Unit quaternion w, x, y, z.
    pub rotation: [f64; 4],
    /// m/s.
    pub velocity: Vec3,
    /// rad/s.
    pub angular_velocity: Vec3,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
        }
    }
}

impl Motion {
    /// Converts a world point to the body's frame.
    pub fn to_local(self, point: Vec3) -> Vec3 {
        rotate_back(self.rotation, sub(point, self.position))
    }

    /// Converts a point of the body's frame to the world.
    pub fn to_world(self, point: Vec3) -> Vec3 {
        add(self.position, rotate(self.rotation, point))
    }

    /// Velocity of the body's material at a world point.
    pub fn velocity_at(&self, point: Vec3) -> Vec3 {
        add(self.velocity, cross(self.angular_velocity, sub(point, self.position)))
    }
}

/// Motion of one body over time.
type Track = Vec<(Tick, Motion)>;

/// Poses of all bodies of a scene over time.
#[derive(Clone, Debug, Default)]
pub(super) struct Poses {
    tracks: HashMap<u32, Track>,
    /// True if the file has velocities.
    has_velocities: bool,
}

/// Rotation vector from orientation `a` to `b`: axis times angle.
fn rotation_vector(a: [f64; 4], b: [f64; 4]) -> Vec3 {
    let ([aw, ax, ay, az], [bw, bx, by, bz]) = (a, b);
    let w = bw * aw + bx * ax + by * ay + bz * az;
    let v = [
        bx * aw - bw * ax - by * az + bz * ay,
        by * aw - bw * ay - bz * ax + bx * az,
        bz * aw - bw * az - bx * ay + by * ax,
    ];
    let (size, sign) = (norm(v), if w < 0.0 { -1.0 } else { 1.0 });
    if size < 1e-12 { [0.0; 3] } else { scale(v, sign * 2.0 * size.atan2(w.abs()) / size) }
}

/// Linear interpolation, normalised for the rotation.
fn interpolate(a: &Motion, b: &Motion, t: f64) -> Motion {
    let lerp = |a: Vec3, b: Vec3| add(a, scale(sub(b, a), t));
    let cosine: f64 = a.rotation.iter().zip(b.rotation).map(|(a, b)| a * b).sum();
    let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
    let mut rotation = [0.0; 4];
    for (k, q) in rotation.iter_mut().enumerate() {
        *q = a.rotation[k] * (1.0 - t) + sign * b.rotation[k] * t;
    }
    let length = rotation.iter().map(|q| q * q).sum::<f64>().sqrt().max(1e-9);
    Motion {
        position: lerp(a.position, b.position),
        rotation: rotation.map(|q| q / length),
        velocity: lerp(a.velocity, b.velocity),
        angular_velocity: lerp(a.angular_velocity, b.angular_velocity),
    }
}

impl Poses {
    /// Motion of a body in the row of a time, if the file has velocities and a row within a few microseconds.
    pub fn row_at(&self, body: u32, tick: Tick) -> Option<Motion> {
        let track = self.tracks.get(&body).filter(|_| self.has_velocities)?;
        let after = track.partition_point(|(t, _)| *t <= tick + ROUNDING);
        track.get(after.checked_sub(1)?).filter(|(t, _)| tick - *t <= ROUNDING).map(|(_, motion)| *motion)
    }

    /// Returns true if the file has a body.
    pub fn has(&self, body: u32) -> bool {
        self.tracks.contains_key(&body)
    }

    /// Motion of a body at a time; `None` for a body that is not in the file.
    pub fn at(&self, body: u32, tick: Tick) -> Option<Motion> {
        let track = self.tracks.get(&body)?;
        let after = track.partition_point(|(t, _)| *t <= tick);
        let row = |k: usize| track.get(k).map(|(t, m)| (*t, m));
        match (after.checked_sub(1).and_then(row), row(after)) {
            (Some((from, a)), Some((to, b))) => {
                let motion = interpolate(a, b, (tick - from) as f64 / (to - from) as f64);
                if self.has_velocities {
                    return Some(motion);
                }
                let per_second = 1.0 / seconds(to - from);
                let velocity = scale(sub(b.position, a.position), per_second);
                let angular_velocity = scale(rotation_vector(a.rotation, b.rotation), per_second);
                Some(Motion { velocity, angular_velocity, ..motion })
            }
            (Some((_, one)), None) | (None, Some((_, one))) => Some(*one),
            (None, None) => None,
        }
    }
}

fn motion(cells: &Cells<'_>) -> Result<Motion, LogFault> {
    let position = cells.vector([Field::Px, Field::Py, Field::Pz])?;
    let mut motion = Motion { position, ..Motion::default() };
    if cells.columns.has(Field::Qw) {
        let [x, y, z] = cells.vector([Field::Qx, Field::Qy, Field::Qz])?;
        let q = [cells.number(Field::Qw)?, x, y, z];
        let length = q.iter().map(|q| q * q).sum::<f64>().sqrt();
        if (length - 1.0).abs() > TOLERANCE {
            let message = format!("the quaternion has length {length:.3}; one of length 1 is needed");
            return Err(cells.fault(Field::Qw, message));
        }
        motion.rotation = q.map(|q| q / length);
    }
    if cells.columns.has(Field::Vx) {
        motion.velocity = cells.vector([Field::Vx, Field::Vy, Field::Vz])?;
    }
    if cells.columns.has(Field::Wx) {
        motion.angular_velocity = cells.vector([Field::Wx, Field::Wy, Field::Wz])?;
    }
    Ok(motion)
}

/// Description of a column that the header lacks.
fn missing_column(columns: &Columns) -> Option<&'static str> {
    let all_or_none = |fields: &[Field]| columns.has_all(fields) || !fields.iter().any(|f| columns.has(*f));
    if !columns.has(Field::Time) {
        Some("`time`, in seconds")
    } else if !columns.has(Field::NameA) && !columns.has(Field::BodyA) {
        Some("the body: `name` or `body`")
    } else if !columns.has_all(&[Field::Px, Field::Py, Field::Pz]) {
        Some("where the body is: `px`, `py`, `pz`")
    } else if !all_or_none(&[Field::Qw, Field::Qx, Field::Qy, Field::Qz]) {
        Some("all of the rotation: `qw`, `qx`, `qy`, `qz`")
    } else if !all_or_none(&[Field::Vx, Field::Vy, Field::Vz, Field::Wx, Field::Wy, Field::Wz]) {
        Some("all of the velocity: `vx`, `vy`, `vz` and, in rad/s, `wx`, `wy`, `wz`")
    } else {
        None
    }
}

/// Reads a CSV file of poses.
pub(super) fn read_poses(bytes: &[u8], bodies: &mut Bodies) -> Result<Poses, LogFault> {
    let mut poses = Poses::default();
    let mut rows = 0;
    let check = |columns: &Columns, line: u64| match missing_column(columns) {
        None => Ok(()),
        Some(what) => Err(LogFault::new(line, format!("there is no column for {what}"))),
    };
    let mut has_velocities = false;
    read_table(bytes, POSES, check, |cells| {
        let time = cells.number(Field::Time)?;
        if !(0.0..=MAX_TIME).contains(&time) {
            return Err(cells.fault(Field::Time, format!("{time} s is there; 0 to {MAX_TIME} s are needed")));
        }
        has_velocities = cells.columns.has(Field::Vx);
        let (name, number) = (cells.text(Field::NameA)?, cells.text(Field::BodyA)?);
        let Some(text) = name.or(number) else {
            return Err(LogFault::new(cells.line, "the body has no name; one is needed"));
        };
        let number = number.or(Some(text)).and_then(|t| t.parse().ok());
        let body = bodies.number(text, number);
        let body = body.ok_or_else(|| LogFault::new(cells.line, format!("more than {MAX_BODIES} bodies")))?;
        let track = poses.tracks.entry(body).or_default();
        let tick = ticks(time);
        if track.last().is_some_and(|(last, _)| tick <= *last) {
            let message = format!(
                "time does not increase at {time} s for `{text}`; the rows of a body must be in order"
            );
            return Err(cells.fault(Field::Time, message));
        }
        rows += 1;
        if rows > MAX_ROWS {
            return Err(LogFault::new(cells.line, format!("at most {MAX_ROWS} rows are read")));
        }
        track.push((tick, motion(cells)?));
        Ok(())
    })?;
    if rows == 0 {
        return Err(LogFault::new(1, "there is no pose under the header"));
    }
    poses.has_velocities = has_velocities;
    Ok(poses)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Poses, LogFault> {
        read_poses(text.as_bytes(), &mut Bodies::new(&[]))
    }

    #[test]
    fn quaternions_are_read_by_their_header_in_either_order() {
        let first = read("time,body,px,py,pz,qw,qx,qy,qz\n0,1,1,2,3,0.6,0,0,0.8\n").unwrap();
        let last = read("time,body,px,py,pz,qx,qy,qz,qw\n0,1,1,2,3,0,0,0.8,0.6\n").unwrap();
        assert_eq!(first.at(1, 0), last.at(1, 0));
        // A rotation by 106.26 degrees about z.
        let x = first.at(1, 0).unwrap().to_local([1.0 - 0.28, 2.0 + 0.96, 3.0]);
        assert!(norm(sub(x, [1.0, 0.0, 0.0])) < 1e-9, "{x:?}");
    }

    #[test]
    fn velocities_are_computed_from_poses_if_the_file_has_none() {
        let (s, c) = (0.05_f64.sin(), 0.05_f64.cos());
        let text = format!("time,body,px,py,pz,qw,qx,qy,qz\n0,1,0,0,0,1,0,0,0\n0.1,1,0.2,0,0,{c},0,0,{s}\n");
        let motion = read(&text).unwrap().at(1, ticks(0.05)).unwrap();
        assert!(norm(sub(motion.velocity, [2.0, 0.0, 0.0])) < 1e-9, "{motion:?}");
        assert!(norm(sub(motion.angular_velocity, [0.0, 0.0, 1.0])) < 1e-9, "{motion:?}");
        assert!(norm(sub(motion.velocity_at([0.1, 1.0, 0.0]), [1.0, 0.0, 0.0])) < 1e-9);
    }

    #[test]
    fn errors_have_line_and_column() {
        for (text, part) in [
            ("time,body,px,py\n0,1,0,0\n", "line 1: there is no column for where"),
            ("time,body,px,py,pz,qw\n", "line 1: there is no column for all of the rotation"),
            (
                "time,body,px,py,pz,qw,qx,qy,qz\n0,1,0,0,0,0.5,0,0,0\n",
                "line 2, column `qw`: the quaternion has length 0.5",
            ),
            ("time,body,px,py,pz\n0,1,0,0,inf\n", "line 2, column `pz`: \"inf\" is there"),
            (
                "time,body,px,py,pz\n1,1,0,0,0\n1,2,0,0,0\n1,1,0,0,0\n",
                "line 4, column `time`: time does not increase",
            ),
            ("time,body,px,py,pz\n", "no pose"),
            ("time,body,px,py,pz,roll\n", "column `roll`: there is no such column"),
        ] {
            let e = read(text).unwrap_err().to_string();
            assert!(e.contains(part), "{text:?}: {e}");
        }
    }
}
