//! The node `GrainCluster`.

use super::clusters::{Substitute, merged, substitutes};
use super::similarity::{norms, similar_pairs};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::synthesis::check_patterns;
use crate::table::ResultTable;
use crate::{params, ports};

params! {
    /// Makes a dictionary smaller: one grain replaces each cluster of nearly equal grains.
    ///
    /// Grains that patterns use most come first; each joins the one that correlates most with it, by at least `merge`, or stays. Patterns are
    /// rewritten: another grain at another time, with the gain of the least error. The error of a grain that is replaced is
    /// `sqrt(1 - merge^2)` of it at most: 0.9 leaves -7.2 dB, 0.99 leaves -17 dB.
    ///
    /// Without `patterns`, a dictionary becomes smaller before recordings are correlated with it, which shortens the correlation in proportion.
    ///
    /// `table` has the cluster of each grain.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 6, which
    /// names this as future work.
    pub struct GrainClusterParams {
        /// Minimum normalised cross-correlation of a grain with its leader; 1 for scaled copies.
        merge: f64 = 0.9, unit "", range 0.3..=1.0;
        /// Number of grains of similar spectrum that each grain is compared with.
        neighbours: usize = 32, unit "", range 1..=10_000;
        /// Sound stored beyond the ends of grains without neighbours, for joins.
        margin: f64 = 0.005, unit "s", range 0.0..=0.1;
    }
}
ports! {
    pub struct GrainClusterPorts / GrainClusterIo {
        in {
            /// The grains.
            dictionary: Value<GrainDictionary>,
            /// Patterns of the grains.
            patterns: Option<Value<CorrelationPatterns>>,
        }
        out {
            /// The grains that are left.
            reduced: Value<GrainDictionary>,
            /// The patterns over them.
            rewritten: Value<CorrelationPatterns>,
            /// The leader of each grain, and its correlation with it.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`merged`].
#[derive(Debug)]
pub struct GrainCluster;

impl Func for GrainCluster {
    type Params = GrainClusterParams;
    type Ports = GrainClusterPorts;
    const NAME: &'static str = "GrainCluster";
    const VERSION: u32 = 2;
    // Sources are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn eval(p: &GrainClusterParams, cx: &Build<'_>, mut io: GrainClusterIo<'_>) -> Result<Summary, Fault> {
        let dictionary = io.dictionary;
        let none = CorrelationPatterns::none(dictionary);
        let patterns = io.patterns.unwrap_or(&none);
        check_patterns(patterns, dictionary)?;
        let pairs = similar_pairs(dictionary, p.neighbours, &|share| (cx.monitor)(share));
        let pairs = pairs.ok_or_else(Fault::stopped)?;
        let found = substitutes(&norms(dictionary), &pairs, patterns, p.merge);
        let reduced = merged(dictionary, patterns, &found, (p.margin * dictionary.rate).round() as usize);
        let mut summary = reduced.dictionary.summary();
        let share = reduced.dictionary.bytes() as f64 / dictionary.bytes().max(1) as f64;
        summary.push(("merged", (dictionary.len() - reduced.dictionary.len()).into()));
        summary.push(("share_of_dictionary", share.into()));
        io.table.set(cluster_table(dictionary, &found));
        io.reduced.set(reduced.dictionary);
        io.rewritten.set(reduced.patterns);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (GrainClusterParams, MemoryFiles) {
        let p = GrainClusterParams::trial(rng);
        (GrainClusterParams { neighbours: 1 + p.neighbours % 8, ..p }, MemoryFiles::default())
    }
}

/// A row for each grain.
fn cluster_table(dictionary: &GrainDictionary, substitutes: &[Substitute]) -> ResultTable {
    let mut table = ResultTable::new(&[
        "grain",
        "recording",
        "start_s",
        "seconds",
        "leader",
        "lag_samples",
        "correlation",
        "gain_db",
    ]);
    for (k, (grain, substitute)) in dictionary.grains.iter().zip(substitutes).enumerate() {
        let name = dictionary.source(grain).map_or("", |source| source.name.as_str());
        table.push([
            k.into(),
            name.into(),
            (grain.start as f64 / dictionary.rate).into(),
            (f64::from(grain.len) / dictionary.rate).into(),
            (substitute.grain as usize).into(),
            f64::from(substitute.lag).into(),
            f64::from(substitute.correlation).into(),
            (20.0 * f64::from(substitute.gain.abs()).log10()).into(),
        ]);
    }
    table
}
