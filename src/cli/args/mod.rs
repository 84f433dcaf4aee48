//! Arguments of the command.

mod cache;
mod graph;
mod live;
mod new;
mod parse;
mod probe;
mod run;
mod table;
mod test;

pub use cache::{CacheArgs, CacheCommand, CacheDirArgs, GcArgs, StatArgs, WhyArgs};
pub use graph::{GraphArgs, GraphsArgs, LimitArgs};
pub use live::{DeviceArgs, LiveArgs, WatchArgs};
pub use new::{NewArgs, OwnFiles, Template};
pub use probe::ProbeArgs;
pub use run::{EngineArgs, MemoArgs, RunArgs};
pub use table::{Column, TableArgs};
pub use test::TestArgs;

use crate::graph::LoadOptions;
use clap::{Args as ClapArgs, Parser, Subcommand};
use clap_complete::Shell;
use foley_nodes::feature::UnitLength;
use foley_nodes::registry::Registry;
use graph::load_options;
use std::path::PathBuf;
use std::sync::Arc;

/// Turns motion and recordings into sound, by graphs of nodes.
#[derive(Debug, Parser)]
#[command(name = "foley", version, max_term_width = 100)]
pub struct Args {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The command.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a graph to its end and write its files
    #[command(
        after_help = "Examples:\n  foley run graphs/cloth/sheet.ron\n  foley run piece.ron --set cloth.path=cape.abc --tap mix.audio=mix.svg"
    )]
    Run(RunArgs),
    /// Measure one output of a graph: run only the nodes that it needs, write no file, and print its figures
    #[command(
        after_help = "Examples:\n  foley probe piece.ron mix\n  foley probe piece.ron contacts.impacts --first 20\n  foley probe piece.ron wind --from 1 --to 2 --svg wind.svg"
    )]
    Probe(ProbeArgs),
    /// Run the checks that are written beside graphs: those of piece.ron are in piece.test.ron
    #[command(
        after_help = "Examples:\n  foley test piece.ron\n  foley test graphs --filter Peak\n  foley test piece.ron --write"
    )]
    Test(TestArgs),
    /// Run a graph again after each save of it or of a file that it reads, or keep it playing with --live
    #[command(after_help = "Examples:\n  foley watch piece.ron\n  foley watch piece.ron --live")]
    Watch(WatchArgs),
    /// Play a graph, and take OSC and JSON lines while it plays
    #[command(
        after_help = "Examples:\n  foley live graphs/texture/live.ron --device null --for 5\n  foley live piece.ron --osc 9001 --json"
    )]
    Live(LiveArgs),
    /// Find everything that is wrong with graphs, without running them
    #[command(after_help = "Examples:\n  foley check piece.ron\n  foley check graphs/cloth/*.ron --json")]
    Check(CheckArgs),
    /// Lay out graph files; comments and grouping stay
    #[command(after_help = "Examples:\n  foley fmt piece.ron\n  foley fmt --check graphs/cloth/*.ron")]
    Fmt(FmtArgs),
    /// Change graph files of older versions to the present node types and fields; comments stay
    #[command(after_help = "Examples:\n  foley upgrade piece.ron\n  foley upgrade --check graphs/*.ron")]
    Upgrade(UpgradeArgs),
    /// Show rates, delays, buffers, memory and latency before running
    #[command(after_help = "Examples:\n  foley plan piece.ron\n  foley plan graphs/cloth/live.ron --long")]
    Plan(PlanArgs),
    /// List node types, or describe one
    #[command(after_help = "Examples:\n  foley nodes modal\n  foley nodes ModalBank")]
    Nodes(NodesArgs),
    /// Explain the code of an error
    #[command(after_help = "Examples:\n  foley explain F025\n  foley explain f048")]
    Explain(ExplainArgs),
    /// List the nodes of a graph with their inputs and outputs, or draw it
    #[command(after_help = "Examples:\n  foley graph piece.ron\n  foley graph piece.ron --svg piece.svg")]
    Graph(DrawArgs),
    /// Tabulate parameters of nodes over several graphs, and figures of their runs
    #[command(
        after_help = "Examples:\n  foley table graphs/cloth/*.ron --column contacts.radius --column speed.threshold\n  foley table a.ron b.ron --run -c contacts.time -c fit.nodes --csv"
    )]
    Table(TableArgs),
    /// Measure audio files: level, loudness, and where their energy lies
    #[command(after_help = "Examples:\n  foley levels out/sheet.wav\n  foley levels out/*.wav --json")]
    Levels(LevelsArgs),
    /// Compare a sound with the recordings that it was made of: repeats, lines of the envelope, and statistics
    #[command(
        after_help = "Examples:\n  foley likeness out/sheet.wav takes/*.wav\n  foley likeness out/sheet.wav takes/*.wav --unit 1/240 --svg likeness.svg"
    )]
    Likeness(LikenessArgs),
    /// Inspect, empty or explain the cached results of earlier runs
    #[command(
        after_help = "Examples:\n  foley cache stat piece.ron\n  foley cache why piece.ron cotton.friction"
    )]
    Cache(CacheArgs),
    /// Make a small project that runs
    #[command(
        after_help = "Examples:\n  foley new wind\n  foley new cape --mesh cape.abc --recordings takes/*.wav"
    )]
    New(NewArgs),
    /// Print the format of graphs, with all node types, as a JSON schema
    Schema,
    /// Print a page of the book; write or check the pages that come from the code
    #[command(after_help = "Examples:\n  foley docs\n  foley docs cloth")]
    Docs(DocsArgs),
    /// Print completions for a shell
    #[command(
        after_help = "Examples:\n  foley completions bash > ~/.local/share/bash-completion/completions/foley\n  foley completions zsh > _foley"
    )]
    Completions(CompletionsArgs),
    /// Serve an editor over standard input and output: findings, completion, hover, renames
    Lsp(LspArgs),
}

/// Arguments of `foley check`.
#[derive(Clone, Debug, ClapArgs)]
pub struct CheckArgs {
    /// The graphs.
    #[command(flatten)]
    pub graphs: GraphsArgs,
    /// Print an array of findings as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `foley fmt`.
#[derive(Clone, Debug, ClapArgs)]
pub struct FmtArgs {
    /// The graph files
    #[arg(required = true)]
    pub graphs: Vec<PathBuf>,
    /// Change nothing; fail where something would change
    #[arg(long)]
    pub check: bool,
}

/// Arguments of `foley upgrade`.
#[derive(Clone, Debug, ClapArgs)]
pub struct UpgradeArgs {
    /// The graph files
    #[arg(required = true)]
    pub graphs: Vec<PathBuf>,
    /// Change nothing; fail where something would change
    #[arg(long)]
    pub check: bool,
}

/// Arguments of `foley plan`.
#[derive(Clone, Debug, ClapArgs)]
pub struct PlanArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// The engine.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// List every node, also of a large graph
    #[arg(long)]
    pub long: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `foley nodes`.
#[derive(Clone, Debug, ClapArgs)]
pub struct NodesArgs {
    /// A node type, or a word: types whose name, family or summary has it are listed; without it, all
    pub name: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `foley explain`.
#[derive(Clone, Debug, ClapArgs)]
pub struct ExplainArgs {
    /// The code, such as F025
    pub code: String,
}

/// Arguments of `foley graph`.
#[derive(Clone, Debug, ClapArgs)]
pub struct DrawArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Draw it as SVG into this file, `-` for standard output, instead of listing it as text
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
}

/// Arguments of `foley levels`.
#[derive(Clone, Debug, ClapArgs)]
pub struct LevelsArgs {
    /// The audio files
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `foley likeness`.
#[derive(Clone, Debug, ClapArgs)]
pub struct LikenessArgs {
    /// The sound
    pub sound: PathBuf,
    /// The recordings
    #[arg(required = true)]
    pub recordings: Vec<PathBuf>,
    /// Length of the units that the sound was made of, such as 1/240 (seconds) or "200 samples"
    #[arg(long, value_name = "LENGTH")]
    pub unit: Option<UnitLength>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Draw the spectrogram with its marks, and the statistics, into this file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
}

/// Arguments of `foley docs`.
#[derive(Clone, Debug, ClapArgs)]
pub struct DocsArgs {
    /// A page of the book to print, such as cloth or nodes/scrape; without it, all pages are listed
    #[arg(conflicts_with_all = ["write", "check"])]
    pub page: Option<String>,
    /// Write the pages that come from the code
    #[arg(long, conflicts_with = "check")]
    pub write: bool,
    /// Write nothing; fail where a page that comes from the code would change
    #[arg(long)]
    pub check: bool,
    /// Folder that holds the book in `docs` and example graphs in `graphs`
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub root: PathBuf,
}

/// Arguments of `foley completions`.
#[derive(Clone, Debug, ClapArgs)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// Arguments of `foley lsp`.
#[derive(Clone, Debug, ClapArgs)]
pub struct LspArgs {
    /// Let the graphs read below this folder too
    #[arg(long, value_name = "DIR")]
    pub allow_read: Vec<PathBuf>,
    #[command(flatten)]
    pub limits: LimitArgs,
    /// Standard input and output, which is the only transport: some editors name it
    #[arg(long, hide = true)]
    pub stdio: bool,
}

impl LspArgs {
    /// The settings with which graphs are loaded.
    #[must_use]
    pub fn options(&self, registry: &Arc<Registry>) -> LoadOptions {
        load_options(registry, &[], &self.allow_read, &self.limits)
    }
}
