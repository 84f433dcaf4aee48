//! The transition graph, which plays while a reload fades from the old graph to the new.
//!
//! It contains the new graph and the part of the old one that is faded out. Wherever the input of a node that continues
//! changes, a `Crossfade` is inserted. It is planned like any graph, and when its fades are over the new graph alone replaces
//! it likewise.

use super::diff::{GraphState, ReloadAction};
use super::state_transfer::OutputPairs;
use crate::graph::{Graph, GraphNode, Link};
use crate::plan::{AudioSink, Delays};
use crate::run::Values;
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::{TICKS_PER_SECOND, Tick, seconds, ticks};
use foley_nodes::dsp::FadeLaw;
use foley_nodes::dsp::nodes::CrossfadeNode;
use foley_nodes::dsp::nodes::CrossfadeParams;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::{Arc, LazyLock};

/// Duration of a cross-fade, s.
pub const FADE: f64 = 0.02;

/// Maximum wait for new nodes whose look-behind fills: 1 s.
const MAX_WAIT: Tick = TICKS_PER_SECOND;

/// A cross-fade. Indices and outputs are those of the transition graph.
#[derive(Clone, Debug)]
struct Fade {
    /// Its node.
    node: usize,
    /// The output that fades out.
    before: Option<(usize, usize)>,
    /// The output that fades in.
    after: Option<(usize, usize)>,
}

/// The transition graph.
pub struct TransitionGraph {
    /// All nodes: first those of the new graph, with their indices.
    pub graph: Graph,
    /// Their shapes.
    pub shapes: Vec<NodeShape>,
    /// Their values.
    pub values: Values,
    /// Old index of the nodes that continue or fade out, by new index.
    pub continued: HashMap<usize, usize>,
    /// Pairs of a node that fades out and the rebuilt node that adopts its state.
    pub adoptions: Vec<(usize, usize)>,
    fades: Vec<Fade>,
    /// Nodes of the new graph that continue with other inputs.
    pub relinked: BTreeSet<usize>,
    /// Nodes of the new graph that are built.
    built: HashSet<usize>,
}

struct TransitionBuilder<'a> {
    old: &'a GraphState<'a>,
    new: &'a GraphState<'a>,
    /// New index of the old nodes that continue.
    kept: HashMap<usize, usize>,
    /// New index of the copies of old nodes that fade out.
    copies: HashMap<usize, usize>,
    /// New index of the copies of old nodes whose values alone are used.
    values: HashMap<usize, usize>,
    out: TransitionGraph,
}

fn copy(node: &GraphNode) -> GraphNode {
    GraphNode {
        id: node.id.clone(),
        ty: Arc::clone(&node.ty),
        params: node.params.boxed(),
        links: node.links.clone(),
        location: node.location.clone(),
        fields: node.fields.clone(),
        whole: node.whole,
    }
}

/// The type of the nodes that a reload inserts; a registry without it plays as well.
fn crossfade() -> Arc<NodeType> {
    static TYPE: LazyLock<Arc<NodeType>> = LazyLock::new(|| Arc::new(NodeType::of::<CrossfadeNode>("dsp")));
    Arc::clone(&TYPE)
}

/// Makes the transition graph of two graphs, from the reload actions and the sinks of both.
pub fn transition(
    old: &GraphState<'_>,
    new: &GraphState<'_>,
    actions: &HashMap<usize, ReloadAction>,
    (old_sinks, new_sinks): (&[AudioSink], &[AudioSink]),
) -> TransitionGraph {
    let mut kept = HashMap::new();
    let mut continued = HashMap::new();
    let mut built = HashSet::new();
    for (&n, action) in actions {
        match action {
            ReloadAction::Keep(m) | ReloadAction::Retune(m, _) => {
                kept.insert(*m, n);
                continued.insert(n, *m);
            }
            ReloadAction::Build => {
                built.insert(n);
            }
        }
    }
    let graph = Graph {
        title: new.graph.title.clone(),
        seed: new.graph.seed,
        nodes: new.graph.nodes.iter().map(copy).collect(),
        order: Vec::new(),
        rank: Vec::new(),
        sources: new.graph.sources.clone(),
    };
    let out = TransitionGraph {
        graph,
        shapes: new.shapes.to_vec(),
        values: new.values.clone(),
        continued,
        adoptions: Vec::new(),
        fades: Vec::new(),
        relinked: BTreeSet::new(),
        built,
    };
    let mut builder =
        TransitionBuilder { old, new, kept, copies: HashMap::new(), values: HashMap::new(), out };
    builder.fade_inputs();
    builder.fade_sinks(old_sinks, new_sinks);
    builder.find_adoptions();
    let mut transition = builder.out;
    transition.graph.sort();
    transition
}

impl TransitionBuilder<'_> {
    /// The index of an old node: its own if it continues, or that of a copy, made with all nodes upstream.
    fn old_node(&mut self, m: usize) -> usize {
        if let Some(&n) = self.kept.get(&m).or_else(|| self.copies.get(&m)) {
            return n;
        }
        let index = self.copy_of(m, format!("~{}", self.old.graph.nodes[m].id));
        self.copies.insert(m, index);
        self.out.continued.insert(index, m);
        let links = self.old.graph.nodes[m].links.clone().into_iter().map(|links| {
            let link = |l: Link| {
                // A value is read from a copy without inputs: the streams of a fold have run before.
                let kind = self.old.graph.nodes[l.node].ty.outputs[l.port].kind;
                let value = matches!(kind, PortKind::Value(_) | PortKind::Fold(_));
                let node = if value { self.old_value(l.node) } else { self.old_node(l.node) };
                Link { node, ..l }
            };
            links.into_iter().map(link).collect()
        });
        let links = links.collect();
        self.out.graph.nodes[index].links = links;
        index
    }

    /// The index of a copy of an old node without inputs, for its values.
    fn old_value(&mut self, m: usize) -> usize {
        if let Some(&index) = self.values.get(&m) {
            return index;
        }
        let index = self.copy_of(m, format!("~{}=", self.old.graph.nodes[m].id));
        self.out.graph.nodes[index].links.iter_mut().for_each(Vec::clear);
        self.values.insert(m, index);
        index
    }

    /// Copies an old node under another id, with its shape and values.
    fn copy_of(&mut self, m: usize, id: String) -> usize {
        let index = self.out.graph.nodes.len();
        self.out.graph.nodes.push(GraphNode { id, ..copy(&self.old.graph.nodes[m]) });
        self.out.shapes.push(self.old.shapes[m].clone());
        for port in 0..self.old.graph.nodes[m].ty.outputs.len() {
            if let Some(value) = self.old.values.get(&(m, port)) {
                self.out.values.insert((index, port), value.clone());
            }
        }
        index
    }

    /// Inserts cross-fades before the changed inputs of nodes that continue.
    fn fade_inputs(&mut self) {
        let mut kept: Vec<(usize, usize)> = self.kept.iter().map(|(&m, &n)| (m, n)).collect();
        kept.sort_unstable();
        for (m, n) in kept {
            for port in 0..self.new.graph.nodes[n].links.len() {
                if matches!(self.new.graph.nodes[n].ty.inputs[port].kind, PortKind::Value(_)) {
                    continue;
                }
                for index in 0..self.new.graph.nodes[n].links[port].len() {
                    let before = self.old.graph.nodes[m].links[port][index].clone();
                    let after = self.new.graph.nodes[n].links[port][index].clone();
                    if self.kept.get(&before.node) == Some(&after.node) && before.port == after.port {
                        continue;
                    }
                    self.out.relinked.insert(n);
                    if let Some(fade) = self.fade(Some(&before), Some(&after)) {
                        self.out.graph.nodes[n].links[port][index] = fade;
                    }
                }
            }
        }
    }

    /// Inserts cross-fades before the changed inputs of sinks.
    fn fade_sinks(&mut self, old_sinks: &[AudioSink], new_sinks: &[AudioSink]) {
        for after in new_sinks {
            let before = old_sinks.iter().find(|sink| sink.id == after.id);
            if let Some(before) = before
                && self.kept.get(&before.link.node) == Some(&after.link.node)
                && before.link.port == after.link.port
            {
                continue;
            }
            if let Some(fade) = self.fade(before.map(|b| &b.link), Some(&after.link)) {
                set_link(&mut self.out.graph.nodes[after.node], fade);
            } else if let Some(before) = before {
                // Different formats cannot be mixed: the old sound fades out, the new one in.
                self.fade_out(before);
                if let Some(fade) = self.fade(None, Some(&after.link)) {
                    set_link(&mut self.out.graph.nodes[after.node], fade);
                }
            }
        }
        for before in old_sinks.iter().filter(|b| new_sinks.iter().all(|a| a.id != b.id)) {
            self.fade_out(before);
        }
    }

    /// Fades out the input of an old sink.
    fn fade_out(&mut self, before: &AudioSink) {
        if let Some(fade) = self.fade(Some(&before.link), None) {
            let sink = self.copy_of(before.node, format!("~{}", before.id));
            set_link(&mut self.out.graph.nodes[sink], fade);
        }
    }

    /// Inserts a cross-fade between two outputs; `None` if they cannot be mixed.
    fn fade(&mut self, before: Option<&Link>, after: Option<&Link>) -> Option<Link> {
        let shape_of =
            |state: &GraphState<'_>, link: &Link| state.shapes[link.node].outputs[link.port].clone();
        let old = before.and_then(|l| shape_of(self.old, l));
        let new = after.and_then(|l| shape_of(self.new, l));
        let shape = old.as_ref().or(new.as_ref())?;
        let matches =
            |other: &StreamShape| other.item.wave && (other.rate, other.width) == (shape.rate, shape.width);
        if before.is_some_and(|_| old.as_ref().is_none_or(|s| !matches(s)))
            || after.is_some_and(|_| new.as_ref().is_none_or(|s| !matches(s)))
        {
            return None;
        }
        let location = before.or(after)?.location.clone();
        let links = [before.map(|l| Link { node: self.old_node(l.node), ..l.clone() }), after.cloned()];
        let law = if self.correlated(&links) { FadeLaw::Linear } else { FadeLaw::EqualPower };
        let node = self.out.graph.nodes.len();
        let output_of = |k: usize| links[k].as_ref().map(|l| (l.node, l.port));
        let (before, after) = (output_of(0), output_of(1));
        self.out.graph.nodes.push(GraphNode {
            id: format!("~fade{node}"),
            ty: crossfade(),
            params: Box::new(CrossfadeParams { at: 0.0, duration: FADE, law }),
            links: links.into_iter().map(|l| l.into_iter().collect()).collect(),
            location: location.clone(),
            fields: Default::default(),
            whole: true,
        });
        let end = match (&old, &new) {
            (Some(a), Some(b)) => a.end.zip(b.end).map(|(a, b)| a.max(b)),
            _ => shape.end,
        };
        let mut stream = shape.clone();
        stream.end = end;
        self.out.shapes.push(NodeShape {
            lookaround: vec![Default::default(); 2],
            outputs: vec![Some(stream)],
            end,
            ..NodeShape::default()
        });
        self.out.fades.push(Fade { node, before, after });
        Some(Link { node, port: 0, location })
    }

    /// Returns true if both outputs have a continued node upstream: their sounds are correlated.
    fn correlated(&self, links: &[Option<Link>; 2]) -> bool {
        let [Some(a), Some(b)] = links else { return false };
        let upstream = |start: usize| {
            let (mut found, mut stack) = (HashSet::new(), vec![start]);
            while let Some(n) = stack.pop() {
                if found.insert(n) {
                    stack.extend(self.out.graph.nodes[n].links.iter().flatten().map(|l| l.node));
                }
            }
            found
        };
        let continues = |n: &usize| self.kept.values().any(|k| k == n);
        upstream(a.node).intersection(&upstream(b.node)).any(continues)
    }

    /// Finds rebuilt nodes that adopt the state of the node of the same id and type that fades out.
    fn find_adoptions(&mut self) {
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        for (&m, &index) in &self.copies {
            let old_node = &self.old.graph.nodes[m];
            let same = |&&n: &&usize| {
                let node = &self.new.graph.nodes[n];
                node.id == old_node.id
                    && node.ty.name == old_node.ty.name
                    && self.old.on_worker[m] == self.new.on_worker[n]
            };
            if let Some(&n) = self.out.built.iter().find(same) {
                pairs.push((index, n));
            }
        }
        pairs.sort_unstable();
        self.out.adoptions = pairs;
    }
}

fn set_link(node: &mut GraphNode, link: Link) {
    if let Some(first) = node.links.iter_mut().flatten().next() {
        *first = link;
    }
}

impl TransitionGraph {
    /// Returns pairs of an output of the old graph and the cross-fade that begins with its history.
    #[must_use]
    pub fn fade_seeds(&self) -> OutputPairs {
        let old_output = |(n, port): (usize, usize)| Some((*self.continued.get(&n)?, port));
        self.fades.iter().filter_map(|f| Some((old_output(f.before?)?, (f.node, 0)))).collect()
    }

    /// Returns pairs of a cross-fade and the output that replaces it with its history when the transition is over.
    ///
    /// An output with other readers that look behind retains its own history.
    #[must_use]
    pub fn successor_seeds(&self) -> OutputPairs {
        let is_looked_behind = |output: (usize, usize)| {
            let readers = self.graph.nodes.iter().enumerate().flat_map(|(n, node)| {
                let ports = node.links.iter().enumerate();
                ports.flat_map(move |(port, links)| links.iter().map(move |l| (n, port, l)))
            });
            readers.filter(|(_, _, l)| (l.node, l.port) == output).any(|(n, port, _)| {
                let behind = self.shapes[n].lookaround.get(port).map_or(0, |lookaround| lookaround.behind);
                behind > 0
            })
        };
        let successor = |f: &Fade| Some(((f.node, 0), f.after.filter(|&after| !is_looked_behind(after))?));
        self.fades.iter().filter_map(successor).collect()
    }

    /// Returns the nodes of the cross-fades.
    #[must_use]
    pub fn fade_nodes(&self) -> Vec<usize> {
        self.fades.iter().map(|f| f.node).collect()
    }

    /// Returns true if there are no cross-fades.
    #[must_use]
    pub fn has_no_fades(&self) -> bool {
        self.fades.is_empty()
    }

    /// Sets the start of the cross-fades, from the delays and the first tick `at`: the time at which the look-behind of
    /// the new nodes upstream is filled. Returns the tick of the run at which the last cross-fade is over.
    pub fn set_fades(&mut self, delays: &Delays, at: Tick) -> Tick {
        let mut valid = vec![0; self.graph.nodes.len()];
        for &n in &self.graph.order {
            valid[n] = (at - delays.of[n]).max(0);
            if !self.built.contains(&n) {
                continue;
            }
            let node = &self.graph.nodes[n];
            for (port, links) in node.links.iter().enumerate() {
                let lookaround = self.shapes[n].lookaround.get(port).copied().unwrap_or_default();
                for link in links.iter().filter(|_| !matches!(node.ty.inputs[port].kind, PortKind::Value(_)))
                {
                    let stream = self.shapes[link.node].outputs.get(link.port).and_then(Option::as_ref);
                    let behind =
                        stream.map_or(lookaround.behind as Tick, |s| s.rate.tick(lookaround.behind as i64));
                    valid[n] = valid[n].max(valid[link.node].saturating_add(behind));
                }
            }
            // A longer look-behind begins in silence.
            valid[n] = valid[n].min((at - delays.of[n]).max(0) + MAX_WAIT);
        }
        let mut last = at;
        for fade in &self.fades {
            let own = (at - delays.of[fade.node]).max(0);
            let begin = fade.after.map_or(own, |(n, _)| valid[n].max(own));
            let node = &mut self.graph.nodes[fade.node];
            if let Some(params) = node.params.as_any().downcast_ref::<CrossfadeParams>() {
                node.params = Box::new(CrossfadeParams { at: seconds(begin), ..params.clone() });
            }
            let end = begin + ticks(FADE) + delays.of[fade.node];
            last = last.max(end);
        }
        last
    }
}
