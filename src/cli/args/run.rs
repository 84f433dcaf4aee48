//! Arguments of `foley run`: the engine and the cache.

use super::graph::GraphArgs;
use super::parse::{parse_pause, parse_seconds, parse_size, parse_threads};
use crate::memo::{Memo, default_dir};
use crate::session::Session;
use clap::Args as ClapArgs;
use foley_nodes::registry::Registry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Settings of a run or plan.
#[derive(Clone, Debug, ClapArgs)]
pub struct EngineArgs {
    /// Threads that compute [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Length of one window; it never changes the result
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 0.02, value_parser = parse_seconds)]
    pub window: f64,
    /// Stop here at the latest; needed for graphs without end
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub until: Option<f64>,
    /// Write an output to a file: .wav, .npy, .csv, .jsonl, .json or .svg
    #[arg(long = "tap", value_name = "NODE.PORT=FILE")]
    pub taps: Vec<String>,
}

impl EngineArgs {
    /// A session with these settings.
    #[must_use]
    pub fn apply(&self, session: Session) -> Session {
        session
            .with_threads(self.threads)
            .with_window(self.window)
            .with_until(self.until)
            .with_taps(self.taps.iter().cloned())
    }
}

/// Arguments of `foley run`.
#[derive(Clone, Debug, ClapArgs)]
pub struct RunArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// The engine.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// The cache.
    #[command(flatten)]
    pub memo: MemoArgs,
    /// Folder for the files that the graph writes
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Write the report of the run as JSON
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Write a checkpoint at this interval, from which the same command resumes; 0 writes none
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 60.0, value_parser = parse_pause)]
    pub checkpoint: f64,
    /// Print where each file and tap loses its sound: levels from the sources on, and the first node whose output is silent although
    /// its inputs are not; writes no checkpoints
    #[arg(long)]
    pub trace_silence: bool,
    /// Print errors only
    #[arg(long, short)]
    pub quiet: bool,
}

impl RunArgs {
    /// A session with these settings, without a cache.
    #[must_use]
    pub fn session(&self, registry: &Arc<Registry>) -> Session {
        self.engine.apply(self.graph.session(registry)).with_quiet(self.quiet).with_trace(self.trace_silence)
    }
}

/// The cache of a run.
#[derive(Clone, Debug, ClapArgs)]
pub struct MemoArgs {
    /// Keep results in this folder [default: .foley/cache beside the graph]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Keep no results, and use none of earlier runs
    #[arg(long, conflicts_with = "cache")]
    pub no_cache: bool,
    /// Maximum size of the cache
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true, value_parser = parse_size, default_value = "1G")]
    pub cache_size: usize,
}

impl MemoArgs {
    /// The memo for a graph file, unless it is turned off.
    #[must_use]
    pub fn memo(&self, graph: &Path) -> Option<Memo> {
        let dir = || self.cache.clone().unwrap_or_else(|| default_dir(graph));
        (!self.no_cache).then(|| Memo::new(dir(), self.cache_size as u64, graph))
    }
}
