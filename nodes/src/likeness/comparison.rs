//! The measure of likeness.

use super::active::{ActiveSound, LOWEST};
use super::envelope_lines::{EnvelopeSpectrum, HarmonicLine};
use super::figure::{self, Distributions};
use super::joins::{HIGH, HighLevels, join_report};
use super::repeats::{FrameRepeat, RepeatRules, frame_repeats, stretches};
use super::report::{Likeness, LineReport, RepeatReport, Statistic, TakeFigures};
use super::spectrogram::spectrogram;
use super::statistics::SoundStatistics;
use super::takes::Take;
use crate::core::item::Data;
use crate::core::random::Rng;

/// Minimum number of active frames of a recording that is measured.
const LEAST_FRAMES: usize = 4;
/// Places that are listed of each kind.
const PLACES: usize = 100;
/// Minimum tolerance of a range in dB, and of one of kurtosis, relative.
const TOLERANCE: (f64, f64) = (0.5, 0.1);

/// Known properties of a sound, and the rules of the search for repeats.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LikenessRules {
    /// The search for repeats.
    pub repeats: RepeatRules,
    /// Duration of the units that the sound was made of, s.
    pub unit: Option<f64>,
    /// Times of its joins, s.
    pub joins: Option<Vec<f64>>,
}

/// A recording that is measured.
struct MeasuredTake {
    sound: ActiveSound,
    statistics: SoundStatistics,
    repeats: Vec<FrameRepeat>,
}

/// Shares of repeated and of periodic frames.
fn shares(frames: &[&FrameRepeat], threshold: f64) -> [Option<f64>; 2] {
    let share = |is: &dyn Fn(&FrameRepeat) -> bool| {
        let count = frames.iter().filter(|f| is(f)).count();
        (!frames.is_empty()).then(|| count as f64 / frames.len() as f64)
    };
    [share(&|f| f.is_repeated(threshold)), share(&|f| f.is_periodic(threshold))]
}

fn figures(name: &str, sound: &ActiveSound) -> TakeFigures {
    TakeFigures {
        name: name.into(),
        seconds: sound.seconds(),
        active_seconds: sound.active_seconds(),
        level_db: sound.level(),
    }
}

/// Values of the sound beside those of all recordings and of each take.
fn statistics(
    sound: &SoundStatistics,
    pooled: &SoundStatistics,
    takes: &[SoundStatistics],
) -> Vec<Statistic> {
    let all: Vec<_> = takes.iter().map(SoundStatistics::measured).collect();
    let pooled = pooled.measured();
    let one = |own: super::statistics::Measured| {
        let of = |list: &[super::statistics::Measured]| {
            let same = list.iter().find(|m| {
                (m.quantity, m.band_hz, m.modulation_hz) == (own.quantity, own.band_hz, own.modulation_hz)
            });
            same.map_or((None, 0.0), |m| (m.value, m.error))
        };
        let (recordings, error) = of(&pooled);
        let error = 2.0 * own.error.hypot(error);
        // One take has no spread.
        let values: Vec<f64> = all.iter().filter_map(|take| of(take).0).collect();
        let values =
            if values.len() > 1 { [values, recordings.into_iter().collect()].concat() } else { vec![] };
        let low = values.iter().copied().reduce(f64::min);
        let high = values.iter().copied().reduce(f64::max);
        let range = own.value.zip(low.zip(high));
        let outside = range.map(|(x, (low, high))| if x < low { x - low } else { (x - high).max(0.0) });
        let tolerance = error + if own.unit == "dB" { TOLERANCE.0 } else { TOLERANCE.1 };
        let within = range.map(|(x, (low, high))| match own.unit {
            "dB" => x >= low - tolerance && x <= high + tolerance,
            _ => x >= low / (1.0 + tolerance) && x <= high * (1.0 + tolerance),
        });
        Statistic {
            quantity: own.quantity.into(),
            unit: own.unit.into(),
            band_hz: own.band_hz,
            modulation_hz: own.modulation_hz,
            sound: own.value,
            recordings,
            low,
            high,
            outside,
            tolerance,
            within,
        }
    };
    sound.measured().into_iter().map(one).collect()
}

/// Lines of the envelope of the sound and of the recordings, and the spectrum of the sound for the figure.
fn lines(sound: &ActiveSound, takes: &[MeasuredTake], unit: f64) -> (LineReport, EnvelopeSpectrum) {
    let frame_s = EnvelopeSpectrum::frame_of([sound.seconds()]);
    let recordings_frame_s = EnvelopeSpectrum::frame_of(takes.iter().map(|take| take.sound.seconds()));
    let own = EnvelopeSpectrum::new(sound, unit, frame_s);
    let of_take = |take: &MeasuredTake| EnvelopeSpectrum::new(&take.sound, unit, recordings_frame_s);
    let of_takes: Vec<_> = takes.iter().map(of_take).collect();
    let pooled = EnvelopeSpectrum::pooled(&of_takes);
    let recorded = pooled.lines();
    let is_measured = own.frames() > 0;
    let line = |(k, (hz, db)): (usize, (f64, f64))| {
        let recordings_db = recorded.get(k).map(|(_, db)| *db).filter(|_| pooled.frames() > 0);
        HarmonicLine { hz, db, recordings_db }
    };
    let all = own.lines().into_iter().enumerate().map(line);
    let report = LineReport {
        unit_s: unit,
        frame_s,
        recordings_frame_s,
        mean_db: own.mean_line(),
        recordings_db: pooled.mean_line(),
        lines: all.filter(|_| is_measured).collect(),
    };
    (report, own)
}

/// Measures one channel of a sound at a rate in Hz beside recordings of the same rate.
///
/// Sound and recordings are high-passed at 100 Hz, and nothing above half of the lowest rate is compared. Levels are relative to the level of
/// the active frames of each, so a gain changes nothing. The range of a statistic is over the takes and all recordings together; of a single
/// recording of a second or more it is over its halves and quarters.
///
/// # Complexity
/// As [`frame_repeats`], which takes most of the time.
///
/// # Example
/// ```
/// use foley_nodes::core::random::Rng;
/// use foley_nodes::likeness::{LikenessRules, Take, compare};
/// let mut rng = Rng::new(1);
/// let mut noise = |n: usize| -> Vec<f32> { (0..n).map(|_| rng.between(-0.5, 0.5) as f32).collect() };
/// let recording = Take { name: "noise".into(), rate: 8000.0, samples: noise(16_000) };
/// // A loop of half a second.
/// let sound = noise(4000).repeat(4);
/// let found = compare(&sound, 8000.0, &[recording], &LikenessRules::default());
/// assert!(found.repeats.share > Some(0.7) && found.repeats.recordings_share == Some(0.0));
/// assert!((found.repeats.longest[0].lag - 0.5).abs() < 1e-9);
/// ```
#[must_use]
pub fn compare(sound: &[f32], rate: f64, takes: &[Take], rules: &LikenessRules) -> Likeness {
    let mut notes = Vec::new();
    let own = ActiveSound::new(sound, rate);
    let highest = takes.iter().map(|take| take.rate).fold(rate, f64::min) / 2.0;
    if own.level().is_none() {
        notes.push("the sound is silent: nothing of it can be compared".to_owned());
    }
    let bad = sound.iter().filter(|x| !x.is_finite()).count();
    if bad > 0 {
        notes.push(format!("{bad} samples of the sound are not finite, and are measured as 0"));
    }
    let measure = |sound: ActiveSound| {
        let statistics = SoundStatistics::new(&sound, highest);
        MeasuredTake { repeats: frame_repeats(&sound, &rules.repeats), statistics, sound }
    };
    let (mut wholes, mut names): (Vec<MeasuredTake>, Vec<&Take>) = (Vec::new(), Vec::new());
    for take in takes {
        let sound = ActiveSound::new(&take.samples, rate);
        if sound.active_frames() < LEAST_FRAMES {
            let reason = if sound.level().is_none() { "silent" } else { "active for less than 0.1 s" };
            notes.push(format!("{} is {reason}, and is left out", take.name));
            continue;
        }
        wholes.push(measure(sound));
        names.push(take);
    }
    let mut ranges: Vec<SoundStatistics> = wholes.iter().map(|take| take.statistics.clone()).collect();
    let mut has_parts = false;
    if let [only] = names[..] {
        let parts = only.parts(rate);
        has_parts = !parts.is_empty();
        let of_part = |part: &Take| SoundStatistics::new(&ActiveSound::new(&part.samples, rate), highest);
        ranges.extend(parts.iter().map(of_part).filter(|part| part.levels.len() >= LEAST_FRAMES));
        notes.push(if has_parts {
            "there is one recording: ranges are those of its halves and quarters".to_owned()
        } else {
            "there is one recording of less than a second: it has no range".to_owned()
        });
    } else if names.is_empty() {
        notes.push("there is no recording to compare with".to_owned());
    }
    let mut out = Likeness {
        sound: figures("sound", &own),
        recordings: names.iter().zip(&wholes).map(|(take, m)| figures(&take.name, &m.sound)).collect(),
        parts: has_parts,
        highest_hz: highest,
        ..Likeness::default()
    };

    let repeats = frame_repeats(&own, &rules.repeats);
    let threshold = rules.repeats.threshold;
    let [share, periodic_share] = shares(&repeats.iter().collect::<Vec<_>>(), threshold);
    let recorded: Vec<&FrameRepeat> = wholes.iter().flat_map(|take| &take.repeats).collect();
    let [recordings_share, recordings_periodic_share] = shares(&recorded, threshold);
    let mut longest = stretches(&repeats, &own, threshold);
    longest.sort_by(|a, b| (b.to - b.from).total_cmp(&(a.to - a.from)).then(a.from.total_cmp(&b.from)));
    longest.truncate(PLACES);
    out.repeats = RepeatReport {
        window_s: rules.repeats.window,
        threshold,
        share,
        periodic_share,
        recordings_share,
        recordings_periodic_share,
        longest,
    };

    let mut spectrum = None;
    if let Some(unit) = rules.unit.filter(|unit| *unit > 0.0) {
        let (report, found) = lines(&own, &wholes, unit);
        if report.mean_db.is_none() {
            notes.push(
                "lines of the envelope are not measured: the sound has no active quarter of a second"
                    .to_owned(),
            );
        } else if report.recordings_db.is_none() && !wholes.is_empty() {
            notes.push("the recordings are too short for lines of the envelope".to_owned());
        }
        (out.lines, spectrum) = (Some(report), Some(found));
    }

    let mut join_levels = None;
    if let Some(joins) = &rules.joins {
        let joins: Vec<usize> = joins.iter().map(|t| (t * rate).round().max(0.0) as usize).collect();
        if highest < 1.2 * HIGH {
            notes.push(format!("joins are not measured: there is nothing above {highest:.0} Hz"));
        } else {
            let mut recorded: Vec<f64> = wholes
                .iter()
                .filter_map(|take| Some(HighLevels::new(&take.sound)?.sorted(&take.sound, |_| true)))
                .flatten()
                .collect();
            recorded.sort_unstable_by(f64::total_cmp);
            if let Some((report, levels)) = join_report(&own, &joins, &recorded, PLACES) {
                (out.joins, join_levels) = (Some(report), Some((levels, recorded)));
            }
        }
    }

    let own_statistics = SoundStatistics::new(&own, highest);
    let pooled = SoundStatistics::pooled(wholes.iter().map(|take| &take.statistics));
    out.statistics = statistics(&own_statistics, &pooled, &ranges);
    let judged = out.statistics.iter().filter_map(|s| s.within);
    let (within, count) = judged.fold((0.0, 0.0), |(a, n), is| (a + f64::from(u8::from(is)), n + 1.0));
    out.within_share = (count > 0.0).then(|| within / count);

    let distributions =
        Distributions { levels: [own_statistics.levels, pooled.levels], joins: join_levels, spectrum };
    out.charts = figure::charts(&out, &distributions);
    out.picture = spectrogram(&own, [LOWEST, highest]).unwrap_or_default();
    out.notes = notes;
    out
}

impl Data for Likeness {
    const NAME: &'static str = "likeness";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let samples: Vec<f32> = (0..4000).map(|_| rng.between(-0.5, 0.5) as f32).collect();
        compare(&samples, 8000.0, &[], &LikenessRules::default())
    }

    /// The spectrogram, on which the longest repeats and the loudest joins are marked, and the values of the sound beside those of the
    /// recordings.
    fn plot(&self) -> Option<String> {
        Some(figure::draw(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::likeness::statistics::testing::gaussian;

    fn take(name: &str, samples: Vec<f32>) -> Take {
        Take { name: name.into(), rate: 44_100.0, samples }
    }

    #[test]
    fn a_recording_is_within_the_range_of_its_takes() {
        let takes: Vec<Take> = (0..4).map(|k| take("take", gaussian(66_150, k))).collect();
        let sound: Vec<f32> = takes.iter().flat_map(|take| take.samples.clone()).collect();
        let rules =
            LikenessRules { unit: Some(1.0 / 240.0), joins: Some(vec![1.5, 3.0]), ..Default::default() };
        let found = compare(&sound, 44_100.0, &takes, &rules);
        assert!(found.within_share.unwrap() > 0.95, "{}", found.text());
        assert_eq!((found.repeats.share, found.repeats.recordings_share), (Some(0.0), Some(0.0)));
        let lines = found.lines.as_ref().unwrap();
        assert!(lines.mean_db.unwrap() < 1.5 && lines.recordings_db.unwrap() < 1.5, "{lines:?}");
        assert!(found.join_excess().unwrap().abs() < 2.0, "{:?}", found.joins);
        assert_eq!((found.recordings.len(), found.parts, found.notes.len()), (4, false, 0));
        let rows = found.table().rows.len();
        assert_eq!(rows, 5 + found.statistics.len());
    }

    #[test]
    fn another_spectrum_and_a_gain_are_distinguished() {
        let recordings: Vec<Take> = (0..3).map(|k| take("take", gaussian(44_100, k))).collect();
        let loud: Vec<f32> = gaussian(88_200, 9).iter().map(|x| 3.0 * x).collect();
        let found = compare(&loud, 44_100.0, &recordings, &LikenessRules::default());
        assert!(found.within_share.unwrap() > 0.8, "{}", found.text());
        // The sum of two neighbours has no high frequencies.
        let dull: Vec<f32> = loud.windows(2).map(|w| w[0] + w[1]).collect();
        let found = compare(&dull, 44_100.0, &recordings, &LikenessRules::default());
        let outside = |hz: f64| {
            let is_third = |s: &&Statistic| s.quantity == "third octave" && s.band_hz == Some(hz);
            found.statistics.iter().find(is_third).and_then(|s| s.outside).unwrap()
        };
        // |1 + z|^2 / 2 is 0.29 at 16 kHz and 2 at 1 kHz; both are above the power of the whole by 0.04 dB.
        assert!(
            (outside(16_000.0) + 4.3).abs() < 0.5 && (outside(1000.0) - 3.0).abs() < 0.6,
            "{}",
            found.text()
        );
        assert!(found.farthest().iter().any(|s| s.outside == Some(outside(16_000.0))));
    }

    #[test]
    fn silence_short_and_missing_recordings_have_notes_in_place_of_values() {
        let silent =
            compare(&[0.0; 44_100], 44_100.0, &[take("a", vec![0.0; 44_100])], &LikenessRules::default());
        assert_eq!((silent.repeats.share, silent.within_share), (None, None));
        assert!(silent.notes.iter().any(|n| n.contains("the sound is silent")), "{:?}", silent.notes);
        assert!(silent.notes.iter().any(|n| n.contains("a is silent")) && silent.plot().is_some());
        let rules = LikenessRules { unit: Some(1.0 / 240.0), joins: Some(vec![0.1]), ..Default::default() };
        let short = compare(&gaussian(44_100, 1), 44_100.0, &[take("b", gaussian(9000, 2))], &rules);
        assert!(short.within_share.is_none() && short.statistics[1].recordings.is_some());
        assert!(short.notes.iter().any(|n| n.contains("no range")), "{:?}", short.notes);
        let one = compare(&gaussian(44_100, 1), 44_100.0, &[take("c", gaussian(88_200, 2))], &rules);
        assert!(one.parts && one.within_share.unwrap() > 0.8, "{}", one.text());
        for sound in [&[][..], &[0.5]] {
            let empty = compare(sound, 44_100.0, &[], &rules);
            assert!(empty.notes.iter().any(|n| n.contains("no recording")) && !empty.text().is_empty());
        }
    }

    #[test]
    fn nothing_above_the_lowest_rate_is_compared() {
        let mut low = take("low", gaussian(44_100, 1));
        low.rate = 16_000.0;
        let rules = LikenessRules { joins: Some(vec![0.5]), ..Default::default() };
        let found = compare(&gaussian(44_100, 2), 44_100.0, &[low], &rules);
        assert!(found.statistics.iter().all(|s| s.band_hz.is_none_or(|hz| hz < 8000.0)));
        assert!(found.joins.is_none() && found.notes.iter().any(|n| n.contains("8000 Hz")));
    }

    #[test]
    fn all_numbers_are_finite_and_the_json_can_be_read_again() {
        let mut x = gaussian(44_100, 1);
        x[100] = f32::NAN;
        let rules = LikenessRules { unit: Some(0.01), joins: Some(vec![0.2, 9.0]), ..Default::default() };
        let found = compare(&x, 44_100.0, &[take("a", gaussian(44_100, 3))], &rules);
        let json = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<Likeness>(&json).unwrap(), found);
        assert!(found.notes.iter().any(|n| n.contains("not finite")));
        let trial = Likeness::trial(&mut Rng::new(1));
        assert!(trial.plot().unwrap().ends_with("</svg>\n"));
    }
}
