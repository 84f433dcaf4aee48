//! Proposals of correspondences, as a node.

use super::params::{Cause, Silence, SuggestParams};
use super::suggest::{Proposal, leaves_out_silence, suggest};
use crate::artefact::text::Location;
use crate::core::fault::{Fault, Reject};
use crate::core::files::WriteSeek;
use crate::core::node::{Class, Node, Summary, same_rate};
use crate::core::params::{OutPath, Text};
use crate::core::ports::{In, Stream, Value};
use crate::core::shape::{Build, Ends, Shape};
use crate::core::state::{StateArchive, Stateful};
use crate::feature::Features;
use crate::unit::selection::check_tags;
use crate::unit::{Segment, UnitDatabase};
use crate::warp::correspondence::target_features::{TargetFeatures, checked};
use crate::warp::correspondence::{Correspondence, CorrespondenceSet, SourceName, write_correspondences};
use crate::{impl_state, params, ports};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// First lines of the file: provenance and units.
const COMMENTS: [&str; 3] = [
    "Proposed by CorrespondenceSuggester of foley: listen, then keep, move or disable each.",
    "`target` and `database` are starts in s, `source` the recording in which `database` is counted (from 0), `duration` in s.",
    "`label`: gain in the distance between target and recordings, and other places to try.",
];

params! {
    /// Proposes a file of correspondences, which `CorrespondenceSet` reads once they are accepted.
    ///
    /// Windows of the target and of the database are compared by the ranks of their features and matched by optimal transport. Moments of
    /// the target that are far apart are proposed with the matching moments of the database: the quietest first, then the ones that reduce the distance
    /// most, until one more gains less than 1 %. A label states the gain, as a share of the distance without a warp, and other
    /// moments of other recordings to try. Nothing is applied: listen, then keep, move or disable each.
    ///
    /// Gains measure the distance in total, and do not ensure that loud moments remain loud. To ensure this, set `level: 3.0` and
    /// `all: true`: then moments are spread over all levels, and each is matched with recordings of equal loudness.
    ///
    /// Silence of the target is proposed with the quietest moment of recordings that fall 30 dB below their loudest. Where none does, it
    /// is left out with a warning: no recording sounds like it.
    ///
    /// If the parts of a synthetic target are linked to `friction` and `crumple`, moments of either are proposed, and recordings
    /// with the tags `friction`, `crumple` and `silence` count as of these causes.
    ///
    /// # Source
    /// Cuturi, "Sinkhorn distances" (NIPS 2013); Bonneel et al., "Sliced and Radon Wasserstein barycenters of measures" (2015).
    pub struct CorrespondenceSuggesterParams {
        /// The file to write.
        path: OutPath;
        /// Maximum number of proposals.
        count: usize = 12, unit "proposals", range 1..=50;
        /// Length of a proposal.
        window: usize = 24, unit "units", range 1..=1000;
        /// lambda of the warp that ranks them.
        lambda: f64 = 1000.0, unit "", range 0.0001..=1e12;
        /// Weight of loudness relative to spectral shape in the alignment of target and recordings.
        level: f64 = 1.0, unit "", range 0.0..=100.0;
        /// List all `count` proposals, also those that gain little.
        all: bool = false;
        /// Propose only recordings with one of these tags; empty for all.
        tags: Vec<Text> = Vec::new();
    }
}
ports! {
    pub struct CorrespondenceSuggesterPorts / CorrespondenceSuggesterIo {
        in {
            /// Features of the target, filtered as those of the database.
            features: Stream<Features>,
            /// The database.
            database: Value<UnitDatabase>,
            /// The part of the target's sound that is friction.
            friction: Option<Stream<f32>>,
            /// The part of it that is crumpling.
            crumple: Option<Stream<f32>>,
        }
        out {}
    }
}

/// The node over [`suggest`].
pub struct CorrespondenceSuggester {
    target: TargetFeatures,
    file: Box<dyn WriteSeek>,
    params: CorrespondenceSuggesterParams,
    /// Powers of the causes named in [`CAUSES`].
    causes: [Option<UnitPower>; 2],
}

/// Tags of recordings of the cause at the input of the same name, and the tag of recordings without a cause.
const CAUSES: [&str; 2] = ["friction", "crumple"];
const SILENCE_TAG: &str = "silence";

/// A target is silent up to so far above the floor of its features, and a recording so far below the loudest of all and so near to the
/// quietest; dB.
const ABOVE: f64 = 10.0;
const BELOW: f64 = 30.0;
const WITHIN: f64 = 6.0;

/// Power of a sound per unit.
struct UnitPower {
    unit: usize,
    power: Vec<f64>,
    most: usize,
}
impl_state!(UnitPower { power, most });

impl UnitPower {
    fn add(&mut self, audio: &In<'_, f32>) {
        let first = usize::try_from(audio.first()).unwrap_or(0);
        for (sample, frame) in (first..).zip(audio.items().chunks_exact(audio.width().max(1))) {
            let unit = sample / self.unit.max(1);
            if unit >= self.most {
                break;
            }
            if unit >= self.power.len() {
                self.power.resize(unit + 1, 0.0);
            }
            if let Some(power) = self.power.get_mut(unit) {
                *power += frame.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            }
        }
    }
}

/// Returns for each segment of a database true if it has a cause; `None` if its tag does not state one.
fn tagged(db: &UnitDatabase, segments: &[&Segment], cause: &str) -> Vec<Option<bool>> {
    let known = |tag: &str| CAUSES.contains(&tag) || tag == SILENCE_TAG;
    let segment = |s: &&Segment| {
        let tag = db.sources.get(s.source as usize)?.tag.as_str();
        known(tag).then_some(tag == cause)
    };
    segments.iter().map(segment).collect()
}

impl fmt::Debug for CorrespondenceSuggester {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CorrespondenceSuggester({:?})", self.params)
    }
}

/// Recording of a unit of the database, and the time at which the unit begins in it.
fn recording_time(db: &UnitDatabase, unit: usize) -> (u32, f64) {
    let Some(segment) = db.segment_of(unit).and_then(|k| db.segments.get(k)) else { return (0, 0.0) };
    let samples = segment.offset as f64 + ((unit - segment.start as usize) * db.unit()) as f64;
    (segment.source, samples / db.conventions.rate.as_f64())
}

impl CorrespondenceSuggester {
    fn correspondence(&self, proposal: &Proposal, channel: Option<u32>) -> Correspondence {
        let db = &self.target.database;
        let (source, database) = recording_time(db, proposal.database);
        let others = proposal.alternatives.iter().map(|unit| {
            let (source, seconds) = recording_time(db, *unit);
            format!(", or {seconds:.3} s of recording {source}")
        });
        Correspondence {
            // Without the sign of a zero.
            label: format!(
                "gain {:.0} %{}",
                (100.0 * proposal.gain).round() + 0.0,
                others.collect::<String>()
            ),
            target: proposal.target as f64 / self.target.rate,
            database,
            source: Some(SourceName::Index(source)),
            duration: self.params.window as f64 / self.target.rate,
            channel,
            weight: 1.0,
            enabled: true,
            location: Location::default(),
        }
    }
}

impl Node for CorrespondenceSuggester {
    type Params = CorrespondenceSuggesterParams;
    type Ports = CorrespondenceSuggesterPorts;
    const NAME: &'static str = "CorrespondenceSuggester";
    const VERSION: u32 = 7;
    const CLASS: Class = Class::Offline;

    fn shape(
        p: &CorrespondenceSuggesterParams,
        s: &mut Shape<'_, '_, CorrespondenceSuggesterPorts>,
    ) -> Result<(), Reject> {
        type Port = CorrespondenceSuggesterPorts;
        let none = Some(Arc::new(CorrespondenceSet::default()));
        checked(&s.input(Port::features), s.value(Port::database), none)?;
        if let Some(db) = s.value(Port::database) {
            check_tags(&db, &p.tags)?;
        }
        s.when_ended(Port::features, Ends::Stop);
        let features = s.input(Port::features);
        for (name, port) in [("friction", Port::friction), ("crumple", Port::crumple)] {
            if let Some(audio) = s.optional(port) {
                let unit = u64::from(features.format.conventions.unit);
                let needed = features.rate.times(unit).unwrap_or(audio.rate);
                s.check(same_rate(name, audio.rate, "the sound of `features`", needed));
            }
        }
        Ok(())
    }

    fn build(p: &CorrespondenceSuggesterParams, cx: &Build<'_>) -> Result<Self, Fault> {
        type Port = CorrespondenceSuggesterPorts;
        let none = Arc::new(CorrespondenceSet::default());
        let target = TargetFeatures::new(cx.input(Port::features), cx.value(Port::database), none)?;
        let unit = target.format.conventions.unit as usize;
        let most = usize::try_from(cx.input(Port::features).items().unwrap_or(0)).unwrap_or(0);
        let unit_power = |port| cx.optional(port).map(|_| UnitPower { unit, power: Vec::new(), most });
        let causes = [unit_power(Port::friction), unit_power(Port::crumple)];
        Ok(Self { target, file: cx.create("path", &p.path.0)?, params: p.clone(), causes })
    }

    fn run(&mut self, io: CorrespondenceSuggesterIo<'_>) -> Result<(), Fault> {
        self.target.add(io.features.items());
        for (cause, audio) in self.causes.iter_mut().zip([&io.friction, &io.crumple]) {
            if let (Some(cause), Some(audio)) = (cause, audio) {
                cause.add(audio);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: CorrespondenceSuggesterIo<'_>) -> Result<Summary, Fault> {
        let (target, p) = (&self.target, &self.params);
        let db = &target.database;
        let allowed = check_tags(db, &p.tags)?;
        let open = db.originals().filter(|s| allowed.get(s.range().start) == Some(&true));
        let open: Vec<&Segment> = open.collect();
        let segments: Vec<Range<usize>> = open.iter().map(|s| s.range()).collect();
        let silence = |(step, floor): (f64, f64)| Silence {
            target: floor + ABOVE * step,
            below: BELOW * step,
            within: WITHIN * step,
        };
        let params = SuggestParams {
            window: p.window,
            hop: (p.window / 2).max(1),
            count: p.count,
            lambda: p.lambda,
            level: p.level,
            all: p.all,
            silence: db.conventions.loudness(db.floor_energy).map(silence),
            ..SuggestParams::default()
        };
        let known = self.causes.iter().zip(CAUSES).filter_map(|(unit_power, name)| {
            Some(Cause { power: unit_power.as_ref()?.power.clone(), segments: tagged(db, &open, name) })
        });
        let causes: Vec<Cause> = known.collect();
        let (mut pairs, mut silent) = (Vec::new(), false);
        for vector in 0..target.format.vectors {
            let own = target.vector(vector);
            let (database, d) = (&target.database.features, target.format.dims());
            let found = suggest(&own, database, &segments, d, &params, &causes)
                .map_err(|e| Fault::new("F111", e.to_string()).at("features"))?;
            silent |= leaves_out_silence(&found, &own, d, &params);
            let channel = (target.format.vectors > 1).then_some(vector as u32);
            pairs.extend(found.iter().map(|proposal| self.correspondence(proposal, channel)));
        }
        let set = CorrespondenceSet {
            length: Some(target.seconds()),
            database: db.recordings(),
            pairs,
            ..CorrespondenceSet::default()
        };
        let text = write_correspondences(&set, &COMMENTS);
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.flush());
        written.map_err(|e| Fault::new("F080", format!("cannot write {:?}: {e}", p.path.0)).at("path"))?;
        let mut summary: Summary =
            vec![("path", p.path.0.as_str().into()), ("proposals", set.pairs.len().into())];
        if silent {
            let text = format!(
                "the target falls silent, and no recording is {BELOW} dB softer than the loudest: silence is left out; record some, or \
                 let the units sleep (`target` of UnitSelector)"
            );
            summary.push(("warning", text.into()));
        }
        Ok(summary)
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.target.archive_state(archive)?;
        self.causes.iter_mut().try_for_each(|cause| archive.each(cause))
    }
}
