//! A graph with everything done that does not depend on when it begins to play.

use super::diff::{Edit, Fate, Side, Stamps};
use crate::diag::Diagnostic;
use crate::graph::{DirFiles, Graph};
use crate::memo::Memo;
use crate::plan::{Draft, ahead};
use crate::run::{self, DirOutputs, Job, Progress, Site, Values};
use foley_nodes::core::files::{FileError, Outputs, WriteSeek};
use foley_nodes::core::input::Inputs;
use foley_nodes::core::node::{DynNode, Retune};
use foley_nodes::core::time::Tick;
use std::collections::HashMap;
use std::sync::Arc;

/// A graph with all that it needs to play.
pub struct Material {
    /// The graph.
    pub graph: Graph,
    /// Its files.
    pub files: DirFiles,
    /// Seed of its randomness.
    pub seed: u64,
    /// Where values are kept, if at all.
    pub memo: Option<Arc<Memo>>,
    /// What comes in while it plays.
    pub inputs: Arc<dyn Inputs>,
}

/// A graph that is ready to play but for its place in time.
pub struct Ready {
    /// What it was made of.
    pub material: Material,
    /// What plays, and what has to run before.
    pub draft: Draft,
    /// Its values.
    pub values: Values,
    /// The files behind it.
    stamps: Stamps,
    /// Values that were computed, rather than known from before.
    computed: Vec<String>,
}

impl Ready {
    /// What there is to compare of it.
    pub fn side(&self) -> Side<'_> {
        Side {
            graph: &self.material.graph,
            shapes: &self.draft.prelude.shapes,
            values: &self.values,
            seed: self.material.seed,
            stamps: &self.stamps,
            ahead: ahead(&self.material.graph, &self.draft.nodes),
        }
    }

    /// Where its nodes are built.
    pub fn site(&self, quantum: Tick) -> Site<'_> {
        Site {
            graph: &self.material.graph,
            shapes: &self.draft.prelude.shapes,
            window: quantum,
            files: &self.material.files,
            outputs: &NOWHERE,
            inputs: &*self.material.inputs,
            seed: self.material.seed,
        }
    }
}

/// Where a graph that plays would write.
static NOWHERE: Nowhere = Nowhere;
struct Nowhere;

impl Outputs for Nowhere {
    fn create(&self, path: &str) -> Result<Box<dyn WriteSeek>, FileError> {
        let message = format!("a graph that plays writes no files, and not {path:?}");
        Err(FileError { code: "F080", message })
    }
}

impl Ready {
    /// Shapes a graph and computes its values.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn new(material: Material) -> Result<Self, Vec<Diagnostic>> {
        let draft = Draft::new(&material.graph, &material.files, material.files.limits().memory)?;
        let outputs = DirOutputs::new(".");
        let job = Job {
            graph: &material.graph,
            plan: &draft.prelude,
            files: &material.files,
            outputs: &outputs,
            taps: &[],
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            seed: material.seed,
            memo: material.memo.as_deref(),
            progress: Arc::new(Progress::default()),
        };
        let (values, report) = run::values(&job)?;
        let makes_values = |n: &run::NodeReport| {
            let node = material.graph.find(&n.id).map(|k| &material.graph.nodes[k]);
            node.is_some_and(|node| node.ty.eval.is_some())
        };
        let computed = report.nodes.iter().filter(|n| makes_values(n) && n.calls > 0 && !n.cached);
        let computed = computed.map(|n| n.id.clone()).collect();
        let opened = draft.prelude.shapes.iter().flat_map(|s| &s.opened);
        let stamps = opened.map(|path| (path.clone(), material.files.stamp(path))).collect();
        Ok(Self { material, draft, values, stamps, computed })
    }
}

/// Builds what is new, and finds out which nodes can take their new parameters.
pub fn build(
    old: &Side<'_>,
    next: &Ready,
    window: Tick,
    fates: &mut HashMap<usize, Fate>,
) -> Result<HashMap<usize, Box<dyn DynNode>>, Vec<Diagnostic>> {
    let site = next.site(window);
    let (mut built, mut errors) = (HashMap::new(), Vec::new());
    for &n in &next.draft.nodes {
        let mut make = || site.build(n, &next.values).map_err(|e| errors.push(e)).ok();
        match fates.get(&n) {
            Some(Fate::Retuned(m, _)) => {
                // Whether a node can go from one set of parameters to another is the same the other way round, so a
                // trial of the new node tells it of the one that plays.
                let was = &old.graph.nodes[*m].params;
                let takes = make().is_none_or(|mut trial| trial.retune(&**was) == Retune::Done);
                if takes {
                    continue;
                }
            }
            Some(Fate::New) => {}
            Some(Fate::Same(_)) | None => continue,
        }
        fates.insert(n, Fate::New);
        if let Some(node) = make() {
            built.insert(n, node);
        }
    }
    if errors.is_empty() { Ok(built) } else { Err(errors) }
}

/// What becomes of the nodes of a graph, for people.
pub fn edit(old: &Side<'_>, old_plays: &[usize], next: &Ready, fates: &HashMap<usize, Fate>) -> Edit {
    let graph = &next.material.graph;
    let mut edit = Edit { computed: next.computed.clone(), ..Edit::default() };
    for &n in &next.draft.nodes {
        let id = graph.nodes[n].id.clone();
        match fates.get(&n) {
            Some(Fate::Same(_)) => edit.kept += 1,
            Some(Fate::Retuned(..)) => {
                edit.kept += 1;
                edit.retuned.push(id);
            }
            _ if old_plays.iter().any(|&m| old.graph.nodes[m].id == id) => edit.rebuilt.push(id),
            _ => edit.added.push(id),
        }
    }
    let stays = |id: &str| next.draft.nodes.iter().any(|&n| graph.nodes[n].id == id);
    let gone = old_plays.iter().map(|&m| &old.graph.nodes[m].id).filter(|id| !stays(id));
    edit.removed = gone.cloned().collect();
    edit
}
