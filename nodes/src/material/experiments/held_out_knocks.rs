//! Recognition of knocks by fits without them, as a node.

use super::held_out::{Candidate, HeldOut, KnockedObject, Take, held_out};
use super::synthetic::{Collection, CollectionSize};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::io::{MaxLength, RecordingParam};
use crate::material::Material;
use crate::material::estimation::point::DampingPoint;
use crate::modal::extraction::poles::resynthesis;
use crate::modal::{ExtractionReport, Feature, FeatureSet, FeatureSets, ONE_OBJECT, onset};
use crate::plot::{Chart, Line};
use crate::statistics::quantile;
use crate::table::ResultTable;
use crate::{params, ports};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Sample rate of synthetic takes, and of takes without a recording, Hz.
const RATE: f64 = 44_100.0;
/// Duration of these, s.
const DURATION: f64 = 0.6;
/// Level of the modes of a synthetic take, full scale.
const LEVEL: f64 = 0.1;

params! {
    /// Leaves each knock on an object out of the fit of its material, and compares candidate materials on it.
    ///
    /// `features` has the takes, which state their objects, `candidates` further materials. Each take of each object is left out once. The candidates are
    /// the material fitted to the object's other takes, which is the right one, those fitted to all takes of each other object, and the linked
    /// ones. For each, the summary counts how often the right one wins by the likelihood of the take's dampings, and by the spectral
    /// distance of the resynthesis, which has the frequencies and amplitudes of the take and the decay rates `(c(lambda) + 1/eta)/2` of the
    /// candidate. The chance rate is that of a guess.
    ///
    /// Takes whose files are listed in `recordings` are compared with their recordings. The part of the recording that the take's own modes
    /// leave unexplained is added to each resynthesis. Other takes are compared with the resynthesis of their own decay rates. An object is
    /// not used if the modes of some takes leave more than -10 dB of the others unexplained, by the linked reports: these are recordings of
    /// several objects.
    ///
    /// # Randomness
    /// Synthetic objects are a function of the seed.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 4, for the likelihood.
    pub struct HeldOutKnocksParams {
        /// Recordings of the takes, by the names that their features have, of at most a minute each.
        recordings: Vec<AssetPath> = vec![];
        /// Number of synthetic objects besides, each of a material of its own.
        synthetic: usize = 0, unit "", range 0..=1000;
        /// Number of takes of a synthetic object.
        takes: usize = 5, unit "", range 2..=1000;
        /// Relative standard deviation of the dampings of synthetic takes.
        noise: f64 = 0.03, unit "", range 0.0..=1.0;
    }
}
ports! {
    pub struct HeldOutKnocksPorts / HeldOutKnocksIo {
        in {
            /// The takes, of any number of objects.
            features: Many<Value<FeatureSets>>,
            /// The reports of recorded takes, which compare them with each other.
            reports: Many<Value<ExtractionReport>>,
            /// Materials that the takes may be of, besides those of the objects.
            candidates: Many<Value<Material>>,
        }
        out {
            /// A row for each take and candidate: likelihood, spectral distance.
            table: Value<ResultTable>,
            /// A row for each object, with the energy that its takes leave unexplained of each other.
            objects: Value<ResultTable>,
        }
    }
}

/// The node over [`held_out`].
#[derive(Debug)]
pub struct HeldOutKnocks;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F077", max: MaxLength::Seconds(60) };

fn synthetic_object(p: &HeldOutKnocksParams, k: usize, seed: u64) -> KnockedObject {
    let mut rng = Rng::new(seed.wrapping_add(1 + k as u64));
    let size = CollectionSize { objects: 3, supports: p.takes, sounds: p.takes };
    // One of the three, so that bars, plates and shells take turns.
    let sounds = Collection::new(&mut rng, &size).with_errors(&mut rng, p.noise, 0.0).sounds;
    let name = format!("synthetic {}", k + 1);
    let own = sounds.into_iter().skip((k % 3) * p.takes).take(p.takes).enumerate();
    let take = |(t, points): (usize, Vec<DampingPoint>)| {
        let mut feature = |p: &DampingPoint| {
            let decay = 0.5 * p.c;
            Feature {
                freq_hz: (p.lambda - decay * decay).max(1.0).sqrt() / TAU,
                decay,
                amp: LEVEL * libm::exp(rng.between(-3.0, 0.0)),
                phase: rng.between(-PI, PI),
                sd_decay: 0.5 * p.sd_c,
                ..Feature::default()
            }
        };
        let features: Vec<Feature> = points.iter().map(&mut feature).collect();
        let recording = format!("{name}, take {}", t + 1);
        own_sound(FeatureSet { recording, object: name.clone(), support: String::new(), features })
    };
    KnockedObject { takes: own.map(take).collect(), name: name.clone(), synthetic: true }
}

/// A take that sounds as its features.
fn own_sound(features: FeatureSet) -> Take {
    let samples = (DURATION * RATE) as usize;
    let sound = resynthesis(&features.features, RATE, samples, |f| f.decay);
    Take { features, sound, rate: RATE }
}

/// An object with, for each take that was recorded, the energy that the modes of its other takes leave unexplained, dB.
struct Linked {
    object: KnockedObject,
    unexplained: Vec<f64>,
}

impl Linked {
    /// Median of these; `None` without recorded takes.
    fn median(&self) -> Option<f64> {
        let mut all = self.unexplained.clone();
        all.sort_by(f64::total_cmp);
        (!all.is_empty()).then(|| quantile(&all, 0.5))
    }
}

/// The takes of each object, in the order of the first take of each.
fn linked<'a>(
    sets: impl Iterator<Item = &'a FeatureSet>,
    sounds: &HashMap<&str, (Vec<f64>, f64)>,
    unexplained: &HashMap<&str, f64>,
) -> Result<Vec<Linked>, Fault> {
    let mut all: Vec<Linked> = Vec::new();
    for set in sets {
        if let Some(fault) = set.fault() {
            return Err(Fault::new("F135", format!("{:?}: {fault}", set.recording)).at("features"));
        }
        let take = match sounds.get(set.recording.as_str()) {
            Some((sound, rate)) => Take { features: set.clone(), sound: sound.clone(), rate: *rate },
            None => own_sound(set.clone()),
        };
        let k = all.iter().position(|l| l.object.name == set.object).unwrap_or_else(|| {
            let object = KnockedObject { name: set.object.clone(), takes: Vec::new(), synthetic: false };
            all.push(Linked { object, unexplained: Vec::new() });
            all.len() - 1
        });
        all[k].object.takes.push(take);
        all[k].unexplained.extend(unexplained.get(set.recording.as_str()));
    }
    Ok(all)
}

/// A linked material; without a fit of its own it has the mean support and noise of the others.
fn candidate(material: &Material, mean: [f64; 2]) -> Candidate {
    let [support, noise] = material.fit.as_ref().map_or(mean, |fit| [fit.support, fit.noise]);
    Candidate { name: material.name.clone(), model: material.damping.clone(), support, noise }
}

fn table(all: &[HeldOut]) -> ResultTable {
    let mut table = ResultTable::new(&[
        "object",
        "take",
        "features",
        "candidate",
        "right",
        "log_likelihood_per_feature",
        "spectral_distance_db",
    ]);
    let mut margins = [Vec::new(), Vec::new()];
    for (k, take) in all.iter().enumerate() {
        for score in &take.scores {
            table.push([
                take.object.as_str().into(),
                take.take.as_str().into(),
                take.features.into(),
                score.candidate.as_str().into(),
                if score.right { "yes" } else { "no" }.into(),
                score.log_likelihood.into(),
                score.spectral_distance_db.into(),
            ]);
        }
        if let [right, others @ ..] = take.scores.as_slice() {
            let likeliest = others.iter().map(|s| s.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
            let nearest = others.iter().map(|s| s.spectral_distance_db).fold(f64::INFINITY, f64::min);
            let margin = [right.log_likelihood - likeliest, nearest - right.spectral_distance_db];
            for (list, margin) in margins.iter_mut().zip(margin).filter(|(_, m)| m.is_finite()) {
                list.push([k as f64 + 1.0, margin]);
            }
        }
    }
    let names = ["nats per feature", "spectral distance, dB"];
    table.charts = (names.iter().zip(margins))
        .map(|(name, points)| {
            let zero = Line::new("even", vec![[0.0, 0.0], [all.len() as f64 + 1.0, 0.0]]);
            let dots = Line::dots("takes", points);
            let title = "Right material before the best other one";
            Chart::of(title, ("take", false), (name, false), vec![zero, dots])
        })
        .collect();
    table
}

/// Wins of the right material among takes, as text: by likelihood and by spectral distance.
fn wins<'a>(takes: impl Iterator<Item = &'a HeldOut> + Clone) -> [String; 2] {
    let count = takes.clone().count();
    [0, 1].map(|j| format!("{} of {count}", takes.clone().filter(|t| t.better()[j] == 0).count()))
}

impl Func for HeldOutKnocks {
    type Params = HeldOutKnocksParams;
    type Ports = HeldOutKnocksPorts;
    const NAME: &'static str = "HeldOutKnocks";
    const VERSION: u32 = 2;
    // Takes are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &HeldOutKnocksParams, s: &mut Shape<'_, '_, HeldOutKnocksPorts>) -> Result<(), Reject> {
        RECORDINGS.check(s, &p.recordings);
        Ok(())
    }

    fn eval(p: &HeldOutKnocksParams, cx: &Build<'_>, mut io: HeldOutKnocksIo<'_>) -> Result<Summary, Fault> {
        let seed = u64::from(cx.random.words(0, 0, 0)[0]);
        let mut sounds: HashMap<&str, (Vec<f64>, f64)> = HashMap::new();
        for AssetPath(path) in &p.recordings {
            let (samples, info) = RECORDINGS.read_mono(cx, path)?;
            let rate = f64::from(info.rate);
            let sound = samples[onset(&samples, rate)..].iter().map(|x| f64::from(*x)).collect();
            sounds.insert(path, (sound, rate));
        }
        let mut summary = Summary::new();
        let (mut objects, mut left_out) = (Vec::new(), Vec::new());
        let mut sets = ResultTable::new(&["object", "takes", "one_object", "unexplained_by_other_takes_db"]);
        let reports = io.reports.iter().flat_map(|report| &report.recordings);
        let unexplained =
            reports.filter_map(|r| Some((r.recording.as_str(), r.by_other_takes_db?))).collect();
        for linked in linked(io.features.iter().flat_map(|all| &all.sets), &sounds, &unexplained)? {
            let (median, object) = (linked.median(), linked.object);
            let holds = median.map(|db| db <= ONE_OBJECT);
            sets.push([
                object.name.as_str().into(),
                object.takes.len().into(),
                holds.map_or("not compared", |holds| if holds { "yes" } else { "no" }).into(),
                median.into(),
            ]);
            if holds == Some(false) {
                left_out.push(format!("the takes of {:?} are not of one object", object.name));
            } else if object.takes.len() < 2 {
                left_out.push(format!("{:?} has a single take", object.name));
            } else {
                objects.push(object);
            }
        }
        objects.extend((0..p.synthetic).map(|k| synthetic_object(p, k, seed)));
        let fitted = || {
            objects.iter().filter_map(|o| {
                let all: Vec<FeatureSet> = o.takes.iter().map(|t| t.features.clone()).collect();
                Candidate::fit(&o.name, &all)
            })
        };
        let count = fitted().count().max(1) as f64;
        let mean = [
            fitted().map(|c| c.support).sum::<f64>() / count,
            fitted().map(|c| c.noise).sum::<f64>() / count,
        ];
        let given: Vec<Candidate> = io.candidates.iter().map(|m| candidate(m, mean)).collect();
        let all = held_out(&objects, &given);
        let candidates = all.iter().map(|t| t.scores.len()).max().unwrap_or(0);
        summary.push(("objects", objects.len().into()));
        summary.push(("not_used", serde_json::json!(left_out)));
        summary.push(("candidates", candidates.into()));
        if candidates > 0 {
            summary.push(("chance_rate", (1.0 / candidates as f64).into()));
        }
        for (synthetic, names) in [
            (false, ["recorded_right_by_likelihood", "recorded_right_by_spectrum"]),
            (true, ["synthetic_right_by_likelihood", "synthetic_right_by_spectrum"]),
        ] {
            let takes = all.iter().filter(|t| t.synthetic == synthetic);
            for (name, text) in names.into_iter().zip(wins(takes)) {
                summary.push((name, text.into()));
            }
        }
        let each = all.chunk_by(|a, b| a.object == b.object).map(|takes| {
            let [likelihood, spectrum] = wins(takes.iter());
            format!("{}: {likelihood} by likelihood, {spectrum} by spectrum", takes[0].object)
        });
        summary.push(("right_by_object", serde_json::json!(each.collect::<Vec<_>>())));
        io.table.set(table(&all));
        io.objects.set(sets);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (HeldOutKnocksParams, MemoryFiles) {
        let p = HeldOutKnocksParams {
            recordings: Vec::new(),
            synthetic: 1 + rng.below(2),
            takes: 2 + rng.below(2),
            noise: rng.between(0.01, 0.1),
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::AnyValue;
    use crate::core::params::{Datum, Params};
    use crate::core::standalone::{Feed, Standalone};

    #[test]
    fn synthetic_takes_are_assigned_to_their_material_far_more_often_than_by_chance() {
        let p = HeldOutKnocksParams::read(&|name| (name == "synthetic").then_some(Datum::Int(8))).unwrap();
        let objects: Vec<KnockedObject> = (0..8).map(|k| synthetic_object(&p, k, 4)).collect();
        let all = held_out(&objects, &[]);
        let right = |j: usize| all.iter().filter(|t| t.better()[j] == 0).count();
        assert!(all.len() >= 35 && all.iter().all(|t| t.scores.len() == 8 && t.scores[0].right));
        assert!(
            2 * right(0) > all.len() && 2 * right(1) > all.len(),
            "{} {} of {}",
            right(0),
            right(1),
            all.len()
        );
    }

    #[test]
    fn features_without_recordings_are_compared_with_their_own_sound() {
        let p = HeldOutKnocksParams::read(&|_| None).unwrap();
        let objects: Vec<KnockedObject> = (0..2).map(|k| synthetic_object(&p, k, 2)).collect();
        let sets = |o: &KnockedObject| {
            let sets = o.takes.iter().map(|t| t.features.clone()).collect();
            Feed::value(AnyValue::new(FeatureSets { sets }))
        };
        let standalone = Standalone::func::<HeldOutKnocks>(p)
            .feed(HeldOutKnocksPorts::features.index(), sets(&objects[0]))
            .feed(HeldOutKnocksPorts::features.index(), sets(&objects[1]));
        let run = standalone.run().unwrap();
        let table = run.value(0).unwrap().get::<ResultTable>().unwrap().clone();
        assert_eq!(table.rows.len(), 20, "{}", table.csv());
        let sets = run.value(1).unwrap().get::<ResultTable>().unwrap().clone();
        assert!(sets.csv().contains("not compared"), "{}", sets.csv());
    }
}
