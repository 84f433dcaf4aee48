//! From nodes as they stand in the text to a checked graph.

use super::load::{Given, Loaded, Loader, RawNode};
use super::outputs;
use super::root::join;
use super::sound;
use super::suggest::{help, nearest};
use super::{Graph, GraphNode, Link, node_type, node_types};
use crate::diag::{Diagnostic, Place, any_error, sort};
use crate::lang::{Value, ValueKind};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{AnyParams, Datum, FieldError, Mismatch, ParamKind, ParamSpec};
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// A link as it stands in the text: the text, and where.
pub(super) struct RawLink {
    text: String,
    scope: String,
    place: Place,
}

/// A node whose own fields are checked.
pub(super) struct Half {
    pub ty: &'static NodeType,
    pub params: Option<Box<dyn AnyParams>>,
    links: Vec<Vec<RawLink>>,
    pub fields: BTreeMap<String, Place>,
    /// Where the value was given, for fields that stand for a parameter of the graph.
    origins: BTreeMap<String, Place>,
}

/// Checks everything that was read.
pub(super) fn check(mut loader: Loader) -> Loaded {
    let raw = std::mem::take(&mut loader.nodes);
    let mut good = sound::readable(&raw, &loader.found);
    let mut halves: Vec<Option<Half>> = Vec::new();
    for (node, good) in raw.iter().zip(&mut good) {
        let before = loader.found.len();
        halves.push(fields(node, &mut loader));
        *good &= loader.found.len() == before;
    }
    let mut found = std::mem::take(&mut loader.found);
    let by_id: HashMap<&str, usize> = raw.iter().enumerate().map(|(k, n)| (n.id.as_str(), k)).collect();
    let mut links: Vec<Vec<Vec<Link>>> = Vec::new();
    let mut count = 0;
    for (k, half) in halves.iter().enumerate() {
        let Some(half) = half else {
            links.push(Vec::new());
            continue;
        };
        let per_port = half.ty.inputs.iter().zip(&half.links).map(|(spec, texts)| {
            let one = |text: &RawLink| match link(text, spec, &raw, &halves, &by_id, &loader.lost) {
                Ok(link) => link,
                Err(diagnostic) => {
                    found.push(diagnostic.node(&raw[k].id));
                    good[k] = false;
                    None
                }
            };
            texts.iter().filter_map(one).collect()
        });
        let resolved: Vec<Vec<Link>> = per_port.collect();
        let all = half.links.iter().map(Vec::len).sum::<usize>();
        good[k] &= resolved.iter().map(Vec::len).sum::<usize>() == all;
        links.push(resolved);
        count += all;
    }
    if count > loader.link_limit() {
        let message = format!("more than {} links", loader.link_limit());
        found.push(Diagnostic::general("F009", message).help("--max-links allows more"));
        good.fill(false);
    }
    outputs::check(&raw, &halves, &mut found);
    let order = order(&raw, &halves, &links, &mut found);
    // What is wrong can be why something seems to be unused.
    if !any_error(&found) {
        unused(&raw, &halves, &links, &mut found);
        found.extend(loader.unused_params());
    }
    sort(&mut found);
    let sources = std::mem::take(&mut loader.sources);
    let root = loader.take_root();
    if raw.is_empty() && !any_error(&found) {
        found.push(Diagnostic::warning("F026", "the graph has no nodes", Place::default()));
    }
    let mut nodes = Vec::new();
    for (((raw, half), links), good) in raw.into_iter().zip(halves).zip(links).zip(good) {
        nodes.push(match half {
            Some(Half { ty, params: Some(params), fields, .. }) if good => {
                Some(GraphNode { id: raw.id, ty, params, links, place: raw.place, fields, whole: true })
            }
            _ => None,
        });
    }
    let count = nodes.len();
    let sound = Graph {
        title: loader.title.unwrap_or_default(),
        seed: loader.seed.unwrap_or(0),
        sources: sources.clone(),
        ..sound::graph(nodes, &order)
    };
    let whole = sound.nodes.iter().filter(|node| node.whole).count() == count;
    if !whole && !any_error(&found) {
        found.push(Diagnostic::general("F099", "a node was not checked: a defect in foley"));
    }
    let (graph, sound) = if any_error(&found) { (None, Some(sound)) } else { (Some(sound), None) };
    Loaded { graph, sound, diagnostics: found, sources, root }
}

/// Checks type, parameters and presence of inputs of one node.
fn fields(node: &RawNode, loader: &mut Loader) -> Option<Half> {
    if node.type_name.is_empty() {
        return None;
    }
    let error =
        |code, message: String, place: &Place| Diagnostic::error(code, message, place.clone()).node(&node.id);
    let Some(ty) = node_type(&node.type_name) else {
        let near = nearest(&node.type_name, node_types().iter().map(|ty| ty.name));
        let hint = near.map(|name| format!("did you mean `{name}`? ")).unwrap_or_default();
        let message = format!("there is no node type `{}`", node.type_name);
        let found = error("F010", message, &node.type_place);
        loader.found.push(found.help(format!("{hint}`foley nodes` lists all node types")));
        return None;
    };
    let specs = (ty.params)();
    let mut half = Half {
        ty,
        params: None,
        links: ty.inputs.iter().map(|_| Vec::new()).collect(),
        fields: BTreeMap::new(),
        origins: BTreeMap::new(),
    };
    let mut data: BTreeMap<&str, Datum> = BTreeMap::new();
    let mut linked = vec![false; ty.inputs.len()];
    let mut broken: Vec<&str> = Vec::new();
    for (name, key, given) in &node.fields {
        let param = specs.iter().find(|s| s.name == name);
        let port = ty.inputs.iter().position(|p| p.name == name);
        if param.is_none() && port.is_none() {
            // A parameter that takes a link as well is an input of the same name.
            let only = specs.iter().map(|s| s.name).filter(|s| ty.inputs.iter().all(|p| p.name != *s));
            let names = ty.inputs.iter().map(|p| p.name).chain(only);
            let message = format!("{} has no input or parameter `{name}`", ty.name);
            loader.found.push(error("F011", message, key).help(help(name, "fields", names)));
            continue;
        }
        let place = given.place.clone();
        let Some(given) = loader.resolve(given.clone()) else {
            broken.push(name);
            if let Some(port) = port {
                linked[port] = true;
            }
            continue;
        };
        if given.place != place {
            half.origins.insert(name.clone(), given.place.clone());
        } else if let ValueKind::List(items) = &given.value.value {
            let texts = items.iter().enumerate().filter(|(_, item)| matches!(item.value, ValueKind::Str(_)));
            let placed = |(k, item): (usize, &Value)| {
                (format!("{name}[{k}]"), Place { file: place.file, span: item.span() })
            };
            half.fields.extend(texts.map(placed));
        }
        half.fields.insert(name.clone(), place);
        // A list is of links, unless it is one of numbers for a parameter of the same name.
        let is_link = |v: &Value, spec: &ParamSpec| match v.value {
            ValueKind::Str(_) | ValueKind::Option(None) => true,
            ValueKind::List(_) => !matches!(spec.kind, ParamKind::List(..)),
            _ => false,
        };
        match (port, param) {
            (Some(port), None) => {
                linked[port] = true;
                half.links[port] = links_of(&given, &ty.inputs[port], node, loader);
            }
            (Some(port), Some(spec)) if is_link(&given.value, spec) => {
                half.links[port] = links_of(&given, &ty.inputs[port], node, loader);
            }
            (_, Some(spec)) => match datum(&given, spec, loader) {
                Some(datum) => drop(data.insert(spec.name, datum)),
                None => broken.push(spec.name),
            },
            (None, None) => {}
        }
    }
    for (k, spec) in ty.inputs.iter().enumerate() {
        if spec.arity == Arity::One && !linked[k] && node.whole {
            let message =
                format!("input `{}` ({} of {}) has no link", spec.name, spec.kind.word(), spec.kind.name());
            let feeders = feeders(spec);
            let help = format!("link it to a node that gives {}: {feeders}", spec.kind.name());
            loader.found.push(error("F012", message, &node.place).help(help));
        }
    }
    match (ty.read)(&|name| data.get(name).cloned()) {
        Ok(params) => half.params = Some(params),
        Err(errors) => {
            for e in errors {
                let mut found = field_error(&e, &specs, &half.fields, node);
                let about = match &e {
                    FieldError::Missing(name) | FieldError::Value(name, _) => *name,
                };
                if let Some(origin) = half.origins.get(about) {
                    found = found.label(origin.clone(), "the value is given here");
                }
                if !broken.contains(&about) && (node.whole || !matches!(e, FieldError::Missing(_))) {
                    loader.found.push(found);
                }
            }
        }
    }
    Some(half)
}

/// Node types whose outputs an input takes.
fn feeders(spec: &PortSpec) -> String {
    let gives = |ty: &&NodeType| ty.outputs.iter().any(|o| o.kind.feeds(&spec.kind));
    let names: Vec<&str> = node_types().iter().filter(gives).map(|ty| ty.name).take(12).collect();
    if names.is_empty() { "no node type gives it".into() } else { names.join(", ") }
}

fn links_of(given: &Given, spec: &PortSpec, node: &RawNode, loader: &mut Loader) -> Vec<RawLink> {
    let mut wrong = |value: &Value, what: &str| {
        let place = Place { file: given.place.file, span: value.span() };
        let message = format!("input `{}` takes {what}, found {}", spec.name, value.describe());
        loader.found.push(Diagnostic::error("F018", message, place).node(&node.id));
    };
    let raw = |value: &Value, text: &str| RawLink {
        text: text.to_owned(),
        scope: given.scope.prefix.clone(),
        place: Place { file: given.place.file, span: value.span() },
    };
    match (&given.value.value, spec.arity) {
        (ValueKind::Str(text), _) => vec![raw(&given.value, text)],
        (ValueKind::Option(None), Arity::Optional) | (ValueKind::Error, _) => Vec::new(),
        (ValueKind::List(items), Arity::Many) => {
            let mut links = Vec::new();
            for item in items {
                match loader.resolve(given.inside(item)) {
                    Some(Given { value: Value { value: ValueKind::Str(text), .. }, scope, .. }) => {
                        let place = Place { file: given.place.file, span: item.span() };
                        links.push(RawLink { text, scope: scope.prefix, place });
                    }
                    Some(other) if !other.value.is_error() => {
                        let place = other.place.clone();
                        let message =
                            format!("a link is text such as \"node.port\", found {}", other.value.describe());
                        loader.found.push(Diagnostic::error("F018", message, place).node(&node.id));
                    }
                    _ => {}
                }
            }
            links
        }
        (ValueKind::List(items), _) if items.len() != 1 => {
            let message = format!("input `{}` takes one link, found a list of {}", spec.name, items.len());
            let found = Diagnostic::error("F024", message, given.place.clone()).node(&node.id);
            loader.found.push(found.help("put Mix in between to join several"));
            Vec::new()
        }
        (_, Arity::Many) => {
            wrong(&given.value, "a list of links such as [\"a\", \"b.port\"]");
            Vec::new()
        }
        _ => {
            wrong(&given.value, "a link such as \"node\" or \"node.port\"");
            Vec::new()
        }
    }
}

/// The value as a parameter reads it; paths are made relative to the working folder.
fn datum(given: &Given, spec: &ParamSpec, loader: &mut Loader) -> Option<Datum> {
    let path = matches!(spec.kind.innermost(), ParamKind::Asset);
    let value = bare_text(given, &spec.kind, loader).unwrap_or_else(|| given.value.clone());
    convert(&value, given, path, loader)
}

/// What the command line gives for a text or a path, as it was typed: what has to be in quotes in a file may be bare there.
fn bare_text(given: &Given, kind: &ParamKind, loader: &Loader) -> Option<Value> {
    let text = loader.argument(given)?;
    let quoted = matches!(given.value.value, ValueKind::Str(_));
    let kind = match (kind, &given.value.value) {
        (ParamKind::Maybe(_), ValueKind::Option(_)) => return None,
        (ParamKind::Maybe(inner), _) => *inner,
        (kind, _) => kind,
    };
    let takes = matches!(kind, ParamKind::Text | ParamKind::Asset | ParamKind::Output);
    let value = || Value { span: given.place.span.clone(), value: ValueKind::Str(text.to_owned()) };
    (takes && !quoted).then(value)
}

fn convert(value: &Value, given: &Given, path: bool, loader: &mut Loader) -> Option<Datum> {
    let list = |items: &[Value], loader: &mut Loader| {
        let items: Option<Vec<Datum>> = items
            .iter()
            .map(|item| {
                let inner = loader.resolve(given.inside(item))?;
                convert(&inner.value, &inner, path, loader)
            })
            .collect();
        items.map(Datum::List)
    };
    Some(match &value.value {
        ValueKind::Unit => Datum::Unit,
        ValueKind::Bool(b) => Datum::Bool(*b),
        ValueKind::Char(c) => Datum::Text(c.to_string()),
        ValueKind::Int(i) => i64::try_from(*i).map_or_else(|_| Datum::Float(*i as f64), Datum::Int),
        ValueKind::Float(x) => Datum::Float(*x),
        ValueKind::Str(text) if path => Datum::Text(asset(text, given, loader)),
        ValueKind::Str(text) => Datum::Text(text.clone()),
        ValueKind::List(items) | ValueKind::Tuple(items) => return list(items, loader),
        ValueKind::Name(name) => Datum::Name(name.value.clone()),
        ValueKind::Option(None) => Datum::Name("None".into()),
        ValueKind::Option(Some(inner)) => {
            let inner = loader.resolve(given.inside(inner))?;
            return convert(&inner.value, &inner, path, loader);
        }
        ValueKind::Error => return None,
        _ => Datum::Other(value.describe().to_owned()),
    })
}

/// The path of an asset. One that was given on the command line may be read wherever it is, unless it is absolute.
fn asset(text: &str, given: &Given, loader: &mut Loader) -> String {
    let command_line = loader.argument(given).is_some();
    let joined = join(&given.folder, text);
    if command_line && !Path::new(text).is_absolute() {
        loader.allow_named(Path::new(&joined));
    }
    joined
}

fn field_error(
    e: &FieldError,
    specs: &[ParamSpec],
    fields: &BTreeMap<String, Place>,
    node: &RawNode,
) -> Diagnostic {
    let at = |name: &str| fields.get(name).unwrap_or(&node.place).clone();
    let spec = |name: &str| specs.iter().find(|s| s.name == name);
    let unit = |name: &str| match spec(name).and_then(|s| s.unit) {
        Some(unit) if !unit.is_empty() => format!(" {unit}"),
        _ => String::new(),
    };
    match e {
        FieldError::Missing(name) => {
            let kind = spec(name).map(|s| s.kind.to_string()).unwrap_or_default();
            Diagnostic::error(
                "F013",
                format!("parameter `{name}` ({kind}) has to be given"),
                node.place.clone(),
            )
        }
        FieldError::Value(name, Mismatch::Type { expected, found }) => {
            Diagnostic::error("F014", format!("`{name}` takes {expected}, found {found}"), at(name))
        }
        FieldError::Value(name, Mismatch::Range { found, bounds }) => {
            let message = format!("`{name}` is {found}{unit}, out of its range", unit = unit(name));
            Diagnostic::error("F015", message, at(name)).help(format!(
                "from {} to {}{}",
                bounds.min,
                bounds.max,
                unit(name)
            ))
        }
        FieldError::Value(name, Mismatch::NotFinite { found }) => {
            Diagnostic::error("F016", format!("`{name}` is {found}, which is not a finite number"), at(name))
        }
        FieldError::Value(name, Mismatch::Choice { found, choices }) => {
            let names = choices.iter().map(|(n, _)| *n);
            Diagnostic::error("F017", format!("`{name}` has no choice `{found}`"), at(name))
                .help(help(found, "choices", names))
        }
    }
    .node(&node.id)
}

/// Follows a link to the output that it names. `None` where the other node, or its whole sub-graph, has errors of its own.
fn link(
    raw: &RawLink,
    input: &PortSpec,
    nodes: &[RawNode],
    halves: &[Option<Half>],
    by_id: &HashMap<&str, usize>,
    lost: &[String],
) -> Result<Option<Link>, Diagnostic> {
    let error = |code, message: String| Diagnostic::error(code, message, raw.place.clone());
    let full = format!("{}{}", raw.scope, raw.text);
    let (node, port) = match by_id.get(full.as_str()) {
        Some(&node) => (node, None),
        None => match full.rsplit_once('.').and_then(|(id, port)| Some((*by_id.get(id)?, port))) {
            Some((node, port)) => (node, Some(port.to_owned())),
            None if lost.iter().any(|prefix| full.starts_with(prefix)) => return Ok(None),
            None => {
                let id = raw.text.split('.').next().unwrap_or_default();
                let names = nodes.iter().filter_map(|n| n.id.strip_prefix(raw.scope.as_str()));
                let message = format!("there is no node `{}`", raw.text);
                let best: Vec<&str> = names.collect();
                let found = if best.contains(&id) { raw.text.as_str() } else { id };
                return Err(error("F020", message).help(help(found, "nodes", best)));
            }
        },
    };
    let Some(half) = &halves[node] else { return Ok(None) };
    let ty = half.ty;
    let ports = ty.outputs;
    let at = match port {
        Some(port) => match ports.iter().position(|p| p.name == port) {
            Some(at) => at,
            None => {
                let message = format!("`{}` ({}) has no output `{port}`", nodes[node].id, ty.name);
                return Err(error("F021", message).help(help(
                    &port,
                    "outputs",
                    ports.iter().map(|p| p.name),
                )));
            }
        },
        None => match ports.len() {
            1 => 0,
            0 => return Err(error("F021", format!("`{}` ({}) has no outputs", nodes[node].id, ty.name))),
            _ => {
                let fitting: Vec<usize> =
                    (0..ports.len()).filter(|&k| ports[k].kind.feeds(&input.kind)).collect();
                let all: Vec<usize> = (0..ports.len()).collect();
                let which = if fitting.is_empty() { &all } else { &fitting };
                let names: Vec<String> =
                    which.iter().map(|&k| format!("\"{}.{}\"", raw.text, ports[k].name)).collect();
                let message = format!("`{}` ({}) has {} outputs", nodes[node].id, ty.name, ports.len());
                return Err(error("F022", message).help(format!("name one: {}", names.join(" or "))));
            }
        },
    };
    let output = &ports[at];
    if !output.kind.feeds(&input.kind) {
        let message = format!(
            "input `{}` takes {}, `{}.{}` gives {}",
            input.name,
            kind_words(&input.kind),
            nodes[node].id,
            output.name,
            kind_words(&output.kind)
        );
        let between = between(&output.kind, &input.kind);
        let found = error("F023", message)
            .label(nodes[node].place.clone(), format!("gives {}", kind_words(&output.kind)));
        return Err(match between {
            Some(name) => found.help(format!("put {name} in between")),
            None => found.help(format!("nodes that give {}: {}", input.kind.name(), feeders(input))),
        });
    }
    Ok(Some(Link { node, port: at, place: raw.place.clone() }))
}

fn kind_words(kind: &PortKind) -> String {
    match kind {
        PortKind::Stream(t) => format!("a stream of {}", t.name),
        PortKind::Events(t) => format!("{} events", t.name),
        PortKind::Value(t) => format!("a {} value", t.name),
        PortKind::Fold(t) => format!("a {} made of a whole stream", t.name),
    }
}

/// A node type that takes what one port gives, alone, and gives what the other takes.
fn between(from: &PortKind, to: &PortKind) -> Option<&'static str> {
    let fits = |ty: &&NodeType| {
        let needed = ty.inputs.iter().filter(|p| p.arity != Arity::Optional).count();
        needed == 1
            && ty.inputs.iter().any(|p| p.arity != Arity::Optional && from.feeds(&p.kind))
            && ty.outputs.iter().any(|o| o.kind.feeds(to))
    };
    node_types().iter().find(fits).map(|ty| ty.name)
}

/// The topological order. A loop is an error unless an input that is read late closes it.
fn order(
    raw: &[RawNode],
    halves: &[Option<Half>],
    links: &[Vec<Vec<Link>>],
    found: &mut Vec<Diagnostic>,
) -> Vec<usize> {
    let late = |v: usize, port: usize| halves[v].as_ref().is_some_and(|h| h.ty.inputs[port].late);
    let mut all = DiGraph::<(), ()>::new();
    let index: Vec<_> = raw.iter().map(|_| all.add_node(())).collect();
    let edges = || {
        links.iter().enumerate().flat_map(|(v, ports)| {
            ports
                .iter()
                .enumerate()
                .flat_map(move |(port, links)| links.iter().map(move |l| (l.node, v, port, l)))
        })
    };
    for (u, v, _, _) in edges() {
        all.update_edge(index[u], index[v], ());
    }
    let mut group = vec![0; raw.len()];
    for (k, members) in tarjan_scc(&all).iter().enumerate() {
        members.iter().for_each(|n| group[n.index()] = k);
    }
    // Inside a loop, the links that are read late do not count.
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); raw.len()];
    let mut above = vec![0_usize; raw.len()];
    for (u, v, port, _) in edges() {
        if !(late(v, port) && group[u] == group[v]) {
            below[u].push(v);
            above[v] += 1;
        }
    }
    // Last in, first out keeps chains together, so that few buffers cross from one part to another.
    let mut ready: Vec<usize> = (0..raw.len()).rev().filter(|&n| above[n] == 0).collect();
    let mut order = Vec::with_capacity(raw.len());
    while let Some(n) = ready.pop() {
        order.push(n);
        for &v in below[n].iter().rev() {
            above[v] -= 1;
            if above[v] == 0 {
                ready.push(v);
            }
        }
    }
    if order.len() < raw.len() {
        report_loops(raw, &below, &above, links, found);
    }
    order
}

/// How often loops are looked for again without the links that close those already found.
const ROUNDS: usize = 20;

/// Prints loops, each once and whole: one of each knot, then those that do not need the link that closes it.
fn report_loops(
    raw: &[RawNode],
    below: &[Vec<usize>],
    above: &[usize],
    links: &[Vec<Vec<Link>>],
    found: &mut Vec<Diagnostic>,
) {
    let mut below = below.to_vec();
    for _ in 0..ROUNDS {
        let loops = loops(&below, above);
        if loops.is_empty() {
            return;
        }
        for path in loops {
            if let (Some(first), Some(closing)) = (path.first(), path.last()) {
                below[*closing].retain(|v| v != first);
            }
            found.push(loop_error(raw, links, &path));
        }
    }
}

/// One loop of each set of nodes that all reach each other: the shortest through its first node.
fn loops(below: &[Vec<usize>], above: &[usize]) -> Vec<Vec<usize>> {
    let mut graph = DiGraph::<usize, ()>::new();
    let index: BTreeMap<usize, _> =
        (0..above.len()).filter(|&n| above[n] > 0).map(|n| (n, graph.add_node(n))).collect();
    for (&n, &at) in &index {
        for to in below[n].iter().filter_map(|v| index.get(v)) {
            graph.update_edge(at, *to, ());
        }
    }
    let knots = tarjan_scc(&graph).into_iter().filter_map(|members| {
        let mut members: Vec<usize> = members.iter().map(|n| graph[*n]).collect();
        members.sort_unstable();
        let first = members[0];
        let knot = members.len() > 1 || below[first].contains(&first);
        knot.then(|| shortest_loop(first, below, &members))
    });
    knots.collect()
}

fn loop_error(raw: &[RawNode], links: &[Vec<Vec<Link>>], path: &[usize]) -> Diagnostic {
    let first = path[0];
    let names: Vec<&str> = path.iter().chain([&first]).map(|&n| raw[n].id.as_str()).collect();
    let closing = *path.last().unwrap_or(&first);
    let link = |to: usize, from: usize| links[to].iter().flatten().find(|l| l.node == from);
    let mut diagnostic = Diagnostic::error(
        "F025",
        format!("these nodes feed each other in a loop: {}", names.join(" -> ")),
        link(first, closing).map_or_else(|| raw[first].place.clone(), |l| l.place.clone()),
    )
    .node(&raw[first].id)
    .help("a loop has to go through a Feedback node, which says how long it takes");
    for pair in path.windows(2) {
        if let Some(link) = link(pair[1], pair[0]) {
            let text = format!("`{}` needs `{}`", raw[pair[1]].id, raw[pair[0]].id);
            diagnostic = diagnostic.label(link.place.clone(), text);
        }
    }
    diagnostic
}

/// The shortest way from a node back to itself inside a sorted set of nodes, without the closing step.
fn shortest_loop(first: usize, below: &[Vec<usize>], members: &[usize]) -> Vec<usize> {
    let mut from: HashMap<usize, usize> = HashMap::new();
    let mut queue = std::collections::VecDeque::from([first]);
    while let Some(n) = queue.pop_front() {
        for &v in below[n].iter().filter(|v| members.binary_search(v).is_ok()) {
            if v == first {
                let mut path = vec![n];
                let mut at = n;
                while at != first {
                    at = from[&at];
                    path.push(at);
                }
                path.reverse();
                return path;
            }
            if v != first && !from.contains_key(&v) {
                from.insert(v, n);
                queue.push_back(v);
            }
        }
    }
    vec![first]
}

/// Warns of nodes that no output file needs. Those of sub-graphs are on offer: who uses one may leave others alone.
fn unused(raw: &[RawNode], halves: &[Option<Half>], links: &[Vec<Vec<Link>>], found: &mut Vec<Diagnostic>) {
    let mut used = vec![false; raw.len()];
    let sink = |n: usize| halves[n].as_ref().is_none_or(|h| h.ty.outputs.is_empty());
    let mut stack: Vec<usize> = (0..raw.len()).filter(|&n| sink(n)).collect();
    // A graph that writes nothing at all is meant to be used by others.
    if stack.is_empty() {
        return;
    }
    while let Some(n) = stack.pop() {
        if !std::mem::replace(&mut used[n], true) {
            stack.extend(links[n].iter().flatten().map(|l| l.node));
        }
    }
    // What only folds a take is a report: it is there for taps.
    let folds = |ty: &NodeType| ty.outputs.iter().all(|o| matches!(o.kind, PortKind::Fold(_)));
    let tells = |n: usize| halves[n].as_ref().is_some_and(|h| folds(h.ty));
    let mut feeds = vec![false; raw.len()];
    links.iter().flatten().flatten().for_each(|l| feeds[l.node] = true);
    for (n, node) in raw.iter().enumerate() {
        if !used[n] && !feeds[n] && node.place.file == 0 && !tells(n) {
            let warning =
                Diagnostic::warning("F026", format!("nothing uses `{}`", node.id), node.place.clone());
            found.push(warning.node(&node.id).help("link it to a node that writes a file, or remove it"));
        }
    }
}
