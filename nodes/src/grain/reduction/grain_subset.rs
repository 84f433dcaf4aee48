//! The node `GrainSubset`.

use super::subset::{reduced, retained_grains};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::matching_tags;
use crate::grain::synthesis::check_patterns;
use crate::{params, ports};

params! {
    /// Chooses the most useful grains under a budget of memory.
    ///
    /// In each step the grain is added that raises the signal-to-noise ratio of the recordings most for its bytes: grains that many passages
    /// use, and neighbours, which share the samples around their cut. The budget is never exceeded.
    ///
    /// In `rewritten`, passages of grains that are left out fall to the next peak of their pattern. For more of them, link `reduced` and the
    /// recordings to a `GrainCorrelate`.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 5.1.
    pub struct GrainSubsetParams {
        /// Greatest number of bytes of the grains; None for `share`.
        bytes: Option<u64> = None, unit "bytes", range 0..=u64::MAX;
        /// Share of the bytes of the grains, without `bytes`.
        share: f64 = 0.5, unit "", range 0.0..=1.0;
        /// Tags of the recordings that count, such as `stone scrape`; all by default.
        tags: Text = "".into();
        /// Sound stored beyond the ends of grains without neighbours, for joins.
        margin: f64 = 0.005, unit "s", range 0.0..=0.1;
    }
}
ports! {
    pub struct GrainSubsetPorts / GrainSubsetIo {
        in {
            /// The grains.
            dictionary: Value<GrainDictionary>,
            /// Patterns of the grains.
            patterns: Value<CorrelationPatterns>,
        }
        out {
            /// The grains that are left.
            reduced: Value<GrainDictionary>,
            /// The patterns over them.
            rewritten: Value<CorrelationPatterns>,
        }
    }
}

/// The node over [`retained_grains`].
#[derive(Debug)]
pub struct GrainSubset;

impl Func for GrainSubset {
    type Params = GrainSubsetParams;
    type Ports = GrainSubsetPorts;
    const NAME: &'static str = "GrainSubset";
    const VERSION: u32 = 2;
    // Sources are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn eval(p: &GrainSubsetParams, _: &Build<'_>, mut io: GrainSubsetIo<'_>) -> Result<Summary, Fault> {
        let (dictionary, patterns) = (io.dictionary, io.patterns);
        check_patterns(patterns, dictionary)?;
        let (found, _) = matching_tags(&p.tags.0, patterns.patterns.iter().map(|p| p.tags.as_slice()));
        if found.is_empty() {
            let message = format!("no recording has a tag of {:?}", p.tags.0);
            return Err(Fault::new("F151", message).at("tags").help("leave `tags` empty for all recordings"));
        }
        let names: Vec<&str> = found.iter().map(|k| patterns.patterns[*k].name.as_str()).collect();
        let chosen = |pattern: &Pattern| names.contains(&pattern.name.as_str());
        let budget = p.bytes.map_or((p.share * dictionary.bytes() as f64) as usize, |bytes| bytes as usize);
        let margin = (p.margin * dictionary.rate).round() as usize;
        let retained = retained_grains(dictionary, patterns, &chosen, budget, margin);
        if !retained.contains(&true) {
            let message = format!("no grain fits into {budget} bytes; all have {}", dictionary.bytes());
            let at = if p.bytes.is_some() { "bytes" } else { "share" };
            return Err(Fault::new("F150", message).at(at).help("a grain has 1 to 10 kB"));
        }
        let all = reduced(dictionary, patterns, &retained, margin);
        let mut summary = all.dictionary.summary();
        summary.push(("budget", budget.into()));
        let empty = all.patterns.patterns.iter().filter(|p| chosen(p) && p.peaks.is_empty()).count();
        if empty > 0 {
            summary.push(("warning", format!("{empty} patterns have no grain left").into()));
        }
        io.reduced.set(all.dictionary);
        io.rewritten.set(all.patterns);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (GrainSubsetParams, MemoryFiles) {
        let p = GrainSubsetParams::trial(rng);
        let share = rng.between(0.3, 1.0);
        (GrainSubsetParams { bytes: None, share, tags: "".into(), ..p }, MemoryFiles::default())
    }
}
