//! Graphs with their settings and limits.

use super::parse::{parse_set, parse_size};
use crate::graph::{Limits, LoadOptions, Override};
use crate::session::Session;
use clap::Args as ClapArgs;
use foley_nodes::registry::Registry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The graph and its settings.
#[derive(Clone, Debug, ClapArgs)]
pub struct GraphArgs {
    /// The graph file
    pub graph: PathBuf,
    /// Set a parameter of the graph (NAME=VALUE) or of a node (NODE.PARAM=VALUE); VALUE is a RON value, or text
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = parse_set)]
    pub sets: Vec<Override>,
    /// Let the graph read below this folder too
    #[arg(long, value_name = "DIR")]
    pub allow_read: Vec<PathBuf>,
    /// Seed of all randomness, instead of the graph's own
    #[arg(long)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub limits: LimitArgs,
}

pub(super) fn load_options(
    registry: &Arc<Registry>,
    sets: &[Override],
    allow_read: &[PathBuf],
    limits: &LimitArgs,
) -> LoadOptions {
    let options = LoadOptions::default().registry(Arc::clone(registry)).limits(limits.limits());
    let options = options.overrides(sets.iter().cloned());
    allow_read.iter().fold(options, LoadOptions::allow_read)
}

impl GraphArgs {
    /// A session over the graph.
    #[must_use]
    pub fn session(&self, registry: &Arc<Registry>) -> Session {
        let options = load_options(registry, &self.sets, &self.allow_read, &self.limits);
        Session::from_file(&self.graph).with_load_options(options).with_seed(self.seed)
    }
}

/// Limits of a graph and its files.
#[derive(Clone, Debug, ClapArgs)]
pub struct LimitArgs {
    /// Maximum memory for buffers, and for a file that is read as a whole, such as 512M
    #[arg(long, hide_short_help = true, help_heading = "Limits", value_name = "SIZE", allow_negative_numbers = true, default_value = "4G", value_parser = parse_size)]
    pub memory: usize,
    /// Maximum size of one input file
    #[arg(long, hide_short_help = true, help_heading = "Limits", value_name = "SIZE", allow_negative_numbers = true, value_parser = parse_size, default_value = "64G")]
    pub max_file: usize,
    /// Maximum number of nodes
    #[arg(
        long,
        hide_short_help = true,
        help_heading = "Limits",
        value_name = "COUNT",
        default_value_t = 20_000
    )]
    pub max_nodes: usize,
    /// Maximum number of links
    #[arg(
        long,
        hide_short_help = true,
        help_heading = "Limits",
        value_name = "COUNT",
        default_value_t = 200_000
    )]
    pub max_links: usize,
    /// Maximum depth of sub-graphs
    #[arg(long, hide_short_help = true, help_heading = "Limits", value_name = "COUNT", default_value_t = 16, value_parser = clap::value_parser!(u8).range(1..=64))]
    pub max_depth: u8,
}

impl LimitArgs {
    /// The limits that the arguments set.
    #[must_use]
    pub fn limits(&self) -> Limits {
        Limits {
            file_bytes: self.max_file as u64,
            memory: self.memory,
            nodes: self.max_nodes,
            links: self.max_links,
            depth: usize::from(self.max_depth),
            ..Limits::default()
        }
    }
}

/// Several graphs with the same settings.
#[derive(Clone, Debug, ClapArgs)]
pub struct GraphsArgs {
    /// The graph files
    #[arg(required = true)]
    pub graphs: Vec<PathBuf>,
    /// Set a parameter of the graph (NAME=VALUE) or of a node (NODE.PARAM=VALUE)
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = parse_set)]
    pub sets: Vec<Override>,
    /// Let the graphs read below this folder too
    #[arg(long, value_name = "DIR")]
    pub allow_read: Vec<PathBuf>,
    #[command(flatten)]
    pub limits: LimitArgs,
}

impl GraphsArgs {
    /// A session over one of the graphs.
    #[must_use]
    pub fn session(&self, graph: &Path, registry: &Arc<Registry>) -> Session {
        Session::from_file(graph).with_load_options(load_options(
            registry,
            &self.sets,
            &self.allow_read,
            &self.limits,
        ))
    }
}
