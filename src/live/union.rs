//! The graph that plays while one sound goes over into another.
//!
//! It holds everything that is new, everything that goes on, and of what is gone the part that is still to be faded out.
//! Wherever a node that goes on hears something else than before, a `Crossfade` stands between. It is a graph like any other:
//! the same planner lays it out, and when its fades are over the new graph alone takes its place in the same way.

use super::diff::{Fate, Side};
use crate::graph::{Graph, GraphNode, Link};
use crate::plan::{Delays, Heard};
use crate::run::Values;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::{Tick, seconds};
use foley_nodes::dsp::FadeLaw;
use foley_nodes::dsp::nodes::CrossfadeNode;
use foley_nodes::dsp::nodes::CrossfadeParams;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::{Arc, LazyLock};

/// How long one sound takes to become the other, seconds.
pub const FADE: f64 = 0.02;

/// How long an edit is waited for whose nodes look far back: 1 s.
const LONGEST_WAIT: Tick = foley_nodes::core::time::TICKS_PER_SECOND;

/// One place where one sound goes over into another.
#[derive(Clone, Debug)]
struct Fade {
    /// The cross-fade's place in the union.
    node: usize,
    /// What goes, in the union.
    before: Option<(usize, usize)>,
    /// What comes in, in the union.
    after: Option<(usize, usize)>,
}

/// Pairs of outputs, each a node and a port.
pub type Outputs = Vec<((usize, usize), (usize, usize))>;

/// The graph of a transition.
pub struct Union {
    /// All nodes: those of the new graph first, in their places.
    pub graph: Graph,
    /// Their shapes; those of cross-fades are missing.
    pub shapes: Vec<NodeShape>,
    /// Their values.
    pub values: Values,
    /// Where nodes that go on, and those to be faded out, were before.
    pub moved: HashMap<usize, usize>,
    /// New nodes that take over what fits: the old one, the new one.
    pub adopts: Vec<(usize, usize)>,
    fades: Vec<Fade>,
    /// Nodes of the new graph that hear something else than before.
    pub fed: BTreeSet<usize>,
    news: HashSet<usize>,
}

struct Weaver<'a> {
    old: &'a Side<'a>,
    new: &'a Side<'a>,
    /// New place of each old node that goes on.
    kept: HashMap<usize, usize>,
    /// Place in the union of each old node that is still needed.
    copies: HashMap<usize, usize>,
    /// The same for nodes of which only the values are.
    values: HashMap<usize, usize>,
    out: Union,
}

fn copy(node: &GraphNode) -> GraphNode {
    GraphNode {
        id: node.id.clone(),
        ty: Arc::clone(&node.ty),
        params: node.params.boxed(),
        links: node.links.clone(),
        place: node.place.clone(),
        fields: node.fields.clone(),
        whole: node.whole,
    }
}

/// The type of the nodes that a reload inserts; a registry without it plays as well.
fn crossfade() -> Arc<NodeType> {
    static TYPE: LazyLock<Arc<NodeType>> = LazyLock::new(|| Arc::new(NodeType::of::<CrossfadeNode>("dsp")));
    Arc::clone(&TYPE)
}

/// Joins two graphs, given the fates of the nodes of the new one and what each side hears.
pub fn union(
    old: &Side<'_>,
    new: &Side<'_>,
    fates: &HashMap<usize, Fate>,
    (old_heard, new_heard): (&[Heard], &[Heard]),
) -> Union {
    let mut kept = HashMap::new();
    let mut moved = HashMap::new();
    let mut news = HashSet::new();
    for (&n, fate) in fates {
        match fate {
            Fate::Same(m) | Fate::Retuned(m, _) => {
                kept.insert(*m, n);
                moved.insert(n, *m);
            }
            Fate::New => {
                news.insert(n);
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
    let out = Union {
        graph,
        shapes: new.shapes.to_vec(),
        values: new.values.clone(),
        moved,
        adopts: Vec::new(),
        fades: Vec::new(),
        fed: BTreeSet::new(),
        news,
    };
    let mut weaver = Weaver { old, new, kept, copies: HashMap::new(), values: HashMap::new(), out };
    weaver.readers();
    weaver.sinks(old_heard, new_heard);
    weaver.adopts();
    let mut union = weaver.out;
    union.graph.sort();
    union
}

impl Weaver<'_> {
    /// The place in the union of an old node: its own where it goes on, or that of a copy, made with all above it.
    fn old_node(&mut self, m: usize) -> usize {
        if let Some(&n) = self.kept.get(&m).or_else(|| self.copies.get(&m)) {
            return n;
        }
        let place = self.copy_of(m, format!("~{}", self.old.graph.nodes[m].id));
        self.copies.insert(m, place);
        self.out.moved.insert(place, m);
        let links = self.old.graph.nodes[m].links.clone().into_iter().map(|links| {
            let link = |l: Link| {
                // A value is taken from a copy of its own: the streams that a fold was made of have run before.
                let kind = self.old.graph.nodes[l.node].ty.outputs[l.port].kind;
                let value = matches!(kind, PortKind::Value(_) | PortKind::Fold(_));
                let node = if value { self.old_value(l.node) } else { self.old_node(l.node) };
                Link { node, ..l }
            };
            links.into_iter().map(link).collect()
        });
        let links = links.collect();
        self.out.graph.nodes[place].links = links;
        place
    }

    /// A copy of an old node for the sake of its values alone.
    fn old_value(&mut self, m: usize) -> usize {
        if let Some(&place) = self.values.get(&m) {
            return place;
        }
        let place = self.copy_of(m, format!("~{}=", self.old.graph.nodes[m].id));
        self.out.graph.nodes[place].links.iter_mut().for_each(Vec::clear);
        self.values.insert(m, place);
        place
    }

    /// An old node under another id, with its shape and its values.
    fn copy_of(&mut self, m: usize, id: String) -> usize {
        let place = self.out.graph.nodes.len();
        self.out.graph.nodes.push(GraphNode { id, ..copy(&self.old.graph.nodes[m]) });
        self.out.shapes.push(self.old.shapes[m].clone());
        for port in 0..self.old.graph.nodes[m].ty.outputs.len() {
            if let Some(value) = self.old.values.get(&(m, port)) {
                self.out.values.insert((place, port), value.clone());
            }
        }
        place
    }

    /// Puts cross-fades before the inputs of nodes that go on.
    fn readers(&mut self) {
        let mut kept: Vec<(usize, usize)> = self.kept.iter().map(|(&m, &n)| (m, n)).collect();
        kept.sort_unstable();
        for (m, n) in kept {
            for port in 0..self.new.graph.nodes[n].links.len() {
                if matches!(self.new.graph.nodes[n].ty.inputs[port].kind, PortKind::Value(_)) {
                    continue;
                }
                for place in 0..self.new.graph.nodes[n].links[port].len() {
                    let before = self.old.graph.nodes[m].links[port][place].clone();
                    let after = self.new.graph.nodes[n].links[port][place].clone();
                    if self.kept.get(&before.node) == Some(&after.node) && before.port == after.port {
                        continue;
                    }
                    self.out.fed.insert(n);
                    if let Some(fade) = self.fade(Some(&before), Some(&after)) {
                        self.out.graph.nodes[n].links[port][place] = fade;
                    }
                }
            }
        }
    }

    /// Puts cross-fades before all that is heard.
    fn sinks(&mut self, old_heard: &[Heard], new_heard: &[Heard]) {
        for after in new_heard {
            let before = old_heard.iter().find(|h| h.id == after.id);
            if let Some(before) = before
                && self.kept.get(&before.link.node) == Some(&after.link.node)
                && before.link.port == after.link.port
            {
                continue;
            }
            if let Some(fade) = self.fade(before.map(|b| &b.link), Some(&after.link)) {
                set_link(&mut self.out.graph.nodes[after.sink], fade);
            } else if let Some(before) = before {
                // Formats that do not meet cannot be mixed: the old sound ends, the new one begins.
                self.leave(before);
                if let Some(fade) = self.fade(None, Some(&after.link)) {
                    set_link(&mut self.out.graph.nodes[after.sink], fade);
                }
            }
        }
        for before in old_heard.iter().filter(|b| new_heard.iter().all(|a| a.id != b.id)) {
            self.leave(before);
        }
    }

    /// Lets what was heard fade out.
    fn leave(&mut self, before: &Heard) {
        if let Some(fade) = self.fade(Some(&before.link), None) {
            let sink = self.copy_of(before.sink, format!("~{}", before.id));
            set_link(&mut self.out.graph.nodes[sink], fade);
        }
    }

    /// A cross-fade between two outputs; `None` where they cannot be mixed.
    fn fade(&mut self, before: Option<&Link>, after: Option<&Link>) -> Option<Link> {
        let of = |side: &Side<'_>, link: &Link| side.shapes[link.node].outputs[link.port].clone();
        let (old, new) = (before.and_then(|l| of(self.old, l)), after.and_then(|l| of(self.new, l)));
        let one = old.as_ref().or(new.as_ref())?;
        let alike = |other: &foley_nodes::core::item::StreamShape| {
            other.item.wave && (other.rate, other.width) == (one.rate, one.width)
        };
        if before.is_some_and(|_| old.as_ref().is_none_or(|s| !alike(s)))
            || after.is_some_and(|_| new.as_ref().is_none_or(|s| !alike(s)))
        {
            return None;
        }
        let place = before.or(after)?.place.clone();
        let links = [before.map(|l| Link { node: self.old_node(l.node), ..l.clone() }), after.cloned()];
        let law = if self.correlated(&links) { FadeLaw::Linear } else { FadeLaw::EqualPower };
        let node = self.out.graph.nodes.len();
        let end_of = |k: usize| links[k].as_ref().map(|l| (l.node, l.port));
        let (before, after) = (end_of(0), end_of(1));
        self.out.graph.nodes.push(GraphNode {
            id: format!("~fade{node}"),
            ty: crossfade(),
            params: Box::new(CrossfadeParams { at: 0.0, duration: FADE, law }),
            links: links.into_iter().map(|l| l.into_iter().collect()).collect(),
            place: place.clone(),
            fields: Default::default(),
            whole: true,
        });
        let shape = one.clone();
        let end = match (&old, &new) {
            (Some(a), Some(b)) => a.end.zip(b.end).map(|(a, b)| a.max(b)),
            _ => shape.end,
        };
        let mut stream = shape;
        stream.end = end;
        self.out.shapes.push(NodeShape {
            lookaround: vec![Default::default(); 2],
            outputs: vec![Some(stream)],
            end,
            ..NodeShape::default()
        });
        self.out.fades.push(Fade { node, before, after });
        Some(Link { node, port: 0, place })
    }

    /// Whether both sides are made of the same sound: one that goes on stands above both.
    fn correlated(&self, links: &[Option<Link>; 2]) -> bool {
        let [Some(a), Some(b)] = links else { return false };
        let above = |start: usize| {
            let (mut found, mut stack) = (HashSet::new(), vec![start]);
            while let Some(n) = stack.pop() {
                if found.insert(n) {
                    stack.extend(self.out.graph.nodes[n].links.iter().flatten().map(|l| l.node));
                }
            }
            found
        };
        let goes_on = |n: &usize| self.kept.values().any(|k| k == n);
        above(a.node).intersection(&above(b.node)).any(goes_on)
    }

    fn adopts(&mut self) {
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        for (&m, &place) in &self.copies {
            let was = &self.old.graph.nodes[m];
            let same = |&&n: &&usize| {
                let node = &self.new.graph.nodes[n];
                node.id == was.id && node.ty.name == was.ty.name && self.old.ahead[m] == self.new.ahead[n]
            };
            if let Some(&n) = self.out.news.iter().find(same) {
                pairs.push((place, n));
            }
        }
        pairs.sort_unstable();
        self.out.adopts = pairs;
    }
}

fn set_link(node: &mut GraphNode, link: Link) {
    if let Some(first) = node.links.iter_mut().flatten().next() {
        *first = link;
    }
}

impl Union {
    /// The outputs whose history the output of a cross-fade begins with: what was heard before, as outputs of the old graph.
    #[must_use]
    pub fn seeds(&self) -> Outputs {
        let was = |(n, port): (usize, usize)| Some((*self.moved.get(&n)?, port));
        self.fades.iter().filter_map(|f| Some((was(f.before?)?, (f.node, 0)))).collect()
    }

    /// The outputs that begin with the history of a cross-fade when it goes: those that only those look back on to whom it
    /// was given.
    #[must_use]
    pub fn heirs(&self) -> Outputs {
        let looks_back = |end: (usize, usize)| {
            let readers = self.graph.nodes.iter().enumerate().flat_map(|(n, node)| {
                let ports = node.links.iter().enumerate();
                ports.flat_map(move |(port, links)| links.iter().map(move |l| (n, port, l)))
            });
            readers.filter(|(_, _, l)| (l.node, l.port) == end).any(|(n, port, _)| {
                let behind = self.shapes[n].lookaround.get(port).map_or(0, |lookaround| lookaround.behind);
                behind > 0
            })
        };
        let heir = |f: &Fade| Some(((f.node, 0), f.after.filter(|&after| !looks_back(after))?));
        self.fades.iter().filter_map(heir).collect()
    }

    /// The cross-fades, in the union.
    #[must_use]
    pub fn fade_nodes(&self) -> Vec<usize> {
        self.fades.iter().map(|f| f.node).collect()
    }

    /// Whether anything has to be faded.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.fades.is_empty()
    }

    /// Sets when the fades begin: as soon as what comes in has seen all that it looks back on, given how far behind the
    /// run each node works and that it takes over at `at`. Gives the tick of the run at which the last of them is over.
    pub fn set_fades(&mut self, delays: &Delays, at: Tick) -> Tick {
        let mut valid = vec![0; self.graph.nodes.len()];
        for &n in &self.graph.order {
            valid[n] = (at - delays.of[n]).max(0);
            if !self.news.contains(&n) {
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
            // Nobody waits longer for an edit; what looks back further begins in silence.
            valid[n] = valid[n].min((at - delays.of[n]).max(0) + LONGEST_WAIT);
        }
        let mut last = at;
        for fade in &self.fades {
            let own = (at - delays.of[fade.node]).max(0);
            let begin = fade.after.map_or(own, |(n, _)| valid[n].max(own));
            let node = &mut self.graph.nodes[fade.node];
            if let Some(params) = node.params.as_any().downcast_ref::<CrossfadeParams>() {
                node.params = Box::new(CrossfadeParams { at: seconds(begin), ..params.clone() });
            }
            let end = begin + foley_nodes::core::time::ticks(FADE) + delays.of[fade.node];
            last = last.max(end);
        }
        last
    }
}
