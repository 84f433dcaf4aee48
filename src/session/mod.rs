//! A graph with its settings for loading, planning and running: the interface of programs and of the command line.
//!
//! [`Session`] holds the settings; [`Session::prepare`] makes a [`Prepared`] graph of them, which renders as often as wanted.

mod errors;
mod inspection;
mod prepared;

pub use errors::Errors;
pub use inspection::Inspection;
pub use prepared::{Preparation, Prepared};

use crate::diag::{Severity, any_error, sort};
use crate::graph::{DirFiles, LoadOptions, Loaded, Override, Texts, load, load_text};
use crate::live::{Callback, LiveGraph, Options, Player};
use crate::memo::Memo;
use crate::plan::{Plan, PlanOptions, sound_shapes};
use crate::run::{MemoryTap, Progress, Report, Trace, check_memory_tap, check_tap};
use foley_nodes::core::files::MemoryOutputs;
use foley_nodes::core::input::Inputs;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::{Tick, seconds, ticks};
use foley_nodes::registry::Registry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Runs a graph file with its own settings, and writes its outputs into a folder; [`Session`] has all settings.
///
/// # Errors
/// All errors of the graph, or the faults of the nodes that failed; no output is left in the folder then.
///
/// # Example
///
/// ```
/// let folder = std::env::temp_dir().join("foley-run-file-example");
/// let report = foley::run_file("graphs/impact/strikes.ron", &folder)?;
/// assert!(report.outputs[0].path.ends_with("strikes.wav") && report.length > 1.0);
/// # std::fs::remove_dir_all(&folder).unwrap();
/// # Ok::<(), foley::Errors>(())
/// ```
pub fn run_file(graph: impl Into<PathBuf>, out: impl AsRef<Path>) -> Result<Report, Errors> {
    Session::from_file(graph).render(out.as_ref())
}

/// Source of the text of a graph.
#[derive(Clone, Debug)]
enum Source {
    File(PathBuf),
    /// A text, and the path that its own paths are relative to.
    Text(String, PathBuf),
}

/// A graph and the settings that it is run with.
///
/// Nothing is read before [`Session::load`], [`Session::prepare`] or [`Session::render`]; each of them reads the files
/// again, so a session follows edits.
///
/// # Example
///
/// ```
/// use foley::Session;
///
/// let text = r#"#![schema = "foley:graph/1"]
/// Graph(params: { "gain": 0.5 }, nodes: {
///     "wind": Noise(duration: Some(0.1)),
///     "soft": Gain(audio: "wind", gain: "$gain"),
///     "out": WavOut(audio: "soft", path: "wind.wav"),
/// })"#;
/// let mut session = Session::from_text(text, ".");
/// session.set("gain", "0.25");
/// let folder = std::env::temp_dir().join("foley-session-example");
/// let report = session.render(&folder)?;
/// assert_eq!(report.outputs[0].facts["frames"], 4800);
/// # std::fs::remove_dir_all(&folder).unwrap();
/// # Ok::<(), foley::Errors>(())
/// ```
#[derive(Clone)]
pub struct Session {
    source: Source,
    options: LoadOptions,
    seed: Option<u64>,
    threads: Option<usize>,
    window: Tick,
    until: Option<Tick>,
    taps: Vec<String>,
    memory_taps: Vec<(String, Arc<dyn MemoryTap>)>,
    /// Ids of the nodes that write and that the run computes besides the taps; `None` for the whole graph.
    only: Option<Vec<String>>,
    /// True to trace where the sound is lost.
    trace: bool,
    quiet: bool,
    memo: Option<Arc<Memo>>,
    progress: Arc<Progress>,
}

impl Session {
    fn new(source: Source) -> Self {
        Self {
            source,
            options: LoadOptions::default(),
            seed: None,
            threads: None,
            window: ticks(0.02),
            until: None,
            taps: Vec::new(),
            memory_taps: Vec::new(),
            only: None,
            trace: false,
            quiet: false,
            memo: None,
            progress: Arc::default(),
        }
    }

    /// A session over a graph file.
    #[must_use]
    pub fn from_file(path: impl Into<PathBuf>) -> Self {
        Self::new(Source::File(path.into()))
    }

    /// A session over a text; paths in it are relative to `folder`.
    #[must_use]
    pub fn from_text(text: impl Into<String>, folder: impl AsRef<Path>) -> Self {
        Self::new(Source::Text(text.into(), folder.as_ref().join("graph.ron")))
    }

    /// Sets the node types that the graph can use.
    #[must_use]
    pub fn with_registry(mut self, registry: Arc<Registry>) -> Self {
        self.options.registry = registry;
        self
    }

    /// Sets the load settings of the graph.
    #[must_use]
    pub fn with_load_options(mut self, options: LoadOptions) -> Self {
        self.options = options;
        self
    }

    /// Takes the texts of the graph from an earlier load with the same `texts`, and leaves those that it reads itself there.
    #[must_use]
    pub fn with_texts(mut self, texts: Option<Arc<Texts>>) -> Self {
        self.options.texts = texts;
        self
    }

    /// Sets the seed of all randomness, in place of the graph's own.
    #[must_use]
    pub fn with_seed(mut self, seed: Option<u64>) -> Self {
        self.seed = seed;
        self
    }

    /// Sets the number of threads that compute; all cores by default.
    #[must_use]
    pub fn with_threads(mut self, threads: Option<usize>) -> Self {
        self.threads = threads;
        self
    }

    /// Sets the length of one window in seconds, which never changes the result; 0.02 by default.
    #[must_use]
    pub fn with_window(mut self, seconds: f64) -> Self {
        self.window = ticks(seconds);
        self
    }

    /// Ends the run at a time in seconds at the latest.
    #[must_use]
    pub fn with_until(mut self, seconds: Option<f64>) -> Self {
        self.until = seconds.map(ticks);
        self
    }

    /// Writes outputs to files, each named as `NODE.PORT=FILE`.
    #[must_use]
    pub fn with_taps(mut self, taps: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.taps.extend(taps.into_iter().map(Into::into));
        self
    }

    /// Collects an output, `NODE.PORT` or `NODE` with one output, in memory: see [`StreamTap`](crate::run::StreamTap),
    /// [`EventTap`](crate::run::EventTap) and [`ValueTap`](crate::run::ValueTap). An output of another type is an error of
    /// [`Session::prepare`].
    pub fn tap(&mut self, output: impl Into<String>, tap: &Arc<impl MemoryTap + 'static>) {
        self.memory_taps.push((output.into(), Arc::clone(tap) as _));
    }

    /// Runs only the nodes that the taps and the nodes `ends` need: other files of the graph are not written.
    #[must_use]
    pub fn with_only(mut self, ends: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.only = Some(ends.into_iter().map(Into::into).collect());
        self
    }

    /// Traces where the sound is lost: see [`Report::trace`].
    #[must_use]
    pub fn with_trace(mut self, trace: bool) -> Self {
        self.trace = trace;
        self
    }

    /// Omits warnings.
    #[must_use]
    pub fn with_quiet(mut self, quiet: bool) -> Self {
        self.quiet = quiet;
        self
    }

    /// Caches results of nodes from run to run.
    #[must_use]
    pub fn with_memo(mut self, memo: Option<Arc<Memo>>) -> Self {
        self.memo = memo;
        self
    }

    /// Sets a parameter of the graph (`NAME`) or of a node (`NODE.PARAM`) to a RON value, or to text.
    ///
    /// An earlier value of the same target is replaced.
    pub fn set(&mut self, target: impl Into<String>, value: impl Into<String>) {
        let new = Override { target: target.into(), value: value.into() };
        self.options.overrides.retain(|given| given.target != new.target);
        self.options.overrides.push(new);
    }

    /// Sets a parameter as [`Session::set`] does, to a value of a message that anybody may have sent: a path in it is relative to
    /// the graph, and has to lie below the graph's own folder. It wins over a value of [`Session::set`].
    pub fn set_from_message(&mut self, target: impl Into<String>, value: impl Into<String>) {
        let new = Override { target: target.into(), value: value.into() };
        self.options.messages.retain(|given| given.target != new.target);
        self.options.messages.push(new);
    }

    /// Removes the value that was set for a target.
    pub fn unset(&mut self, target: &str) {
        self.options.overrides.retain(|given| given.target != target);
        self.options.messages.retain(|given| given.target != target);
    }

    /// The values that are set.
    #[must_use]
    pub fn overrides(&self) -> &[Override] {
        &self.options.overrides
    }

    /// The progress of its runs, readable from other threads; setting [`Progress::stop`] cancels them.
    #[must_use]
    pub fn progress(&self) -> &Arc<Progress> {
        &self.progress
    }

    /// Reads and checks the graph. The nodes of a graph that cannot run are shaped as well, so that all errors of
    /// them is found in one pass.
    #[must_use]
    pub fn load(&self) -> (Loaded, DirFiles) {
        let (loaded, files, _) = self.load_shaped();
        (loaded, files)
    }

    /// As [`Session::load`], with the shapes of the sound part of a graph that cannot run.
    fn load_shaped(&self) -> (Loaded, DirFiles, Vec<NodeShape>) {
        let mut loaded = match &self.source {
            Source::File(path) => load(path, &self.options),
            Source::Text(text, path) => load_text("graph", text, path, &self.options),
        };
        let files = DirFiles::new(std::mem::take(&mut loaded.root), self.options.limits);
        let mut known = Vec::new();
        if let Some(sound) = &loaded.sound {
            let options = PlanOptions { until: self.until, ..PlanOptions::default() };
            let (shapes, errors) = sound_shapes(sound, &files, &options);
            known = shapes;
            loaded.diagnostics.extend(errors);
            sort(&mut loaded.diagnostics, &loaded.sources);
        }
        loaded.diagnostics.retain(|d| !self.quiet || d.severity == Severity::Error);
        (loaded, files, known)
    }

    /// Reads, checks and plans the graph.
    #[must_use]
    pub fn prepare(&self) -> Preparation {
        let (loaded, files) = self.load();
        let mut diagnostics = loaded.diagnostics;
        // Of a part, nodes that nothing uses are left out anyway.
        diagnostics.retain(|d| self.only.is_none() || d.code != "F026");
        let mut prepared = None;
        let mut asked = files.asked();
        if let Some(mut graph) = loaded.graph {
            let (mut taps, mut errors) = (Vec::new(), Vec::new());
            let to_files = self.taps.iter().map(|text| check_tap(&graph, text));
            let memory = self.memory_taps.iter().map(|(output, tap)| check_memory_tap(&graph, output, tap));
            for tap in to_files.chain(memory) {
                match tap {
                    Ok(tap) => taps.push(tap),
                    Err(e) => errors.push(e),
                }
            }
            if let Some(ends) = &self.only {
                let ends = ends.iter().filter_map(|id| graph.find(id)).chain(taps.iter().map(|tap| tap.node));
                let (part, places) = graph.part(&ends.collect::<Vec<_>>());
                graph = part;
                taps.iter_mut().for_each(|tap| tap.node = places[tap.node].unwrap_or(tap.node));
            }
            let trace = self.trace.then(|| Trace::new(&graph, &taps));
            let cores = || std::thread::available_parallelism().map_or(1, usize::from);
            let threads = self.threads.unwrap_or_else(cores);
            let options = PlanOptions {
                window: self.window,
                threads,
                until: self.until,
                memory: files.limits().memory,
                taps: taps.iter().map(|tap| (tap.node, tap.port)).collect(),
                observed: trace.iter().flat_map(Trace::outputs).collect(),
                ..PlanOptions::default()
            };
            taps.extend(trace.iter().flat_map(Trace::taps));
            let plan = Plan::new(&graph, &files, &options);
            // The plan opens files as well, those that are missing among them.
            asked = files.asked();
            match plan {
                Ok(plan) if errors.is_empty() => {
                    let seed = self.seed.unwrap_or(graph.seed);
                    let (memo, progress) = (self.memo.clone(), Arc::clone(&self.progress));
                    prepared =
                        Some(Prepared { graph, files, plan, taps, trace, threads, seed, memo, progress });
                }
                Ok(_) => {}
                Err(e) => errors.extend(e),
            }
            if !errors.is_empty() {
                diagnostics.extend(errors);
                sort(&mut diagnostics, &loaded.sources);
            }
        }
        Preparation { prepared, diagnostics, sources: loaded.sources, asked }
    }

    /// All errors and warnings of the graph, and the notes of its nodes about their files, found without running it.
    ///
    /// A graph without an end is not wrong: it may be meant to be played.
    #[must_use]
    pub fn check(&self) -> Errors {
        self.inspect().errors
    }

    /// Results of [`Session::check`], with the graph itself or its valid part, and the shapes of its nodes: for editors.
    #[must_use]
    pub fn inspect(&self) -> Inspection {
        let (loaded, files, mut shapes) = self.load_shaped();
        let mut diagnostics = loaded.diagnostics;
        let (mut notes, mut latencies) = (Vec::new(), Vec::new());
        if let Some(graph) = &loaded.graph {
            // A graph without an end has the same notes up to any end.
            for until in [self.until, Some(ticks(1.0))] {
                let memory = self.options.limits.memory;
                match Plan::new(graph, &files, &PlanOptions { memory, until, ..PlanOptions::default() }) {
                    Ok(plan) => {
                        notes = plan.notes(graph);
                        latencies = (0..graph.nodes.len()).map(|n| plan.latency(n)).collect();
                        shapes = plan.shapes;
                    }
                    Err(found) if until.is_none() && found.iter().all(|d| d.code == "F048") => continue,
                    Err(found) => diagnostics.extend(found.into_iter().filter(|d| d.code != "F048")),
                }
                break;
            }
        }
        sort(&mut diagnostics, &loaded.sources);
        let graph = loaded.graph.or(loaded.sound).unwrap_or_default();
        let errors = Errors { diagnostics, notes, sources: loaded.sources };
        Inspection { errors, graph, shapes, latencies, asked: files.asked() }
    }

    /// Runs the graph to its end; its files appear below `folder`, all of them or none.
    ///
    /// # Errors
    /// All errors of the graph, or the faults of the nodes that failed.
    pub fn render(&self, folder: impl AsRef<Path>) -> Result<Report, Errors> {
        self.prepare().into_result()?.render(folder.as_ref())
    }

    /// Runs the graph to its end; its files stay in memory.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub fn render_to_memory(&self) -> Result<(Report, MemoryOutputs), Errors> {
        self.prepare().into_result()?.render_to_memory()
    }

    /// The graph as it can be played, or loaded into a [`Player`] that plays; `inputs` are the messages that arrive while it
    /// plays, [`NoInputs`](foley_nodes::core::input::NoInputs) if there are none.
    ///
    /// # Errors
    /// All that is wrong with the graph.
    pub fn live_graph(&self, inputs: Arc<dyn Inputs>) -> Result<LiveGraph, Errors> {
        let live = self.clone().with_until(Some(self.until.map_or(1.0, seconds)));
        let (Loaded { graph, diagnostics, sources, .. }, files) = live.load();
        let Some(graph) = graph else { return Err(Errors { diagnostics, notes: Vec::new(), sources }) };
        let seed = self.seed.unwrap_or(graph.seed);
        Ok(LiveGraph { graph, files, seed, memo: self.memo.clone(), inputs })
    }

    /// Starts to play the graph: the callback belongs to the host, which fills its buffers with it.
    ///
    /// # Errors
    /// All errors of the parts of the graph that play.
    pub fn play(&self, inputs: Arc<dyn Inputs>, options: Options) -> Result<(Player, Callback), Errors> {
        let graph = self.live_graph(inputs)?;
        let sources = graph.graph.sources.clone();
        Player::start(graph, options).map_err(|diagnostics| Errors {
            diagnostics,
            notes: Vec::new(),
            sources,
        })
    }
}

impl Errors {
    /// Returns true if one of the diagnostics is an error.
    #[must_use]
    pub fn any_error(&self) -> bool {
        any_error(&self.diagnostics)
    }
}
