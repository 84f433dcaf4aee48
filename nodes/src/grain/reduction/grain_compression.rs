//! The node `GrainCompression`.

use super::compression::{CompressionRules, compression_table};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::GrainRecordings;
use crate::grain::synthesis::check_patterns;
use crate::table::ResultTable;
use crate::{params, ports};

params! {
    /// Compares the bytes of recordings that are stored as grains with the errors of their sound.
    ///
    /// The rows are all grains, grains of fewer bits, grains merged above several correlations as by `GrainCluster`, and grains under several
    /// budgets as by `GrainSubset`, with the mean of random grains under the same budgets. Bytes are those of the files of grains and of
    /// patterns, which have the grains of the walk only. Errors are the segmental signal-to-noise ratio, of frames of 20 ms between -10 and
    /// 35 dB, and the log-spectral distance.
    ///
    /// # Randomness
    /// The random grains.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 5.1.
    pub struct GrainCompressionParams {
        /// Numbers of bits of the samples.
        bits: Vec<u32> = vec![12, 10, 8, 7, 6, 5, 4], unit "bits", range 4..=16_u32;
        /// Minimum correlations of grains that are merged.
        merge: Vec<f64> = vec![0.999, 0.99, 0.98, 0.95, 0.9, 0.85, 0.8], unit "", range 0.3..=1.0;
        /// Budgets, as shares of the bytes of the grains.
        shares: Vec<f64> = vec![0.75, 0.5, 0.25], unit "", range 0.0..=1.0;
        /// Bytes of the files of `coded`.
        coded_bytes: u64 = 0, unit "bytes", range 0..=u64::MAX;
        /// Number of random subsets for each budget.
        random_sets: usize = 20, unit "", range 0..=1000;
        /// Number of grains of similar spectrum that each grain is compared with.
        neighbours: usize = 32, unit "", range 1..=10_000;
        /// Sound stored beyond the ends of grains without neighbours, for joins.
        margin: f64 = 0.005, unit "s", range 0.0..=0.1;
    }
}
ports! {
    pub struct GrainCompressionPorts / GrainCompressionIo {
        in {
            /// The recordings.
            recordings: Value<GrainRecordings>,
            /// Their grains.
            dictionary: Value<GrainDictionary>,
            /// Their patterns.
            patterns: Value<CorrelationPatterns>,
            /// The same recordings after another coder, such as Ogg Vorbis, in the same order.
            coded: Option<Value<GrainRecordings>>,
        }
        out {
            /// Bytes and errors.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`compression_table`].
#[derive(Debug)]
pub struct GrainCompression;

impl Func for GrainCompression {
    type Params = GrainCompressionParams;
    type Ports = GrainCompressionPorts;
    const NAME: &'static str = "GrainCompression";
    const VERSION: u32 = 3;

    fn eval(
        p: &GrainCompressionParams,
        cx: &Build<'_>,
        mut io: GrainCompressionIo<'_>,
    ) -> Result<Summary, Fault> {
        let (recordings, dictionary, patterns) = (io.recordings, io.dictionary, io.patterns);
        check_patterns(patterns, dictionary)?;
        if let Some(coded) = io.coded
            && ((coded.rate - recordings.rate).abs() > 1e-9
                || coded.recordings.len() != recordings.recordings.len())
        {
            let message = format!(
                "`coded` has {} recordings of {} Hz, `recordings` {} of {} Hz",
                coded.recordings.len(),
                coded.rate,
                recordings.recordings.len(),
                recordings.rate
            );
            return Err(Fault::new("F151", message)
                .at("coded")
                .help("both need the same files, in the same order"));
        }
        let rules = CompressionRules {
            bits: p.bits.clone(),
            merge: p.merge.clone(),
            shares: p.shares.clone(),
            random_sets: p.random_sets,
            neighbours: p.neighbours,
            margin: (p.margin * dictionary.rate).round() as usize,
        };
        let monitor = |share| (cx.monitor)(share);
        let coded = io.coded.map(|coded| (coded, p.coded_bytes));
        let stored = (dictionary, patterns);
        let table = compression_table(recordings, coded, stored, &rules, cx.random, &monitor);
        let table = table.ok_or_else(Fault::stopped)?;
        let summary = vec![("rows", table.rows.len().into())];
        io.table.set(table);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (GrainCompressionParams, MemoryFiles) {
        let p = GrainCompressionParams::trial(rng);
        let params = GrainCompressionParams {
            bits: vec![4 + rng.below(13) as u32],
            merge: vec![rng.between(0.3, 1.0)],
            shares: vec![rng.between(0.3, 1.0)],
            random_sets: 2,
            neighbours: 1 + p.neighbours % 8,
            ..p
        };
        (params, MemoryFiles::default())
    }
}
