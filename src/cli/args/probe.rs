//! Arguments of `foley probe`.

use super::graph::GraphArgs;
use super::parse::{parse_seconds, parse_threads, parse_time};
use super::run::MemoArgs;
use crate::session::Session;
use clap::Args as ClapArgs;
use foley_nodes::registry::Registry;
use std::path::PathBuf;
use std::sync::Arc;

/// Arguments of `foley probe`.
#[derive(Clone, Debug, ClapArgs)]
pub struct ProbeArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// The output; the port may be left out where the node has one
    #[arg(value_name = "NODE[.PORT]")]
    pub output: String,
    /// Threads that compute [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Stop here at the latest; needed for outputs without end
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub until: Option<f64>,
    /// The cache.
    #[command(flatten)]
    pub memo: MemoArgs,
    /// Measure from this time on
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 0.0, value_parser = parse_time)]
    pub from: f64,
    /// Measure up to this time [default: the end]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_time)]
    pub to: Option<f64>,
    /// Number of items that are shown, and of the items of each list
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub first: usize,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Draw it into this file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Print errors and the figures only
    #[arg(long, short)]
    pub quiet: bool,
}

impl ProbeArgs {
    /// A session with these settings, without the cache.
    #[must_use]
    pub fn session(&self, registry: &Arc<Registry>) -> Session {
        let session = self.graph.session(registry).with_quiet(self.quiet || self.json);
        session.with_threads(self.threads).with_until(self.until)
    }
}
