//! Points of damping over frequency, from features or from a table.

use crate::artefact::value_file::Artefact;
use crate::core::files::strip_bom;
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::material::estimation::point::{DampingPoint, check_points};
use crate::plot::{Axis, Line, chart};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Maximum number of points.
pub const MAX_POINTS: usize = 1 << 20;

/// A reason for which a feature gives no point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum DropReason {
    /// It decays too slowly for a mode.
    DTooSmall,
    /// It decays too fast to be distinguished from the contact.
    DTooLarge,
    /// Its amplitude is too far below that of the loudest.
    Quiet,
    /// It is a steady multiple of a mains frequency.
    Hum,
    /// It does not fit the recording.
    PoorFit,
}

/// A feature that gave no point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dropped {
    /// Index of its recording.
    pub recording: u32,
    /// Its index in the recording.
    pub feature: u32,
    /// Hz.
    pub freq_hz: f64,
    /// Decay rate of the amplitude, 1/s.
    pub decay: f64,
    /// The reason.
    pub reason: DropReason,
}

/// Points with their recordings, and the dropped features.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DampingPoints {
    /// The points.
    pub points: Vec<DampingPoint>,
    /// Names of the recordings, by index.
    pub recordings: Vec<String>,
    /// Object and support of each recording, where the support is known; empty where none is.
    #[serde(default)]
    pub supports: Vec<Option<String>>,
    /// Features without a point.
    pub dropped: Vec<Dropped>,
    /// Damping `c` in 1/s below which features were dropped, if more than 1 % were.
    pub truncated_below: Option<f64>,
}

impl DampingPoints {
    /// The points with recordings of one object on one support as one recording, for an estimator of the damping of each.
    #[must_use]
    pub fn by_support(&self) -> Vec<DampingPoint> {
        let first = |k: usize| {
            let support = self.supports.get(k).and_then(Option::as_deref);
            let same = |other: &Option<String>| support.is_some() && other.as_deref() == support;
            self.supports.iter().position(same).unwrap_or(k)
        };
        let of = |p: &DampingPoint| first(p.recording as usize) as u32;
        self.points.iter().map(|p| DampingPoint { recording: of(p), ..*p }).collect()
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let count = |reason| self.dropped.iter().filter(|d| d.reason == reason).count();
        let mut out: Summary =
            vec![("points", self.points.len().into()), ("recordings", self.recordings.len().into())];
        for (name, reason) in [
            ("dropped_slow", DropReason::DTooSmall),
            ("dropped_fast", DropReason::DTooLarge),
            ("dropped_quiet", DropReason::Quiet),
            ("dropped_hum", DropReason::Hum),
            ("dropped_poor_fit", DropReason::PoorFit),
        ] {
            if count(reason) > 0 {
                out.push((name, count(reason).into()));
            }
        }
        out
    }
}

/// Reads points from a CSV, or from JSON as a tap writes them.
///
/// Columns are `lambda` (rad^2/s^2) or `frequency` (natural frequency, Hz), `c` or `d` (1/s, `c = 2 d`), and optionally `sd` (standard
/// deviation of that column), `weight`, `recording` (a name) and `mode` (a number shared by the recordings of one mode).
///
/// # Errors
/// A message with the line, the value found, and what is needed.
///
/// # Example
/// ```
/// let csv = "frequency,d,recording\n440,3,a.wav\n1210,5,b.wav\n";
/// let points = foley_nodes::material::read_points(csv.as_bytes())?;
/// assert_eq!((points.points[0].c, points.recordings.len()), (6.0, 2));
/// # Ok::<(), String>(())
/// ```
pub fn read_points(bytes: &[u8]) -> Result<DampingPoints, String> {
    let bytes = strip_bom(bytes);
    let json = bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
    let points = if json {
        serde_json::from_slice(bytes).map_err(|e| format!("these are not points: {e}"))?
    } else {
        from_csv(bytes)?
    };
    if points.points.len() > MAX_POINTS {
        return Err(format!("{} points; at most {MAX_POINTS} are read", points.points.len()));
    }
    check_points(&points.points).map_err(|e| e.to_string())?;
    let recordings = points.recordings.len().max(1);
    if let Some(p) = points.points.iter().find(|p| p.recording as usize >= recordings) {
        return Err(format!("a point is of recording {}; there are {recordings}", p.recording));
    }
    let given =
        points.truncated_below.into_iter().chain(points.dropped.iter().flat_map(|d| [d.freq_hz, d.decay]));
    if let Some(wrong) = given.into_iter().find(|x| !x.is_finite()) {
        return Err(format!("a number is {wrong}; it must be finite"));
    }
    Ok(points)
}

const COLUMNS: &str = "lambda or frequency, c or d, and optionally sd, weight, recording, mode";

fn from_csv(bytes: &[u8]) -> Result<DampingPoints, String> {
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let header: Vec<String> = csv.headers().map_err(|e| e.to_string())?.iter().map(str::to_owned).collect();
    let index = |name: &str| header.iter().position(|column| column == name);
    let either = |a: &str, b: &str| match (index(a), index(b)) {
        (Some(_), Some(_)) => {
            Err(format!("columns `{a}` and `{b}` state the same quantity: leave out one of them"))
        }
        (None, None) => Err(format!("no column `{a}` or `{b}`; columns are {COLUMNS}")),
        (first, second) => Ok((first.or(second).unwrap_or(0), first.is_none())),
    };
    let (place, is_frequency) = either("lambda", "frequency")?;
    let (damping, is_d) = either("c", "d")?;
    let (sd, weight, recording, mode) = (index("sd"), index("weight"), index("recording"), index("mode"));
    let used = 2 + [sd, weight, recording, mode].iter().flatten().count();
    if used != header.len() {
        let text: String = header.join(", ").chars().take(120).collect();
        return Err(format!("columns are {text}; they may be {COLUMNS}"));
    }
    let mut out = DampingPoints::default();
    let mut known: HashMap<String, u32> = HashMap::new();
    for record in csv.records() {
        let record = record.map_err(|e| e.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let text = |k: usize| record.get(k).unwrap_or_default();
        let number = |k: usize, low: f64, high: f64| {
            let value = text(k).parse::<f64>().ok().filter(|x| (low..=high).contains(x));
            let excerpt: String = text(k).chars().take(40).collect();
            let wrong = || {
                format!(
                    "line {line}: `{}` is {excerpt:?}; a number from {low} to {high} is needed",
                    header[k]
                )
            };
            value.ok_or_else(wrong)
        };
        let factor = if is_d { 2.0 } else { 1.0 };
        let lambda = if is_frequency {
            (TAU * number(place, 0.001, 1e7)?).powi(2)
        } else {
            number(place, 1e-6, 1e16)?
        };
        let c = factor * number(damping, 1e-9, 1e9)?;
        let name = recording.map(text).unwrap_or_default();
        let recording = match known.get(name) {
            Some(index) => *index,
            None => {
                known.insert(name.to_owned(), out.recordings.len() as u32);
                out.recordings.push(name.chars().take(200).collect());
                out.recordings.len() as u32 - 1
            }
        };
        let mode = mode.map(|k| number(k, 0.0, f64::from(u32::MAX))).transpose()?;
        out.points.push(DampingPoint {
            lambda,
            c,
            sd_c: sd.map(|k| number(k, 0.0, 1e9)).transpose()?.unwrap_or(0.0) * factor,
            weight: weight.map(|k| number(k, 0.0, 1e9)).transpose()?.unwrap_or(1.0),
            recording,
            mode_cluster: mode.map_or(out.points.len() as u32, |m| m as u32),
        });
        if out.points.len() > MAX_POINTS {
            return Err(format!("line {line}: at most {MAX_POINTS} points are read"));
        }
    }
    Ok(out)
}

impl Artefact for DampingPoints {
    const CODE: &'static str = "F135";
    const HELP: Option<&'static str> = Some("a FeatureGate makes points, and a tap writes them");

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        read_points(bytes)
    }

    fn summary(&self) -> Summary {
        Self::summary(self)
    }
}

impl Data for DampingPoints {
    const NAME: &'static str = "damping points";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let points = (0..24 + rng.below(16))
            .map(|k| {
                let lambda = (TAU * rng.between(5.5, 9.5).exp()).powi(2);
                let excess = -8.0 * (1.0 - rng.uniform()).ln();
                let c = 4.0 + 1e-8 * lambda + excess + rng.between(-0.5, 0.5);
                let (recording, mode_cluster) = (rng.below(3) as u32, k as u32);
                DampingPoint { recording, mode_cluster, ..DampingPoint::new(lambda, c) }
            })
            .collect();
        let recordings = ["a.wav", "b.wav", "c.wav"].map(str::to_owned).to_vec();
        Self { points, recordings, ..Self::default() }
    }

    fn plot(&self) -> Option<String> {
        let points: Vec<[f64; 2]> = self.points.iter().map(|p| [p.lambda.sqrt() / TAU, p.c]).collect();
        let bounds = |k: usize| {
            let values = || points.iter().map(|p| p[k]);
            let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
            if low < high { [0.9 * low, 1.1 * high] } else { [1.0, 10.0] }
        };
        let axis = |label: &str, range| Axis { label: label.into(), range, log: true };
        let (x, y) = (axis("natural frequency, Hz", bounds(0)), axis("damping c, 1/s", bounds(1)));
        let dots = Line::dots("modes", points);
        Some(chart("Damping over frequency", &x, &y, &[dots]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_may_be_given_in_either_quantity() {
        let a = read_points(b"frequency,d,sd,recording\n100,2,0.5,x\n200,3,0,y\n300,4,0,x\n").unwrap();
        assert_eq!(a.recordings, ["x", "y"]);
        assert!((a.points[0].lambda - (TAU * 100.0).powi(2)).abs() < 1e-6);
        assert_eq!((a.points[0].c, a.points[0].sd_c, a.points[2].recording), (4.0, 1.0, 0));
        let b = read_points(b"# a table\nlambda,c,weight,mode\n1e6,4,0.5,7\n2e6,5,1,7\n").unwrap();
        assert_eq!((b.points[0].weight, b.points[1].mode_cluster, b.points[1].c), (0.5, 7, 5.0));
        let json = serde_json::to_vec(&a).unwrap();
        assert_eq!(read_points(&json).unwrap(), a);
        assert!(a.plot().unwrap().contains("<circle"));
        assert!(!DampingPoints::default().plot().unwrap().contains("NaN"));
    }

    #[test]
    fn recordings_on_one_support_become_one() {
        let point = |recording| DampingPoint { recording, ..DampingPoint::new(1e6, 4.0) };
        let label = |text: &str| Some(text.to_owned());
        let points = DampingPoints {
            points: (0..5).map(point).collect(),
            supports: vec![label("a"), None, label("b"), label("a"), None],
            ..DampingPoints::default()
        };
        let groups: Vec<u32> = points.by_support().iter().map(|p| p.recording).collect();
        assert_eq!(groups, [0, 1, 2, 0, 4]);
    }

    #[test]
    fn errors_name_the_line_and_what_would_be_right() {
        for (text, part) in [
            ("frequency\n1\n", "no column `c` or `d`"),
            ("d,sd\n1,1\n", "no column `lambda` or `frequency`"),
            ("lambda,frequency,c\n1,1,1\n", "state the same quantity"),
            ("frequency,c,colour\n1,1,1\n", "they may be"),
            ("frequency,c\n100,1\n100,-1\n", "line 3: `c` is \"-1\"; a number from 0.000000001"),
            ("frequency,c\n100,NaN\n", "line 2: `c` is \"NaN\""),
            ("frequency,c\n0,1\n", "line 2: `frequency` is \"0\""),
            ("{\"points\": []}", "missing field"),
        ] {
            let e = read_points(text.as_bytes()).unwrap_err();
            assert!(e.contains(part), "{text:?}: {e}");
        }
    }
}
