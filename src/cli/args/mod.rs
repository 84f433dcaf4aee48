//! Arguments of the command.

mod parse;
mod probe;
mod table;
mod test;

pub use probe::ProbeArgs;
pub use table::{Column, TableArgs};
pub use test::TestArgs;

use crate::graph::{Limits, LoadOptions, Override};
use crate::memo::{Memo, default_dir};
use crate::session::Session;
use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use foley_nodes::feature::UnitLength;
use foley_nodes::registry::Registry;
use parse::{parse_pause, parse_port, parse_quantum, parse_seconds, parse_set, parse_size, parse_threads};
use std::path::{Path, PathBuf};
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

fn load_options(
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

/// Arguments of `foley watch`.
#[derive(Clone, Debug, ClapArgs)]
pub struct WatchArgs {
    /// The run.
    #[command(flatten)]
    pub run: RunArgs,
    /// Look at the files this often, instead of waiting for events; for file systems that have none
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub poll: Option<f64>,
    /// Play the graph and go over to each save of it while it plays, instead of running it
    #[arg(long)]
    pub live: bool,
    /// The device; needs --live
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// The device, and the inputs.
#[derive(Clone, Debug, ClapArgs)]
pub struct DeviceArgs {
    /// `null` (a clock without sound), `file:PATH`, or the name of a sound card (in builds with the feature `live`)
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Refuse to play at another rate than this
    #[arg(long, value_name = "HZ")]
    pub rate: Option<u32>,
    /// Frames per window
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 128, value_parser = parse_quantum)]
    pub quantum: usize,
    /// Lead of nodes outside of the audio callback
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 0.08, value_parser = parse_seconds)]
    pub lead: f64,
    /// Listen for OSC at this port of this machine, or at ADDRESS:PORT; `off` for not at all
    #[arg(long, value_name = "PORT", default_value = "9000", value_parser = parse_port)]
    pub osc: String,
    /// Take frames of meshes over TCP at this port of this machine, or at ADDRESS:PORT; `off` for not at all
    #[arg(long, value_name = "PORT", default_value = "off", value_parser = parse_port)]
    pub meshes: String,
    /// Stop after this long
    #[arg(long = "for", value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub duration: Option<f64>,
}

/// Arguments of `foley live`.
#[derive(Clone, Debug, ClapArgs)]
pub struct LiveArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// The device.
    #[command(flatten)]
    pub device: DeviceArgs,
    /// The cache.
    #[command(flatten)]
    pub memo: MemoArgs,
    /// Write times and counts as JSON at the end
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Print the state as a line of JSON each second
    #[arg(long)]
    pub json: bool,
    /// Print errors only
    #[arg(long, short)]
    pub quiet: bool,
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

/// Arguments of `foley new`.
#[derive(Clone, Debug, ClapArgs)]
pub struct NewArgs {
    /// The folder to make; its name becomes that of the graph
    pub dir: PathBuf,
    /// Subject of the project [default: that of the given files, or wind]
    #[arg(long, value_name = "NAME")]
    pub template: Option<Template>,
    /// Files of the user.
    #[command(flatten)]
    pub own: OwnFiles,
}

/// Files of the user that a new project is made of.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct OwnFiles {
    /// Copy this animation into the project, as the cloth; or this shape, as the object of a material
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Copy these recordings into the project: of the cloth, knocks on a material, grains, or recordings to resynthesise
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub recordings: Vec<PathBuf>,
    /// Copy this image into the project, as the surface
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    /// Copy this log of contacts into the project
    #[arg(long, value_name = "FILE")]
    pub contacts: Option<PathBuf>,
}

/// Project that `foley new` makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Template {
    /// Filtered noise
    Wind,
    /// Friction and crumples of a cloth
    Cloth,
    /// A surface from an image, under a ball or under the contacts of a log
    Texture,
    /// A bar that is struck
    Impact,
    /// A bar to strike while it plays
    Live,
    /// An object of a material that is fitted to recorded knocks
    Material,
    /// Recordings cut into grains, played by triggers or by the contacts of a log
    Grains,
    /// A resynthesised recording
    Numbers,
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
