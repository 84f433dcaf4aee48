//! Speed and angle of the roller over time, from its encoder.

use std::f64::consts::{PI, TAU};

use thiserror::Error;

/// The readings of the encoder.
#[derive(Clone, Debug, PartialEq)]
pub enum Reading {
    /// Surface speed in m/s.
    Speed(Vec<f64>),
    /// Angle in radians, cumulative or wrapped; successive angles differ by less than half a turn.
    Angle(Vec<f64>),
}

/// Samples of the encoder: strictly increasing times on the clock of the recording, with one reading each.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderTrack {
    /// Times in seconds; 0 is the first sample of the recording.
    pub times: Vec<f64>,
    /// Readings.
    pub reading: Reading,
}

/// Reasons why encoder samples cannot be read or used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EncoderError {
    /// A first line that does not name the columns.
    #[error("line 1: the header is `{found}`; `time_s,speed_m_s` or `time_s,angle_rad` is needed")]
    Header {
        /// Header found.
        found: String,
    },
    /// A field that is not a finite number.
    #[error("line {line}: `{found}` in column `{column}` is not a finite number")]
    Number {
        /// Line in the file, from 1.
        line: u64,
        /// Name of the column.
        column: &'static str,
        /// Text of the field.
        found: String,
    },
    /// A line with more or fewer fields than the header, or that is not text.
    #[error("line {line}: {message}")]
    Line {
        /// Line in the file, from 1.
        line: u64,
        /// Description of the error.
        message: String,
    },
    /// A time that is not after the previous one.
    #[error("encoder sample {index} is at {found} s, not after {previous} s; times must increase")]
    Order {
        /// Index of the sample, from 0.
        index: usize,
        /// Time of the sample.
        found: f64,
        /// Previous time.
        previous: f64,
    },
    /// A reading that is negative (speed) or not finite.
    #[error("encoder sample {index} reads {found}; readings must be finite, and speeds not negative")]
    Value {
        /// Index of the sample, from 0.
        index: usize,
        /// Reading of the sample.
        found: f64,
    },
    /// Fewer than 2 samples, or not one reading per time.
    #[error(
        "encoder has {times} times and {readings} readings; at least 2 of each, in equal number, are needed"
    )]
    Count {
        /// Times found.
        times: usize,
        /// Readings found.
        readings: usize,
    },
    /// A required radius that is not above 0.
    #[error("roller radius is {found} m; angles and seams need the radius with the cloth, above 0")]
    Radius {
        /// The radius.
        found: f64,
    },
}

/// The quantity that an encoder signal measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Signal {
    /// Surface speed, as from a tachometer; its absolute value is used.
    #[default]
    Speed,
    /// Angle, cumulative or wrapped at whole turns.
    Angle,
}

impl EncoderTrack {
    /// Returns the track of a signal with `rate` samples per second, the first at time 0.
    ///
    /// `full_scale` is the reading of a sample of 1, in m/s or radians.
    #[must_use]
    pub fn from_signal(samples: &[f32], rate: f64, signal: Signal, full_scale: f64) -> Self {
        let scaled = |x: &f32| full_scale * f64::from(*x);
        Self {
            times: (0..samples.len()).map(|i| i as f64 / rate).collect(),
            reading: match signal {
                Signal::Speed => Reading::Speed(samples.iter().map(|x| scaled(x).abs()).collect()),
                Signal::Angle => Reading::Angle(samples.iter().map(scaled).collect()),
            },
        }
    }

    /// Parses a CSV with the header `time_s,speed_m_s` or `time_s,angle_rad`.
    ///
    /// # Errors
    /// Names the line, from 1, and its wrong content.
    pub fn from_csv(bytes: &[u8]) -> Result<Self, EncoderError> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
        let bad_line = |e: csv::Error| EncoderError::Line {
            line: e.position().map_or(1, csv::Position::line),
            message: match e.kind() {
                csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                    format!("{len} field(s) where the header has {expected_len}")
                }
                csv::ErrorKind::Utf8 { .. } => "not UTF-8 text".to_owned(),
                _ => "not comma-separated text".to_owned(),
            },
        };
        let header: Vec<&str> = reader.headers().map_err(bad_line)?.iter().collect();
        let column = match header[..] {
            ["time_s", "speed_m_s"] => "speed_m_s",
            ["time_s", "angle_rad"] => "angle_rad",
            _ => return Err(EncoderError::Header { found: header.join(",").chars().take(80).collect() }),
        };
        let (mut times, mut values) = (Vec::new(), Vec::new());
        for record in reader.records() {
            let record = record.map_err(bad_line)?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |i: usize, column| {
                let field = record.get(i).unwrap_or_default();
                let found = || field.chars().take(40).collect();
                let value = field.parse::<f64>().ok().filter(|x| x.is_finite());
                value.ok_or_else(|| EncoderError::Number { line, column, found: found() })
            };
            times.push(number(0, "time_s")?);
            values.push(number(1, column)?);
        }
        let reading = if column == "speed_m_s" { Reading::Speed(values) } else { Reading::Angle(values) };
        Ok(Self { times, reading })
    }

    /// Returns surface speed and angle as functions of time, for a roller of `radius` metres with the cloth on it.
    ///
    /// Speeds are integrated to angles, from 0 at the first sample. The speed of angles is their central difference
    /// times the radius. The angle is known only if the radius is above 0.
    ///
    /// # Errors
    /// When times do not increase, readings are not finite, or angles have no radius.
    pub fn motion(&self, radius: f64) -> Result<Motion, EncoderError> {
        let (Reading::Speed(values) | Reading::Angle(values)) = &self.reading;
        let n = self.times.len();
        if n < 2 || values.len() != n {
            return Err(EncoderError::Count { times: n, readings: values.len() });
        }
        for (i, pair) in self.times.windows(2).enumerate() {
            if !(pair[1] > pair[0] && pair[0].is_finite() && pair[1].is_finite()) {
                return Err(EncoderError::Order { index: i + 1, found: pair[1], previous: pair[0] });
            }
        }
        let speeds_given = matches!(self.reading, Reading::Speed(_));
        if let Some(index) = values.iter().position(|v| !v.is_finite() || (speeds_given && *v < 0.0)) {
            return Err(EncoderError::Value { index, found: values[index] });
        }
        let has_radius = radius.is_finite() && radius > 0.0;
        if !(has_radius || speeds_given && radius == 0.0) {
            return Err(EncoderError::Radius { found: radius });
        }
        let times = self.times.clone();
        let (speed, angle) = if speeds_given {
            let mut angle = vec![0.0; if has_radius { n } else { 0 }];
            for i in 1..angle.len() {
                let mean = 0.5 * (values[i] + values[i - 1]);
                angle[i] = angle[i - 1] + mean * (times[i] - times[i - 1]) / radius;
            }
            (values.clone(), angle)
        } else {
            let angle = unwrapped(values);
            let slope = |i: usize| {
                let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
                radius * ((angle[b] - angle[a]) / (times[b] - times[a])).abs()
            };
            ((0..n).map(slope).collect(), angle)
        };
        Ok(Motion { times, speed, angle })
    }
}

/// Returns continuous angles: no step of half a turn or more.
fn unwrapped(angles: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(angles.len());
    for &a in angles {
        let next = out.last().map_or(a, |&last| last + (a - last + PI).rem_euclid(TAU) - PI);
        out.push(next);
    }
    out
}

/// Speed and angle of the roller, linear between encoder samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    times: Vec<f64>,
    speed: Vec<f64>,
    /// Cumulative; empty when unknown.
    angle: Vec<f64>,
}

impl Motion {
    /// Interpolates `values` linearly at time `t`.
    fn value_at(&self, values: &[f64], t: f64) -> f64 {
        let i = self.times.partition_point(|x| *x <= t).clamp(1, self.times.len() - 1);
        let x = (t - self.times[i - 1]) / (self.times[i] - self.times[i - 1]);
        values[i - 1] + x.clamp(0.0, 1.0) * (values[i] - values[i - 1])
    }

    /// Returns the minimum and maximum of `values` in `[from, to]`.
    fn range(&self, values: &[f64], from: f64, to: f64) -> (f64, f64) {
        let inside = self.times.partition_point(|x| *x <= from)..self.times.partition_point(|x| *x < to);
        let ends = [self.value_at(values, from), self.value_at(values, to)];
        let knots = values.get(inside).unwrap_or_default();
        ends.iter().chain(knots).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)))
    }

    /// Returns true if readings cover all of `[from, to]`, in seconds.
    #[must_use]
    pub fn covers(&self, from: f64, to: f64) -> bool {
        self.times[0] <= from && to <= self.times[self.times.len() - 1]
    }

    /// Returns the surface speed at `t`, in m/s.
    #[must_use]
    pub fn speed_at(&self, t: f64) -> f64 {
        self.value_at(&self.speed, t)
    }

    /// Returns the minimum and maximum speed in `[from, to]`, in m/s.
    #[must_use]
    pub fn speed_range(&self, from: f64, to: f64) -> (f64, f64) {
        self.range(&self.speed, from, to)
    }

    /// Returns true if the roller reaches an angle of `seam` during `[from, to]`, and false if its angle is unknown.
    ///
    /// A seam covers the angles from its first forward to its second, in radians modulo a turn.
    #[must_use]
    pub fn touches(&self, seam: (f64, f64), from: f64, to: f64) -> bool {
        if self.angle.is_empty() {
            return false;
        }
        let (low, high) = self.range(&self.angle, from, to);
        // A seam of a turn or more covers the whole turn.
        let width = if seam.1 - seam.0 >= TAU { TAU } else { (seam.1 - seam.0).rem_euclid(TAU) };
        let start = (seam.0 - low).rem_euclid(TAU);
        // Either the seam begins within the arc of the roller, or the arc begins within the seam.
        start <= high - low || start + width >= TAU
    }

    /// Returns true if the angle is known.
    #[must_use]
    pub fn has_angle(&self) -> bool {
        !self.angle.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_speeds_and_of_angles_are_read() {
        let track = EncoderTrack::from_csv(b"time_s, speed_m_s\n0, 0.1\n0.5, 0.2\n").unwrap();
        assert_eq!(track, EncoderTrack { times: vec![0.0, 0.5], reading: Reading::Speed(vec![0.1, 0.2]) });
        let track = EncoderTrack::from_csv(b"time_s,angle_rad\n0,6.2\n1,0.1\n").unwrap();
        assert_eq!(track.reading, Reading::Angle(vec![6.2, 0.1]));
    }

    #[test]
    fn errors_name_the_line() {
        let error = |text: &str| EncoderTrack::from_csv(text.as_bytes()).unwrap_err();
        assert!(matches!(error("0,1\n"), EncoderError::Header { .. }));
        assert!(matches!(error(""), EncoderError::Header { .. }));
        assert_eq!(
            error("time_s,speed_m_s\n0,1\n1,fast\n"),
            EncoderError::Number { line: 3, column: "speed_m_s", found: "fast".into() }
        );
        assert!(matches!(error("time_s,speed_m_s\n0,1\nnan,1\n"), EncoderError::Number { line: 3, .. }));
        let short = error("time_s,speed_m_s\n0,1\n1\n");
        assert!(matches!(short, EncoderError::Line { line: 3, .. }), "{short}");
        assert_eq!(short.to_string(), "line 3: 1 field(s) where the header has 2");
    }

    #[test]
    fn wrapped_angles_give_the_speed_of_the_surface() {
        let times: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
        let angles = times.iter().map(|t| (5.0 * t).rem_euclid(TAU)).collect();
        let motion = EncoderTrack { times, reading: Reading::Angle(angles) }.motion(0.1).unwrap();
        for t in [0.0, 0.123, 0.5, 0.99] {
            assert!((motion.speed_at(t) - 0.5).abs() < 1e-12);
        }
    }

    #[test]
    fn a_signal_gives_the_same_track_as_a_table_of_its_samples() {
        let speeds = EncoderTrack::from_signal(&[0.25, -0.5], 4.0, Signal::Speed, 2.0);
        let table = EncoderTrack::from_csv(b"time_s,speed_m_s\n0,0.5\n0.25,1\n").unwrap();
        assert_eq!(speeds, table, "the sign of a speed is a direction");
        let angles = EncoderTrack::from_signal(&[0.25, -0.5], 4.0, Signal::Angle, TAU);
        assert_eq!(angles.reading, Reading::Angle(vec![0.25 * TAU, -0.5 * TAU]));
    }

    #[test]
    fn a_seam_is_touched_when_it_overlaps_the_arc_of_the_roller() {
        let track = EncoderTrack { times: vec![0.0, 10.0], reading: Reading::Speed(vec![0.1, 0.1]) };
        let motion = track.motion(0.1).unwrap();
        // One radian per second from 0.
        assert!(motion.touches((1.0, 1.1), 0.9, 1.0));
        assert!(!motion.touches((1.0, 1.1), 0.8, 0.9));
        assert!(motion.touches((1.0, 1.1), 1.05, 1.06), "wholly inside the seam");
        assert!(!motion.touches((1.0, 1.1), 1.2, 3.0));
        assert!(motion.touches((1.0, 1.1), TAU + 1.05, TAU + 1.2), "a turn later");
        assert!(motion.touches((6.2, 0.1), 0.0, 0.05), "a seam across angle 0");
        assert!(!motion.touches((6.2, 0.1), 0.2, 6.0));
    }

    #[test]
    fn invalid_tracks_are_refused() {
        let track = |times: &[f64], v: &[f64]| EncoderTrack {
            times: times.to_vec(),
            reading: Reading::Speed(v.to_vec()),
        };
        assert!(matches!(track(&[0.0], &[1.0]).motion(0.1), Err(EncoderError::Count { .. })));
        assert!(matches!(
            track(&[0.0, 0.0], &[1.0; 2]).motion(0.1),
            Err(EncoderError::Order { index: 1, .. })
        ));
        assert!(matches!(
            track(&[0.0, 1.0], &[1.0, -1.0]).motion(0.1),
            Err(EncoderError::Value { index: 1, .. })
        ));
        let angles = EncoderTrack { times: vec![0.0, 1.0], reading: Reading::Angle(vec![0.0, 1.0]) };
        assert_eq!(angles.motion(0.0), Err(EncoderError::Radius { found: 0.0 }));
    }
}
