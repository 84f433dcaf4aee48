//! Compares the content of an output with the expectation of a check.

use super::bounds::Bounds;
use super::checks::{Check, Field, Kind};
use super::recording::{Recording, Samples};
use crate::probe::{db, figure};
use foley_nodes::dsp::{SoundFigures, SoundMeter, linear_to_db};
use foley_nodes::feature::{FluxFrames, ONSET_RISE, onsets};
use serde_json::Value;

/// Level below which audio counts as silent, dB of full scale.
const SILENT_DB: f64 = -80.0;
/// Largest difference from the samples of a file, dB of full scale.
const SAME_DB: f64 = -90.0;
/// Tolerance of times where none is given, s.
const WITHIN: f64 = 0.02;
/// Largest number of times that a message lists.
const MAX_TIMES: usize = 12;

/// The result of a check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// True if it holds.
    pub passed: bool,
    /// The measured value.
    pub found: String,
    /// The expected value.
    pub expected: String,
}

impl Verdict {
    /// A result.
    #[must_use]
    pub fn new(passed: bool, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { passed, found: found.into(), expected: expected.into() }
    }

    /// A number that lies within bounds or does not, with its unit.
    fn of(x: f64, bounds: Option<Bounds>, unit: &str, shown: String) -> Self {
        match bounds {
            Some(bounds) => Self::new(bounds.holds(x), shown, format!("{bounds}{unit}")),
            None => Self::new(true, shown, "anything"),
        }
    }
}

/// A check that does not apply to such an output.
fn not_for(recording: &Recording, what: &str) -> Verdict {
    let found = match recording {
        Recording::Nothing(reason) => reason.clone(),
        other => other.describe().to_owned(),
    };
    Verdict::new(false, found, what)
}

fn sound(recording: &Recording) -> Result<&Samples, Verdict> {
    match recording {
        Recording::Sound(samples) => Ok(samples),
        other => Err(not_for(other, "audio")),
    }
}

fn stream(recording: &Recording) -> Result<&Samples, Verdict> {
    match recording {
        Recording::Sound(samples) | Recording::Numbers(samples) => Ok(samples),
        other => Err(not_for(other, "a stream")),
    }
}

/// Compares an output with a check that needs nothing but that output: all but [`Kind::SameAs`], [`Kind::Stored`], [`Kind::Repeats`] and
/// [`Kind::SameForSeeds`], which are `same_samples` and comparisons of digests.
#[must_use]
pub fn judge(check: &Check, recording: &Recording) -> Verdict {
    compare(check, recording).unwrap_or_else(|verdict| verdict)
}

fn compare(check: &Check, recording: &Recording) -> Result<Verdict, Verdict> {
    let during = check.during();
    let figures = || -> Result<SoundFigures, Verdict> {
        let samples = sound(recording)?;
        let mut meter = SoundMeter::new(samples.rate, samples.width);
        meter.process(samples.during(during));
        Ok(meter.figures())
    };
    let level = |x: f64, name: &str| Verdict::of(x, check.bounds(name), " dB", db(x));
    Ok(match check.kind {
        Kind::Peak => level(figures()?.peak_db, "db"),
        Kind::Rms => level(figures()?.rms_db, "db"),
        Kind::Loudness => {
            let lufs = figures()?.lufs;
            Verdict::of(lufs, check.bounds("lufs"), " LUFS", format!("{lufs:.2} LUFS"))
        }
        Kind::Centroid => {
            let hz = figures()?.centroid_hz;
            Verdict::of(hz, check.bounds("hz"), " Hz", format!("{hz:.1} Hz"))
        }
        Kind::Silent | Kind::Sounds => silence(check, recording)?,
        Kind::Onsets => {
            let samples = sound(recording)?;
            timed(check, &onset_times(samples, during), "onset")
        }
        Kind::Events => match recording {
            Recording::Events(events) => {
                let [from, to] = during;
                let times: Vec<f64> =
                    events.iter().map(|(time, _)| *time).filter(|time| *time >= from && *time < to).collect();
                timed(check, &times, "event")
            }
            other => not_for(other, "events"),
        },
        Kind::Duration => {
            let samples = stream(recording)?;
            let seconds = samples.items() as f64 / samples.rate;
            Verdict::of(seconds, check.bounds("seconds"), " s", format!("{seconds:.6} s"))
        }
        Kind::Channels => {
            let width = stream(recording)?.width;
            Verdict::of(width as f64, check.bounds("count"), "", width.to_string())
        }
        Kind::Rate => {
            let rate = stream(recording)?.rate;
            Verdict::of(rate, check.bounds("hz"), " Hz", format!("{} Hz", figure(rate)))
        }
        Kind::Finite => {
            let samples = stream(recording)?;
            let wrong = samples.numbers.iter().position(|x| !x.is_finite());
            let time = |k: usize| (k / samples.numbers_per_item.max(1)) as f64 / samples.rate;
            let found = wrong.map_or_else(
                || "all finite".to_owned(),
                |k| format!("{} at {:.4} s", samples.numbers[k], time(k)),
            );
            Verdict::new(wrong.is_none(), found, "finite numbers")
        }
        Kind::NoClipping => {
            let clipped = sound(recording)?.clipped;
            Verdict::new(clipped == 0, format!("{clipped} samples beyond full scale"), "none")
        }
        Kind::Numbers => {
            let numbers = stream(recording)?.during(during);
            let bounds = check.bounds("between");
            let ends = numbers.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(f64::from(*x)), high.max(f64::from(*x))]
            });
            let held = |x: f32| bounds.is_none_or(|bounds| bounds.holds(f64::from(x)));
            let found = if numbers.is_empty() {
                "no numbers".to_owned()
            } else {
                format!("from {} to {}", figure(ends[0]), figure(ends[1]))
            };
            let expected = bounds.map(|bounds| bounds.to_string()).unwrap_or_default();
            Verdict::new(!numbers.is_empty() && numbers.iter().all(|x| held(*x)), found, expected)
        }
        Kind::Value => match recording {
            Recording::Value(json, _) => field(check, json),
            other => not_for(other, "a value"),
        },
        Kind::SameAs | Kind::Stored | Kind::Repeats | Kind::SameForSeeds => {
            Verdict::new(false, "nothing to compare with", "another run")
        }
    })
}

/// Times of the onsets of a sound in a range, s.
///
/// They are those of the whole sound, so that the range cuts no sound off; the end of the sound may, and what rises in the last frame is no
/// onset.
fn onset_times(samples: &Samples, [from, to]: [f64; 2]) -> Vec<f64> {
    let frames = FluxFrames::at_rate(samples.rate);
    let mono = Samples::mono(&samples.numbers, samples.width);
    let last = mono.len().saturating_sub(frames.frame);
    let found = onsets(&mono, frames, samples.rate, ONSET_RISE).into_iter().filter(|at| *at < last);
    found.map(|at| at as f64 / samples.rate).filter(|time| (from..to).contains(time)).collect()
}

fn silence(check: &Check, recording: &Recording) -> Result<Verdict, Verdict> {
    let wants_sound = check.kind == Kind::Sounds;
    if let Recording::Numbers(samples) = recording {
        let active = samples.during(check.during()).iter().filter(|x| **x != 0.0).count();
        let expected = if wants_sound { "numbers other than 0" } else { "zeros alone" };
        return Ok(Verdict::new(
            (active > 0) == wants_sound,
            format!("{active} numbers other than 0"),
            expected,
        ));
    }
    if let Recording::Events(events) = recording {
        let [from, to] = check.during();
        let count = events.iter().filter(|(time, _)| *time >= from && *time < to).count();
        let expected = if wants_sound { "events" } else { "no events" };
        return Ok(Verdict::new((count > 0) == wants_sound, format!("{count} events"), expected));
    }
    let samples = sound(recording)?.during(check.during());
    let peak = linear_to_db(samples.iter().fold(0.0_f32, |peak, x| peak.max(x.abs())).into());
    let found = format!("a peak of {}", db(peak));
    Ok(if wants_sound {
        let above = check.number("above").unwrap_or(SILENT_DB);
        Verdict::new(peak > above, found, format!("above {} dB", figure(above)))
    } else {
        let below = check.number("below").unwrap_or(SILENT_DB);
        Verdict::new(peak <= below, found, format!("at most {} dB", figure(below)))
    })
}

/// Times as text, the first ones of many.
fn listed(times: &[f64]) -> String {
    let shown: Vec<String> = times.iter().take(MAX_TIMES).map(|time| format!("{time:.3}")).collect();
    let more = times.len().saturating_sub(MAX_TIMES);
    let more = if more > 0 { format!(", ... {more} more") } else { String::new() };
    format!("{}{more}", shown.join(", "))
}

/// Compares times with the number or the times that a check expects.
fn timed(check: &Check, times: &[f64], what: &str) -> Verdict {
    let within = check.number("within").unwrap_or(WITHIN);
    let at = if times.is_empty() { String::new() } else { format!(" at {} s", listed(times)) };
    let found = format!("{} {what}{}{at}", times.len(), if times.len() == 1 { "" } else { "s" });
    let (mut passed, mut expected) = (true, Vec::new());
    if let Some(count) = check.bounds("count") {
        passed &= count.holds(times.len() as f64);
        expected.push(count.to_string());
    }
    if let Some(wanted) = check.numbers("times") {
        let near = |a: f64, all: &[f64]| all.iter().any(|b| (a - b).abs() <= within);
        passed &=
            wanted.iter().all(|time| near(*time, times)) && times.iter().all(|time| near(*time, wanted));
        passed &= check.bounds("count").is_some() || wanted.len() == times.len();
        expected.push(format!("{} within {} s", listed(wanted), figure(within)));
    }
    Verdict::new(passed, found, expected.join(", "))
}

/// Compares a field of a value, named by a path such as `frequencies/0`.
fn field(check: &Check, json: &Value) -> Verdict {
    let path = check.text("at").unwrap_or_default().trim_start_matches('/');
    let pointer = if path.is_empty() { String::new() } else { format!("/{path}") };
    let Some(value) = json.pointer(&pointer) else {
        let names = match json {
            Value::Object(fields) => fields.keys().cloned().collect::<Vec<_>>().join(", "),
            Value::Array(items) => format!("0 to {}", items.len().saturating_sub(1)),
            other => other.to_string(),
        };
        return Verdict::new(false, format!("no field `{path}`; there are {names}"), "a field");
    };
    let shown: String = value.to_string().chars().take(80).collect();
    match check.fields.get("is") {
        Some(Field::Bounds(bounds)) => match value.as_f64() {
            Some(x) => Verdict::of(x, Some(*bounds), "", figure(x)),
            None => Verdict::new(false, shown, bounds.to_string()),
        },
        Some(Field::Text(text)) => Verdict::new(value.as_str() == Some(text), shown, format!("{text:?}")),
        Some(Field::Truth(truth)) => Verdict::new(value.as_bool() == Some(*truth), shown, truth.to_string()),
        _ => Verdict::new(true, shown, "anything"),
    }
}

/// Compares samples with those of a file: rate, channels and length are equal, and the largest difference is at most `below` dB of full
/// scale (-90 dB if there is none).
#[must_use]
pub fn same_samples(found: &Samples, wanted: &Samples, below: Option<f64>) -> Verdict {
    let below = below.unwrap_or(SAME_DB);
    let form = |s: &Samples| format!("{} items of {} at {} Hz", s.items(), s.width, figure(s.rate));
    if (found.items(), found.width, found.rate) != (wanted.items(), wanted.width, wanted.rate) {
        return Verdict::new(false, form(found), form(wanted));
    }
    let differences = found
        .numbers
        .iter()
        .zip(&wanted.numbers)
        .map(|(a, b)| if a.to_bits() == b.to_bits() { 0.0 } else { (a - b).abs() });
    let (at, largest) = differences.enumerate().fold((0, 0.0_f32), |best, (k, x)| {
        // What is not finite is as different as can be.
        if x > best.1 || !x.is_finite() { (k, if x.is_finite() { x } else { f32::INFINITY }) } else { best }
    });
    let level = linear_to_db(largest.into());
    let time = (at / found.numbers_per_item.max(1)) as f64 / found.rate.max(f64::MIN_POSITIVE);
    let shown = if largest == 0.0 {
        "the same samples".to_owned()
    } else {
        format!("a difference of {} at {time:.4} s", db(level))
    };
    Verdict::new(level <= below, shown, format!("at most {} dB", figure(below)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lang::parse;
    use std::f64::consts::TAU;

    fn check(text: &str) -> Check {
        Check::read(&parse(text).document().value.unwrap(), 0).unwrap_or_else(|e| panic!("{text}: {e:?}"))
    }

    /// A second of a tone of 0.5 at 1 kHz, from 0.25 s on.
    fn tone() -> Recording {
        let sample = |k: usize| if k < 2000 { 0.0 } else { 0.5 * (TAU * k as f64 / 8.0).sin() as f32 };
        let numbers: Vec<f32> = (0..8000).map(sample).collect();
        Recording::Sound(Samples { rate: 8000.0, width: 1, numbers_per_item: 1, numbers, clipped: 0 })
    }

    #[test]
    fn checks_of_audio_pass_and_fail_as_they_say() {
        for (text, passed) in [
            ("Peak(db: -6.1..-6.0)", true),
            ("Peak(db: ..-6.1)", false),
            ("Peak(db: ..-80.0, during: 0.0..0.25)", true),
            ("Rms(db: -9.1..-9.0, during: 0.5..1.0)", true),
            ("Centroid(hz: 990..1010)", true),
            ("Loudness(lufs: -30.0..0.0)", true),
            ("Silent(during: 0.0..0.25)", true),
            ("Silent", false),
            ("Silent(below: -6.0)", true),
            ("Sounds(during: 0.5..0.6)", true),
            ("Sounds(during: 0.0..0.2)", false),
            ("Onsets(count: 1, times: [0.25])", true),
            ("Onsets(times: [0.4])", false),
            ("Onsets(count: 2..)", false),
            ("Duration(seconds: 1.0)", true),
            ("Duration(seconds: 1.01..)", false),
            ("Channels(count: 2)", false),
            ("Rate(hz: 8000)", true),
            ("Finite", true),
            ("NoClipping", true),
            ("Numbers(between: -0.5..0.5)", true),
            ("Numbers(between: 0.0..0.5)", false),
            ("Events(count: 1)", false),
            ("Value(is: 1)", false),
        ] {
            let verdict = judge(&check(text), &tone());
            assert_eq!(verdict.passed, passed, "{text}: {verdict:?}");
            assert!(!verdict.found.is_empty() && !verdict.expected.is_empty(), "{text}: {verdict:?}");
        }
    }

    #[test]
    fn checks_of_events_and_values_pass_and_fail_as_they_say() {
        let events = Recording::Events([0.0, 0.5, 1.0].map(|time| (time, Value::Null)).to_vec());
        let value = Recording::Value(
            serde_json::json!({"gains": [0.5, 2.0], "kind": "bar", "on": true}),
            String::new(),
        );
        for (text, recording, passed) in [
            ("Events(count: 3)", &events, true),
            ("Events(count: 1, during: 0.4..0.9)", &events, true),
            ("Events(times: [0.0, 0.5, 1.001], within: 0.01)", &events, true),
            ("Events(times: [0.0, 0.5])", &events, false),
            ("Sounds(during: 0.9..1.1)", &events, true),
            ("Value(at: \"gains/1\", is: 1.9..2.1)", &value, true),
            ("Value(at: \"/gains/2\", is: 1.0)", &value, false),
            ("Value(at: \"kind\", is: \"bar\")", &value, true),
            ("Value(at: \"on\", is: false)", &value, false),
        ] {
            let verdict = judge(&check(text), recording);
            assert_eq!(verdict.passed, passed, "{text}: {verdict:?}");
        }
    }

    #[test]
    fn samples_are_the_same_up_to_a_level() {
        let Recording::Sound(a) = tone() else { panic!("a tone is a sound") };
        let mut b = a.clone();
        assert!(same_samples(&a, &b, None).passed);
        b.numbers[4000] += 1e-4;
        let verdict = same_samples(&a, &b, None);
        assert!(
            !verdict.passed && verdict.found.contains("-80.0") && verdict.found.ends_with("0.5000 s"),
            "{verdict:?}"
        );
        assert!(same_samples(&a, &b, Some(-79.0)).passed);
        b.numbers[1] = f32::NAN;
        assert!(!same_samples(&a, &b, Some(-79.0)).passed);
        b.numbers.pop();
        assert_eq!(same_samples(&a, &b, None).expected, "7999 items of 1 at 8000 Hz");
        assert_ne!(Recording::Sound(a).digest(), Recording::Sound(b).digest());
    }
}
