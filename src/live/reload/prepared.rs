//! A graph that is prepared to play: everything that does not depend on the time at which it begins.

use super::diff::{Edit, GraphState, ReloadAction, Stamps};
use crate::diag::Diagnostic;
use crate::graph::{DirFiles, Graph};
use crate::memo::Memo;
use crate::plan::{Draft, runs_on_worker};
use crate::run::{self, BuildSite, DirOutputs, Job, Progress, Values};
use foley_nodes::core::computation::{NotStored, unmonitored};
use foley_nodes::core::files::{FileError, Outputs, WriteSeek};
use foley_nodes::core::input::Inputs;
use foley_nodes::core::node::{DynNode, Retune};
use foley_nodes::core::time::Tick;
use std::collections::HashMap;
use std::sync::Arc;

/// A graph with everything that it needs to play.
pub struct LiveGraph {
    /// The graph.
    pub graph: Graph,
    /// Its files.
    pub files: DirFiles,
    /// Seed.
    pub seed: u64,
    /// The cache of results, if any.
    pub memo: Option<Arc<Memo>>,
    /// Messages that arrive while it plays.
    pub inputs: Arc<dyn Inputs>,
}

/// A graph that is prepared to play.
pub struct PreparedGraph {
    /// The graph.
    pub source: LiveGraph,
    /// The draft of its plan.
    pub draft: Draft,
    /// Its values.
    pub values: Values,
    /// Stamps of its files.
    stamps: Stamps,
    /// Value nodes that were computed, rather than taken from the cache.
    computed: Vec<String>,
}

impl PreparedGraph {
    /// Returns its state for comparison.
    pub fn state(&self) -> GraphState<'_> {
        GraphState {
            graph: &self.source.graph,
            shapes: &self.draft.prelude.shapes,
            values: &self.values,
            seed: self.source.seed,
            stamps: &self.stamps,
            on_worker: runs_on_worker(&self.source.graph, &self.draft.nodes),
        }
    }

    /// Returns the site on which its nodes are built.
    pub fn site(&self, window: Tick) -> BuildSite<'_> {
        BuildSite {
            graph: &self.source.graph,
            shapes: &self.draft.prelude.shapes,
            window,
            files: &self.source.files,
            outputs: &NoOutputs,
            inputs: &*self.source.inputs,
            seed: self.source.seed,
            monitor: &unmonitored,
            partial: &NotStored,
        }
    }
}

/// Refuses all output files: a graph that plays writes none.
struct NoOutputs;

impl Outputs for NoOutputs {
    fn create(&self, path: &str) -> Result<Box<dyn WriteSeek>, FileError> {
        let message = format!("a graph that plays writes no files: {path:?}");
        Err(FileError { code: "F080", message })
    }
}

impl PreparedGraph {
    /// Shapes a graph and computes its values.
    ///
    /// # Errors
    /// All errors of the graph.
    pub fn new(source: LiveGraph) -> Result<Self, Vec<Diagnostic>> {
        let draft = Draft::new(&source.graph, &source.files, source.files.limits().memory)?;
        let outputs = DirOutputs::new(".");
        let job = Job {
            graph: &source.graph,
            plan: &draft.prelude,
            files: &source.files,
            outputs: &outputs,
            taps: &[],
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            seed: source.seed,
            memo: source.memo.as_deref(),
            progress: Arc::new(Progress::default()),
        };
        let (values, report) = run::run_phases(&job)?;
        let is_value_node = |n: &run::NodeReport| {
            let node = source.graph.find(&n.id).map(|k| &source.graph.nodes[k]);
            node.is_some_and(|node| node.ty.eval.is_some())
        };
        let computed = report.nodes.iter().filter(|n| is_value_node(n) && n.calls > 0 && !n.cached);
        let computed = computed.map(|n| n.id.clone()).collect();
        let opened = draft.prelude.shapes.iter().flat_map(|s| &s.opened);
        let stamps = opened.map(|path| (path.clone(), source.files.stamp(path))).collect();
        Ok(Self { source, draft, values, stamps, computed })
    }
}

/// Builds the nodes of [`ReloadAction::Build`]; a node that cannot be retuned is built as well.
///
/// # Errors
/// The faults of all nodes that could not be built.
pub fn build_nodes(
    old: &GraphState<'_>,
    next: &PreparedGraph,
    window: Tick,
    actions: &mut HashMap<usize, ReloadAction>,
) -> Result<HashMap<usize, Box<dyn DynNode>>, Vec<Diagnostic>> {
    let site = next.site(window);
    let (mut built, mut errors) = (HashMap::new(), Vec::new());
    for &n in &next.draft.nodes {
        let mut make = || site.build(n, &next.values).map_err(|e| errors.push(e)).ok();
        match actions.get(&n) {
            Some(ReloadAction::Retune(m, _)) => {
                // Retuning is symmetric: the playing node accepts the new parameters if a new node accepts the old ones.
                let old_params = &old.graph.nodes[*m].params;
                if make().is_none_or(|mut trial| trial.retune(&**old_params) == Retune::Done) {
                    continue;
                }
            }
            Some(ReloadAction::Build) => {}
            Some(ReloadAction::Keep(_)) | None => continue,
        }
        actions.insert(n, ReloadAction::Build);
        if let Some(node) = make() {
            built.insert(n, node);
        }
    }
    if errors.is_empty() { Ok(built) } else { Err(errors) }
}

/// Summarizes the actions of a reload.
pub fn summarize(
    old: &GraphState<'_>,
    old_nodes: &[usize],
    next: &PreparedGraph,
    actions: &HashMap<usize, ReloadAction>,
) -> Edit {
    let graph = &next.source.graph;
    let mut edit = Edit { computed: next.computed.clone(), ..Edit::default() };
    for &n in &next.draft.nodes {
        let id = graph.nodes[n].id.clone();
        match actions.get(&n) {
            Some(ReloadAction::Keep(_)) => edit.kept += 1,
            Some(ReloadAction::Retune(..)) => {
                edit.kept += 1;
                edit.retuned.push(id);
            }
            _ if old_nodes.iter().any(|&m| old.graph.nodes[m].id == id) => edit.rebuilt.push(id),
            _ => edit.added.push(id),
        }
    }
    let remains = |id: &str| next.draft.nodes.iter().any(|&n| graph.nodes[n].id == id);
    let removed = old_nodes.iter().map(|&m| &old.graph.nodes[m].id).filter(|id| !remains(id));
    edit.removed = removed.cloned().collect();
    edit
}
