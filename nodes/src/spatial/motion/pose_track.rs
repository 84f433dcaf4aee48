//! The trajectory of a body, read from CSV.

use super::pose::{MAX_COORDINATE, Pose};
use crate::core::files::excerpt;
use crate::core::time::{Rate, Tick, seconds, ticks};
use thiserror::Error;

/// Largest number of rows of a file.
pub const MAX_POSES: usize = 1 << 22;
/// Largest time of a pose, in s.
const MAX_TIME: f64 = 86_400.0;
const POSITION: [&str; 3] = ["x", "y", "z"];
const ROTATION: [&str; 4] = ["qw", "qx", "qy", "qz"];

/// The reason why poses cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {message}")]
pub struct PoseFileError {
    /// Line of the file, from 1.
    pub line: u64,
    /// The value that was found and the valid values.
    pub message: String,
}

/// Poses at increasing times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseTrack {
    poses: Vec<(Tick, Pose)>,
}

impl PoseTrack {
    /// Makes a trajectory of poses at a rate, from 0 on.
    #[must_use]
    pub fn at_rate(poses: impl IntoIterator<Item = Pose>, rate: Rate) -> Self {
        Self { poses: (0..).zip(poses).map(|(k, pose)| (rate.tick(k), pose)).collect() }
    }

    /// Makes a trajectory of poses at increasing times in s.
    #[must_use]
    pub fn at_times(poses: impl IntoIterator<Item = (f64, Pose)>) -> Self {
        // Differences of ticks do not overflow.
        let tick = |time| ticks(time).clamp(Tick::MIN / 4, Tick::MAX / 4);
        Self { poses: poses.into_iter().map(|(time, pose)| (tick(time), pose)).collect() }
    }

    /// Returns the time of the last pose.
    #[must_use]
    pub fn end(&self) -> Tick {
        self.poses.last().map_or(0, |(tick, _)| *tick)
    }

    /// Returns the time of each pose in s.
    #[must_use]
    pub fn times(&self) -> Vec<f64> {
        self.poses.iter().map(|(tick, _)| seconds(*tick)).collect()
    }

    /// Returns the pose at a time. Between rows positions are interpolated linearly and orientations by slerp; before the first and after
    /// the last row the pose is constant.
    #[must_use]
    pub fn at(&self, tick: Tick) -> Pose {
        let after = self.poses.partition_point(|(t, _)| *t <= tick);
        let row = |k: usize| self.poses.get(k).copied();
        match (after.checked_sub(1).and_then(row), row(after)) {
            (Some((from, a)), Some((to, b))) => {
                let t = (tick - from) as f64 / (to - from) as f64;
                let rotation = Pose::interpolate([a, a, b, b], t).rotation;
                let coordinate =
                    |k: usize| f64::from(a.position[k]) + t * f64::from(b.position[k] - a.position[k]);
                Pose { position: std::array::from_fn(|k| coordinate(k) as f32), rotation }
            }
            (Some((_, pose)), None) | (None, Some((_, pose))) => pose,
            (None, None) => Pose::default(),
        }
    }

    /// Writes the poses from frame `first` on at a rate.
    pub(crate) fn fill(&self, first: i64, rate: Rate, out: &mut [Pose]) {
        for (k, out) in (first..).zip(out) {
            *out = self.at(rate.tick(k));
        }
    }

    /// Returns the number of frames from 0 to the end, inclusive, at a rate.
    #[must_use]
    pub fn frames(&self, rate: Rate) -> i64 {
        rate.first_at(self.end() + 1)
    }
}

/// Column indices of a file.
struct Columns {
    time: usize,
    position: [usize; 3],
    rotation: Option<[usize; 4]>,
    names: Vec<String>,
}

impl Columns {
    fn of(names: Vec<String>) -> Result<Self, String> {
        let known = |name: &str| {
            name == "time_s" || POSITION.contains(&name) || ROTATION.contains(&name) || name == "comment"
        };
        if let Some(name) = names.iter().find(|name| !known(name)) {
            return Err(format!(
                "there is no column {:?}; columns are time_s, x, y, z, qw, qx, qy, qz, comment",
                excerpt(name)
            ));
        }
        let find = |name: &str| names.iter().position(|n| n == name);
        let need = |name: &str| find(name).ok_or_else(|| format!("there is no column `{name}`"));
        let time = need("time_s")?;
        let position = [need("x")?, need("y")?, need("z")?];
        let rotated = ROTATION.iter().any(|name| find(name).is_some());
        let rotation =
            if rotated { Some([need("qw")?, need("qx")?, need("qy")?, need("qz")?]) } else { None };
        if (1..names.len()).any(|k| names[..k].contains(&names[k])) {
            return Err("a column is given twice".into());
        }
        Ok(Self { time, position, rotation, names })
    }

    fn number(&self, row: &csv::StringRecord, k: usize, low: f64, high: f64) -> Result<f64, String> {
        let text = row.get(k).unwrap_or_default();
        let value = text.parse::<f64>().ok().filter(|x| (low..=high).contains(x));
        value.ok_or_else(|| {
            format!("`{}` is {:?}; a number from {low} to {high} is needed", self.names[k], excerpt(text))
        })
    }

    fn pose(&self, row: &csv::StringRecord) -> Result<(f64, Pose), String> {
        let time = self.number(row, self.time, 0.0, MAX_TIME)?;
        let mut pose = Pose::default();
        for (out, k) in pose.position.iter_mut().zip(self.position) {
            let max = f64::from(MAX_COORDINATE);
            *out = self.number(row, k, -max, max)? as f32;
        }
        let Some(columns) = self.rotation else { return Ok((time, pose)) };
        let mut q = [0.0; 4];
        for (out, k) in q.iter_mut().zip(columns) {
            *out = self.number(row, k, -1e3, 1e3)?;
        }
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length < 1e-6 {
            return Err("the rotation is 0; a quaternion of length 1 is needed, such as 1, 0, 0, 0".into());
        }
        pose.rotation = q.map(|x| (x / length) as f32);
        Ok((time, pose))
    }
}

/// Reads poses from CSV with a header: `time_s`, `x`, `y`, `z` and, if the body turns, `qw`, `qx`, `qy`, `qz`.
///
/// # Errors
/// A missing or unknown column, a field that is not a number or out of range, times that do not increase, and no rows.
/// The error states the line and the valid values.
///
/// # Example
/// ```
/// use foley_nodes::{core::time::ticks, spatial::read_poses};
///
/// let poses = read_poses(b"time_s,x,y,z\n0,0,0,0\n2,1,0,4\n")?;
/// assert_eq!(poses.at(ticks(1.0)).position, [0.5, 0.0, 2.0]);
/// # Ok::<(), foley_nodes::spatial::PoseFileError>(())
/// ```
pub fn read_poses(bytes: &[u8]) -> Result<PoseTrack, PoseFileError> {
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let bad = |e: csv::Error| PoseFileError {
        line: e.position().map_or(1, csv::Position::line),
        message: match e.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("{len} field(s) where the header has {expected_len}")
            }
            csv::ErrorKind::Utf8 { .. } => "not UTF-8 text".into(),
            _ => "not comma-separated text".into(),
        },
    };
    let header = csv.headers().map_err(bad)?;
    let line = header.position().map_or(1, csv::Position::line);
    let columns = Columns::of(header.iter().map(str::to_owned).collect())
        .map_err(|message| PoseFileError { line, message })?;
    let mut poses: Vec<(Tick, Pose)> = Vec::new();
    for row in csv.records() {
        let row = row.map_err(bad)?;
        let line = row.position().map_or(0, csv::Position::line);
        let wrong = |message: String| PoseFileError { line, message };
        let (time, pose) = columns.pose(&row).map_err(wrong)?;
        let tick = ticks(time);
        if poses.last().is_some_and(|(last, _)| tick <= *last) {
            return Err(wrong(format!("time does not increase at {time} s; rows must be in order of time")));
        }
        if poses.len() == MAX_POSES {
            return Err(wrong(format!("a file has at most {MAX_POSES} poses")));
        }
        poses.push((tick, pose));
    }
    if poses.is_empty() {
        return Err(PoseFileError { line, message: "there is no pose after the header".into() });
    }
    Ok(PoseTrack { poses })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_linear_and_rotations_uniform_between_rows() {
        let text = "qz, time_s, x, y, z, qw, qx, qy, comment\n0,1,0,0,0,2,0,0,start\n0.70710678,3,4,2,0,0.70710678,0,0,\n";
        let poses = read_poses(text.as_bytes()).unwrap();
        assert_eq!(poses.at(ticks(0.0)), Pose::at([0.0; 3]));
        assert_eq!(poses.at(ticks(2.0)).position, [2.0, 1.0, 0.0]);
        let front = poses.at(ticks(2.0)).to_scene([1.0, 0.0, 0.0]);
        let half = 45_f64.to_radians();
        assert!((front[0] - 2.0 - half.cos()).abs() < 1e-6 && (front[1] - 1.0 - half.sin()).abs() < 1e-6);
        assert_eq!(poses.at(ticks(9.0)).position, [4.0, 2.0, 0.0]);
        assert_eq!(poses.frames(Rate::hz(10)), 31);
    }

    #[test]
    fn errors_name_the_line_and_the_reason() {
        for (text, line, part) in [
            ("", 1, "time_s"),
            ("time_s,x,y\n", 1, "`z`"),
            ("time_s,x,y,z,q\n", 1, "\"q\""),
            ("time_s,x,y,z,qw\n0,0,0,0,1\n", 1, "`qx`"),
            ("time_s,x,y,z,z\n0,0,0,0,1\n", 1, "twice"),
            ("time_s,x,y,z\n", 1, "no pose"),
            ("time_s,x,y,z\n0,0,0,0\n0,1,1,1\n", 3, "in order"),
            ("time_s,x,y,z\n0,0,0,0\n1,inf,1,1\n", 3, "`x`"),
            ("time_s,x,y,z\n0,0,0\n", 2, "3 field(s)"),
            ("time_s,x,y,z,qw,qx,qy,qz\n0,0,0,0,0,0,0,0\n", 2, "rotation is 0"),
        ] {
            let e = read_poses(text.as_bytes()).unwrap_err();
            assert!(e.line == line && e.message.contains(part), "{text:?}: {e}");
        }
        assert!(read_poses(&[0xff, 0xfe, 0, 1]).is_err());
    }
}
