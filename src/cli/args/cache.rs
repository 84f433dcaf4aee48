//! Arguments of `foley cache`.

use super::graph::GraphArgs;
use super::parse::parse_size;
use super::run::EngineArgs;
use clap::{Args as ClapArgs, Subcommand};
use std::path::PathBuf;

/// Arguments of `foley cache`.
#[derive(Clone, Debug, ClapArgs)]
pub struct CacheArgs {
    /// The command.
    #[command(subcommand)]
    pub command: CacheCommand,
}

/// A command about cached results.
#[derive(Clone, Debug, Subcommand)]
pub enum CacheCommand {
    /// Count entries and bytes, by node type
    Stat(StatArgs),
    /// Remove the least valuable entries until the rest fits the size
    Gc(GcArgs),
    /// List the dependencies of a result that have changed since the last run
    Why(WhyArgs),
}

/// The cache.
#[derive(Clone, Debug, ClapArgs)]
pub struct CacheDirArgs {
    /// The graph file beside the cache [default: the working folder]
    pub graph: Option<PathBuf>,
    /// The folder of the cache
    #[arg(long, value_name = "DIR", conflicts_with = "graph")]
    pub cache: Option<PathBuf>,
}

/// Arguments of `foley cache stat`.
#[derive(Clone, Debug, ClapArgs)]
pub struct StatArgs {
    /// The cache.
    #[command(flatten)]
    pub dir: CacheDirArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `foley cache gc`.
#[derive(Clone, Debug, ClapArgs)]
pub struct GcArgs {
    /// The cache.
    #[command(flatten)]
    pub dir: CacheDirArgs,
    /// Maximum size of the remaining results
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true, value_parser = parse_size, default_value = "1G")]
    pub cache_size: usize,
    /// Remove everything
    #[arg(long)]
    pub all: bool,
}

/// Arguments of `foley cache why`.
#[derive(Clone, Debug, ClapArgs)]
pub struct WhyArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// The node that gives the result
    pub node: String,
    /// The engine.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// The folder of the cache [default: .foley/cache beside the graph]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
}
