//! Modes of many recordings with their uncertainties, as a node.

use super::extract::{ExtractParams, Extractor, extract};
use super::feature::{FeatureSet, FeatureSets};
use super::one_object::{ONE_OBJECT, TakeSound, compare_takes, median_of_take};
use super::onset::{impacts, onset};
use super::peak_fit::FitDomain;
use super::phase_drift::phase_drift;
use super::report::{ExtractionReport, PICTURE, RINGING, RecordingReport, spectrogram};
use super::room::Room;
use super::sources::Sources;
use super::surrogate::surrogate;
use super::takes::Take;
use super::trial::trial_impact;
use super::warnings::{UNCERTAINTY, warnings};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, FolderPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::io::{ListedRecording, MaxLength, RecordingList, RecordingParam, recording_warnings};
use crate::plot::Image;
use crate::table::ResultTable;
use crate::{choices, params, ports};
use std::collections::BTreeSet;
use std::ops::Range;

choices! {
    /// Treatment of a recording with several impacts.
    pub enum Split {
        /// An error that names the onsets.
        None,
        /// The first impact counts, up to the next one.
        First,
        /// Each impact counts as a recording.
        All,
    }
}
choices! {
    /// Method that finds the modes of a recording.
    pub enum Search {
        /// ESPRIT in bands: for modes that are close or decay fast.
        Subband,
        /// Peaks of spectrograms, one after the other, as in the paper: for modes that stand alone.
        Greedy,
        /// `Subband`, then `Greedy` in the residual of its modes: takes as long as both.
        Hybrid,
    }
}
choices! {
    /// Treatment of a recording without modes: one that is silent, too short, or of several impacts.
    pub enum Unusable {
        /// An error that names all of them.
        Error,
        /// A warning for each; the others count.
        Skip,
    }
}

params! {
    /// Modes of recordings of impacts, with uncertainties, for a `FeatureGate` and a `DampingFit`.
    ///
    /// Recordings come from a list, from a folder, and from a manifest of takes, a CSV with the columns `file` (relative to the CSV), and
    /// optionally `object`, `material`, `support`, `hit`, `striker` and `licence`. Each recording is explained by damped sines, as in
    /// `ModalFromRecording`. Their frequencies and decay rates have standard deviations, which follow from the unexplained energy
    /// around each mode. A tap of `report` as SVG draws the modes into spectrograms; as JSON it lists the results, with the drift of the
    /// phase of each mode. `table` has a row for each recording, for a `TableOut`.
    ///
    /// A recording rings if it is explained better by 5 dB than noise with the same spectrogram, its surrogate: dull thuds are explained
    /// as well as their surrogates, and their modes contain little information about the material. Surrogates depend on the index of the
    /// recording only. Takes of one object have the same poles: modes of one take explain another up to a tenth of its energy, with other
    /// amplitudes. The summary names takes that do not fit the others.
    ///
    /// A room adds poles of its own around each mode, and hides modes that decay faster than its sound. With its reverberation time,
    /// typed or measured, modes that decay at 0.6 of its rate `6.908 / T60` or faster are left out.
    ///
    /// # Source
    /// Sirdey et al., "Modal analysis of impact sounds with ESPRIT in Gabor transforms" (DAFx 2011); Sterling et al.,
    /// "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5), 2019), section 4.1.
    pub struct ModalFeaturesParams {
        /// The recordings, of at most a minute each.
        recordings: Vec<AssetPath> = Vec::new();
        /// A folder whose recordings are added, in order of their names.
        folder: Option<FolderPath> = None;
        /// CSV of takes that are added.
        manifest: Option<AssetPath> = None;
        /// Name of the object that was struck, where the manifest names none; recordings of one object share modes.
        object: Text = "".into();
        /// Material of the takes of the manifest that count; empty for all.
        material: Text = "".into();
        /// Treatment of a recording with several impacts.
        split: Split = Split::None;
        /// Treatment of a recording without modes.
        unusable: Unusable = Unusable::Error;
        /// Method that finds the modes.
        extractor: Search = Search::Subband;
        /// Domain in which `Greedy` fits a peak. The modes of `Power` are not refined jointly, and their standard deviations are lower bounds.
        fit_domain: FitDomain = FitDomain::Complex;
        /// Share of the energy above the noise at which `Greedy` and `Hybrid` end.
        target: f64 = 0.999, unit "", range 0.01..=1.0;
        /// Maximum number of modes of each recording.
        count: usize = 64, unit "modes", range 1..=1024;
        /// Lowest frequency of a mode.
        lowest: f64 = 20.0, unit "Hz", range 1.0..=100_000.0;
        /// Highest frequency of a mode; at most 0.45 of the recording's rate.
        highest: f64 = 20_000.0, unit "Hz", range 2.0..=200_000.0;
        /// Frequency (Hz) and reverberation time (s) of bands of the room.
        room: Vec<[f64; 2]> = Vec::new(), unit "Hz, s", range 0.001..=100_000.0;
        /// Recording of a clap in the room, from which the reverberation time is measured.
        room_recording: Option<AssetPath> = None;
        /// True to compare each recording with its surrogate, which takes as long as the recording.
        surrogate: bool = true;
        /// True to compare each take with up to eight others of its object.
        compare: bool = true;
    }
}
ports! {
    pub struct ModalFeaturesPorts / ModalFeaturesIo {
        in {}
        out {
            /// The modes of the object of each recording: those that decay by less than 500 1/s at a certain rate.
            features: Value<FeatureSets>,
            /// Results of the extraction, with spectrograms.
            report: Value<ExtractionReport>,
            /// A row for each recording: onset, modes and those with a certain decay, energy that no mode explains (of the recording, of its
            /// surrogate, and from 5 ms after the onset on), if it rings, energy that the modes of other takes leave unexplained, warnings.
            table: Value<ResultTable>,
            /// A row for each pair of takes of one object: the energy of each that the modes of the other leave unexplained.
            pairs: Value<ResultTable>,
        }
    }
}

/// The node over [`extract`].
#[derive(Debug)]
pub struct ModalFeatures;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F077", max: MaxLength::Seconds(60) };
const ROOM: RecordingParam =
    RecordingParam { name: "room_recording", code: "F077", max: MaxLength::Seconds(60) };
/// Maximum number of unusable recordings that an error lists.
const MAX_LISTED: usize = 8;

impl ModalFeaturesParams {
    fn sources(&self) -> Sources<'_> {
        Sources {
            list: RecordingList {
                recordings: &self.recordings,
                folder: self.folder.as_ref(),
                manifest: self.manifest.as_ref(),
                code: RECORDINGS.code,
            },
            object: &self.object.0,
            material: &self.material.0,
        }
    }

    /// The room, typed or measured.
    fn room(&self, cx: &Build<'_>) -> Result<Room, Fault> {
        let Some(AssetPath(path)) = &self.room_recording else { return Ok(Room::new(self.room.clone())) };
        let (samples, info) = ROOM.read_mono(cx, path)?;
        let room = Room::measured(&samples, f64::from(info.rate));
        if room.bands().is_empty() {
            let reject = ROOM.unusable(path, "no octave decays by 25 dB above the noise");
            return Err(reject.help("record a clap or a balloon that bursts, with 2 s after it").into());
        }
        Ok(room)
    }

    fn extract_params(&self) -> ExtractParams {
        let extractor = match self.extractor {
            Search::Subband => Extractor::Subband,
            Search::Greedy => Extractor::Greedy { target: self.target, domain: self.fit_domain },
            Search::Hybrid => Extractor::Hybrid { target: self.target },
        };
        ExtractParams {
            extractor,
            modes: self.count,
            lowest: self.lowest,
            highest: self.highest,
            contact: true,
        }
    }
}

/// Results so far.
#[derive(Default)]
struct Found {
    sets: Vec<FeatureSet>,
    reports: Vec<RecordingReport>,
    sounds: Vec<TakeSound>,
    unusable: Vec<Reject>,
    summary: Summary,
}

impl Found {
    /// Adds the impacts of one recording.
    fn add(
        &mut self,
        p: &ModalFeaturesParams,
        cx: &Build<'_>,
        source: &ListedRecording<Take>,
        room: &Room,
    ) -> Result<(), Fault> {
        let ListedRecording { path, field, entry: take } = source;
        let unusable = |name: &str, problem: String| RECORDINGS.unusable(name, problem).at(field);
        let at_field = |e: Fault| Fault { field: Some(field.clone()), ..e };
        let (samples, info) = RECORDINGS.read_mono(cx, path).map_err(at_field)?;
        let rate = f64::from(info.rate);
        let mut parts = impacts(&samples, rate);
        if parts.len() > 1 && p.split == Split::None {
            let time = |part: &Range<usize>| {
                format!("{:.3} s", (part.start + onset(&samples[part.clone()], rate)) as f64 / rate)
            };
            let times: Vec<String> = parts.iter().map(time).collect();
            let reject = unusable(path, format!("{} impacts, at {}", parts.len(), times.join(", ")));
            self.unusable.push(reject.help("`split: First` or `split: All`, or one impact in each file"));
            return Ok(());
        }
        if p.split == Split::First {
            parts.truncate(1);
        }
        let several = parts.len() > 1;
        for (k, part) in parts.into_iter().enumerate() {
            let name = if several { format!("{path} #{}", k + 1) } else { path.clone() };
            let sound = &samples[part.clone()];
            let found = match extract(sound, rate, &p.extract_params()) {
                Ok(found) => found,
                Err(e) => {
                    self.unusable.push(unusable(&name, e.to_string()).help(e.help()));
                    continue;
                }
            };
            let after = &sound[found.onset..];
            let surrogate_db = p.surrogate.then(|| {
                let noise = surrogate(after, self.sets.len() as u64);
                extract(&noise, rate, &p.extract_params()).map_or(0.0, |found| found.residual_db)
            });
            let wide: Vec<f64> = after.iter().map(|x| f64::from(*x)).collect();
            let (pixels, seconds) = spectrogram(&wide, rate);
            let certain = found.features.iter().filter(|f| f.is_certain(UNCERTAINTY) && room.leaves(f));
            let certain: Vec<_> = certain.copied().collect();
            self.reports.push(RecordingReport {
                recording: name.clone(),
                take: take.clone(),
                onset_s: (part.start + found.onset) as f64 / rate,
                modes: found.features.len(),
                certain: certain.len(),
                unexplained_db: found.residual_db,
                unexplained_after_5_ms_db: found.late_residual_db,
                surrogate_db,
                ringing: surrogate_db.map(|db| found.residual_db <= db - RINGING),
                by_other_takes_db: None,
                warnings: warnings(sound, rate, &found, room),
                phase_drifts: certain.iter().map(|f| phase_drift(f, &found.residual, rate)).collect(),
                features: certain.clone(),
                picture: Image::grey(PICTURE, &pixels).unwrap_or_default(),
                seconds,
            });
            let (object, support) = (take.object.clone(), take.support.clone());
            let set = FeatureSet { recording: name, object, support, features: certain };
            if p.compare {
                let all = FeatureSet { features: found.features, ..set.clone() };
                self.sounds.push(TakeSound { set: all, samples: sound.to_vec(), rate });
            }
            self.sets.push(set);
        }
        self.summary.extend(recording_warnings(path, &info, &samples));
        Ok(())
    }

    /// The error of recordings without modes, or a warning for each.
    fn check_unusable(&mut self, rule: Unusable) -> Result<Vec<String>, Reject> {
        let mut all = std::mem::take(&mut self.unusable).into_iter();
        let rest = all.len().saturating_sub(1);
        if rule == Unusable::Error || self.sets.is_empty() {
            let Some(mut first) = all.next() else { return Ok(Vec::new()) };
            if rest > 0 {
                let others: Vec<String> = all.take(MAX_LISTED - 1).map(|e| e.message).collect();
                let more = rest - others.len();
                let more = if more > 0 { format!("; and {more} more") } else { String::new() };
                first.message = format!("{}; {}{more}", first.message, others.join("; "));
            }
            return Err(first);
        }
        let texts: Vec<String> = all.map(|e| e.to_string()).collect();
        for text in &texts {
            self.summary.push(("warning", format!("{text}: left out").into()));
        }
        Ok(texts)
    }
}

impl Func for ModalFeatures {
    type Params = ModalFeaturesParams;
    type Ports = ModalFeaturesPorts;
    const NAME: &'static str = "ModalFeatures";
    const VERSION: u32 = 4;
    // Recordings are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &ModalFeaturesParams, s: &mut Shape<'_, '_, ModalFeaturesPorts>) -> Result<(), Reject> {
        if p.highest <= p.lowest {
            let message = format!("`highest` is {} Hz, `lowest` {} Hz", p.highest, p.lowest);
            s.wrong(Reject::new("F077", message).at("highest").help("it must be more"));
        }
        if let Some(AssetPath(path)) = &p.room_recording {
            ROOM.check_one(s, ROOM.name, path);
            if !p.room.is_empty() {
                let reject = Reject::new("F077", "both `room` and `room_recording` are given").at("room");
                s.wrong(reject.help("leave out one of the two"));
            }
        }
        if p.fit_domain == FitDomain::Power && p.extractor != Search::Greedy {
            let reject =
                Reject::new("F077", "`fit_domain: Power` belongs to the extractor `Greedy`").at("fit_domain");
            s.wrong(reject.help("set `extractor: Greedy`, or leave it out"));
        }
        let sources = p.sources().all(s)?;
        for source in &sources {
            if !RECORDINGS.check_one(s, &source.field, &source.path) {
                break;
            }
        }
        let materials: BTreeSet<&str> = sources.iter().map(|source| source.entry.material.as_str()).collect();
        if materials.len() > 1 {
            let names: Vec<String> = materials.iter().map(|name| format!("{name:?}")).collect();
            s.note(format!(
                "takes of several materials ({}): `material` selects one for a fit",
                names.join(", ")
            ));
        }
        s.prepare(sources);
        Ok(())
    }

    fn eval(p: &ModalFeaturesParams, cx: &Build<'_>, mut io: ModalFeaturesIo<'_>) -> Result<Summary, Fault> {
        let mut found = Found::default();
        let room = p.room(cx)?;
        let sources = cx.prepared::<Vec<ListedRecording<Take>>>().unwrap_or_default();
        for (k, source) in sources.iter().enumerate() {
            if (cx.monitor)(k as f64 / sources.len() as f64) {
                return Err(Fault::stopped());
            }
            found.add(p, cx, source, &room)?;
        }
        let unusable = found.check_unusable(p.unusable)?;
        let pairs = compare_takes(&found.sounds);
        for (k, report) in found.reports.iter_mut().enumerate() {
            report.by_other_takes_db = median_of_take(&pairs, k);
            if let Some(db) = report.by_other_takes_db.filter(|db| *db > ONE_OBJECT) {
                report.warnings.push(format!(
                    "the modes of the other takes of {:?} leave {db:.1} dB unexplained, more than {ONE_OBJECT:.0} dB: it may be another object",
                    report.take.object
                ));
            }
        }
        let Found { sets, reports, mut summary, .. } = found;
        let worst = reports.iter().map(|r| r.unexplained_db).fold(f64::NEG_INFINITY, f64::max);
        summary.push(("recordings", reports.len().into()));
        summary.push(("features", sets.iter().map(|s| s.features.len()).sum::<usize>().into()));
        summary.push(("largest_unexplained_db", worst.into()));
        if p.surrogate {
            summary.push(("ringing", reports.iter().filter(|r| r.ringing == Some(true)).count().into()));
        }
        for report in &reports {
            let texts = report.warnings.iter();
            summary.extend(texts.map(|text| ("warning", format!("{}: {text}", report.recording).into())));
        }
        io.features.set(FeatureSets { sets });
        let report = ExtractionReport { recordings: reports, pairs, unusable };
        io.table.set(report.table());
        io.pairs.set(report.pairs_table());
        io.report.set(report);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ModalFeaturesParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("hit.wav", trial_impact(rng));
        files.insert("takes.csv", "file,object,material,support\nhit.wav,bar,steel,\"fingers, 2\"\n");
        let p = ModalFeaturesParams::trial(rng);
        let from_list = rng.below(2) == 0;
        let params = ModalFeaturesParams {
            recordings: if from_list { vec!["hit.wav".into()] } else { Vec::new() },
            folder: None,
            room_recording: None,
            manifest: (!from_list).then(|| "takes.csv".into()),
            material: "".into(),
            split: Split::First,
            fit_domain: FitDomain::Complex,
            count: 1 + rng.below(8),
            lowest: rng.between(10.0, 100.0),
            highest: rng.between(2500.0, 5000.0),
            ..p
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests;
