//! Arguments of `foley test`.

use super::graph::{LimitArgs, load_options};
use super::parse::parse_threads;
use crate::graph::LoadOptions;
use clap::Args as ClapArgs;
use foley_nodes::registry::Registry;
use std::path::PathBuf;
use std::sync::Arc;

/// Arguments of `foley test`.
#[derive(Clone, Debug, ClapArgs)]
pub struct TestArgs {
    /// Graphs with a test file beside them, test files, or folders, below which all test files are run
    #[arg(required = true, value_name = "GRAPH")]
    pub graphs: Vec<PathBuf>,
    /// Run only checks with this in their names, as --list prints them
    #[arg(long, value_name = "WORD")]
    pub filter: Option<String>,
    /// List the checks, and run nothing
    #[arg(long, conflicts_with = "write")]
    pub list: bool,
    /// Store the results that the checks `Stored` compare with; nothing else writes a file
    #[arg(long)]
    pub write: bool,
    /// Let the graphs read below this folder too
    #[arg(long, value_name = "DIR")]
    pub allow_read: Vec<PathBuf>,
    /// Threads that compute [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_threads)]
    pub threads: Option<usize>,
    #[command(flatten)]
    pub limits: LimitArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Print only the failed checks and the summary
    #[arg(long, short)]
    pub quiet: bool,
}

impl TestArgs {
    /// Options with which the graphs are loaded.
    #[must_use]
    pub fn load_options(&self, registry: &Arc<Registry>) -> LoadOptions {
        load_options(registry, &[], &self.allow_read, &self.limits)
    }
}
