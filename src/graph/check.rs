//! Checks the nodes of the text.

use super::checked_node::{CheckedNode, RawLink};
use super::fixes::{self, placeholder};
use super::links::{feeders, link, links_of};
use super::loader::{Loaded, Loader};
use super::order::{order, unused};
use super::outputs;
use super::raw_node::RawNode;
use super::root::join;
use super::sound;
use super::suggest::{help, nearest, omitted};
use super::upgrade::{former_field, renamed_type};
use super::values::{Given, Origin};
use super::{Graph, GraphNode, Link};
use crate::diag::{Diagnostic, SourceLocation, any_error, sort};
use crate::lang::edit::quote;
use crate::lang::{Value, ValueKind};
use foley_nodes::core::params::{Datum, FieldError, Mismatch, ParamKind, ParamSpec};
use foley_nodes::core::ports::Arity;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Checks everything that was read.
pub(super) fn check(mut loader: Loader) -> Loaded {
    let raw = std::mem::take(&mut loader.nodes);
    let mut good = sound::readable(&raw, &loader.found);
    let mut checked: Vec<Option<CheckedNode>> = Vec::new();
    for (node, good) in raw.iter().zip(&mut good) {
        let (before, missing) = (loader.found.len(), loader.missing);
        checked.push(fields(node, &mut loader));
        let own = loader.found[before..].iter_mut().filter(|d| d.node.is_none());
        own.for_each(|d| d.node = Some(node.id.clone()));
        let linked = checked.last().is_some_and(|c| c.as_ref().is_none_or(|c| c.unlinked.is_empty()));
        *good &= linked && loader.found.len() == before && loader.missing == missing;
    }
    let mut found = std::mem::take(&mut loader.found);
    // An id refers to the first of several nodes with it, so that the others are reported once.
    let by_id: HashMap<&str, usize> = raw.iter().enumerate().rev().map(|(k, n)| (n.id.as_str(), k)).collect();
    let mut links: Vec<Vec<Vec<Link>>> = Vec::new();
    let mut count = 0;
    for (k, checked_node) in checked.iter().enumerate() {
        let Some(checked_node) = checked_node else {
            links.push(Vec::new());
            continue;
        };
        found.extend(checked_node.unlinked.iter().map(|&port| unlinked(k, port, &raw, &checked, &loader)));
        let per_port = checked_node.ty.inputs.iter().zip(&checked_node.links).map(|(spec, texts)| {
            let one = |text: &RawLink| match link(
                text,
                (spec, &raw[k].location),
                &raw,
                &checked,
                &by_id,
                &loader,
            ) {
                Ok(link) => link,
                Err(diagnostic) => {
                    let value = (checked_node.ty.params)().into_iter().find(|param| param.name == spec.name);
                    let value = value.and_then(|param| interpret(&text.text, &param)).map(|(value, _)| value);
                    let fix = value.map(|value| fixes::write(&value, &text.location));
                    found.push(diagnostic.node(&raw[k].id).fixes(fix));
                    good[k] = false;
                    None
                }
            };
            texts.iter().filter_map(one).collect()
        });
        let resolved: Vec<Vec<Link>> = per_port.collect();
        let all = checked_node.links.iter().map(Vec::len).sum::<usize>();
        good[k] &= resolved.iter().map(Vec::len).sum::<usize>() == all;
        links.push(resolved);
        count += all;
    }
    if count > loader.limits.links {
        let message = format!("more than {} links", loader.limits.links);
        found.push(Diagnostic::general("F009", message).help("--max-links allows more"));
        good.fill(false);
    }
    outputs::check(&raw, &checked, &mut found);
    let order = order(&raw, &checked, &links, &mut found);
    // An error can be the reason why something seems to be unused.
    if !any_error(&found) {
        unused(&raw, &checked, &links, &mut found);
        found.extend(loader.unused_params());
    }
    let sources = std::mem::take(&mut loader.sources);
    sort(&mut found, &sources);
    let root = std::mem::take(&mut loader.root);
    if raw.is_empty() && !any_error(&found) {
        found.push(Diagnostic::warning("F026", "the graph has no nodes", SourceLocation::default()));
    }
    let mut nodes = Vec::new();
    for (((raw, checked_node), links), good) in raw.into_iter().zip(checked).zip(links).zip(good) {
        nodes.push(match checked_node {
            Some(CheckedNode { ty, params: Some(params), fields, .. }) if good => {
                Some(GraphNode { id: raw.id, ty, params, links, location: raw.location, fields, whole: true })
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
fn fields(node: &RawNode, loader: &mut Loader) -> Option<CheckedNode> {
    if node.type_name.is_empty() {
        return None;
    }
    let error = |code, message: String, location: &SourceLocation| {
        Diagnostic::error(code, message, location.clone()).node(&node.id)
    };
    let Some(ty) = loader.registry.get(&node.type_name).map(Arc::clone) else {
        if let Some(feature) = loader.registry.omitted(&node.type_name) {
            let [message, help] = omitted(&node.type_name, feature);
            loader.found.push(error("F010", message, &node.type_location).help(help));
            return None;
        }
        let near = nearest(&node.type_name, loader.registry.types().iter().map(|ty| ty.name));
        let hint = near.map(|name| format!("did you mean `{name}`? ")).unwrap_or_default();
        let message = format!("there is no node type `{}`", node.type_name);
        let found = error("F010", message, &node.type_location);
        let former = renamed_type(&node.type_name);
        let fix = former.or(near).map(|name| fixes::write(name, &node.type_location));
        let help = match former {
            Some(new) => format!("it is `{new}` now; `foley upgrade` changes it"),
            None => format!("{hint}`foley nodes` lists all node types"),
        };
        loader.found.push(found.help(help).fixes(fix));
        return None;
    };
    let specs = (ty.params)();
    let mut checked_node = CheckedNode {
        ty: Arc::clone(&ty),
        params: None,
        links: ty.inputs.iter().map(|_| Vec::new()).collect(),
        unlinked: Vec::new(),
        outputs: Vec::new(),
        fields: BTreeMap::new(),
        uses: BTreeMap::new(),
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
            let names: Vec<&str> = ty.inputs.iter().map(|p| p.name).chain(only).collect();
            let message = format!("{} has no input or parameter `{name}`", ty.name);
            let fix = fixes::rename(name, names.iter().copied(), key, str::to_owned);
            let help = match former_field(ty.name, name) {
                Some(advice) => format!("it is gone: {advice}; `foley upgrade` removes it"),
                None => help(name, "fields", names),
            };
            loader.found.push(error("F011", message, key).help(help).fixes(fix));
            continue;
        }
        let location = given.location.clone();
        let Some(given) = loader.resolve(given.clone()) else {
            broken.push(name);
            if let Some(port) = port {
                linked[port] = true;
            }
            continue;
        };
        // An error in a value belongs to whoever wrote the value.
        if given.location != location {
            checked_node.uses.insert(name.clone(), location);
        }
        item_locations(name, &given.value, given.location.file, &mut checked_node.fields);
        checked_node.fields.insert(name.clone(), given.location.clone());
        // A list is of links, unless it is one of numbers for a parameter of the same name.
        let is_link = |v: &Value, spec: &ParamSpec| match v.value {
            ValueKind::Str(_) | ValueKind::Option(None) => true,
            ValueKind::List(_) => !matches!(spec.kind, ParamKind::List(..)),
            _ => false,
        };
        match (port, param) {
            (Some(port), None) => {
                linked[port] = true;
                checked_node.set_links(port, links_of(&given, &ty.inputs[port], node, loader));
            }
            (Some(port), Some(spec)) if is_link(&given.value, spec) => {
                checked_node.set_links(port, links_of(&given, &ty.inputs[port], node, loader));
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
            checked_node.unlinked.push(k);
        }
    }
    match (ty.read)(&|name| data.get(name).cloned()) {
        Ok(params) => {
            checked_node.outputs = outputs::written(&ty, &*params).collect();
            checked_node.params = Some(params);
        }
        Err(errors) => {
            let text = |spec: &ParamSpec| match data.get(spec.name) {
                Some(Datum::Text(path)) => Some((spec.name, path.clone())),
                _ => None,
            };
            let output = |spec: &&ParamSpec| *spec.kind.innermost() == ParamKind::Output;
            checked_node.outputs = specs.iter().filter(output).filter_map(text).collect();
            missing_assets(&specs, &data, &checked_node.fields, node, loader);
            for e in errors {
                match &e {
                    FieldError::Missing(name) | FieldError::Value(name, _) if broken.contains(name) => {}
                    FieldError::Missing(_) if !node.whole => {}
                    FieldError::Missing(name) => {
                        let spec = specs.iter().find(|s| s.name == *name);
                        let kind = spec.map(|s| s.kind.to_string()).unwrap_or_default();
                        let message = format!("parameter `{name}` ({kind}) is required");
                        let fix = spec.map(|s| fixes::set_field(&node.body(), name, &placeholder(s)));
                        loader.found.push(error("F013", message, &node.location).fixes(fix));
                    }
                    FieldError::Value(name, mismatch) => {
                        let spec = specs.iter().find(|s| s.name == *name);
                        let location = checked_node.fields.get(*name).unwrap_or(&node.location);
                        for (item, mismatch) in mismatch.each() {
                            let name = format!("{name}{item}");
                            let location = checked_node.fields.get(&name).unwrap_or(location).clone();
                            let mut found = mismatched(&name, mismatch, spec, location).node(&node.id);
                            if let Some(used) = checked_node.uses.get(spec.map_or("", |s| s.name)) {
                                found = found.label(used.clone(), "the value is used here");
                            }
                            loader.found.push(found);
                        }
                    }
                }
            }
        }
    }
    Some(checked_node)
}

/// An input that needs a link and has none, with the nodes of the same graph that could be linked to it: those nearest above it first.
fn unlinked(
    at: usize,
    port: usize,
    raw: &[RawNode],
    checked: &[Option<CheckedNode>],
    loader: &Loader,
) -> Diagnostic {
    let node = &raw[at];
    let inputs = checked[at].as_ref().map_or(&[][..], |node| node.ty.inputs);
    let Some(spec) = inputs.get(port) else {
        return Diagnostic::general("F099", "an input that does not exist: a defect in foley");
    };
    let message = format!("input `{}` ({} of {}) has no link", spec.name, spec.kind.word(), spec.kind.name());
    let feeders = feeders(spec, &loader.registry);
    let scope = node.id.rfind('.').map_or("", |end| &node.id[..=end]);
    let above = (0..at).rev().chain(at + 1..raw.len());
    let outputs = above.filter_map(|k| {
        let id = raw[k].id.strip_prefix(scope).filter(|id| !id.contains('.'))?;
        let outputs = checked[k].as_ref()?.ty.outputs;
        let fits = outputs.iter().find(|output| output.kind.feeds(&spec.kind))?;
        Some(if outputs.len() == 1 { id.to_owned() } else { format!("{id}.{}", fits.name) })
    });
    let value = |link: String| match spec.arity {
        Arity::Many => format!("[{}]", quote(&link)),
        Arity::One | Arity::Optional => quote(&link),
    };
    let fixes = outputs.take(MAX_LINKS).map(|link| fixes::set_field(&node.body(), spec.name, &value(link)));
    Diagnostic::error("F012", message, node.location.clone())
        .node(&node.id)
        .help(format!("link it to a node that gives {}: {feeders}", spec.kind.name()))
        .fixes(fixes)
}

/// Maximum number of nodes that are offered for an input without a link.
const MAX_LINKS: usize = 4;

/// The value as a parameter reads it; paths are made relative to the working folder.
fn datum(given: &Given, spec: &ParamSpec, loader: &mut Loader) -> Option<Datum> {
    let path = matches!(spec.kind.innermost(), ParamKind::Asset | ParamKind::Folder);
    let value = bare_text(given, &spec.kind, loader).unwrap_or_else(|| given.value.clone());
    convert(&value, given, path, loader)
}

/// Text or path from the command line, as typed: it needs no quotes there.
fn bare_text(given: &Given, kind: &ParamKind, loader: &Loader) -> Option<Value> {
    let text = loader.argument(given)?;
    let quoted = matches!(given.value.value, ValueKind::Str(_));
    let kind = match (kind, &given.value.value) {
        (ParamKind::Maybe(_), ValueKind::Option(_)) => return None,
        (ParamKind::Maybe(inner), _) => *inner,
        (kind, _) => kind,
    };
    let takes = matches!(kind, ParamKind::Text | ParamKind::Asset | ParamKind::Folder | ParamKind::Output);
    let value = || Value { span: given.location.span.clone(), value: ValueKind::Str(text.to_owned()) };
    (takes && !quoted).then(value)
}

fn convert(value: &Value, given: &Given, path: bool, loader: &mut Loader) -> Option<Datum> {
    let list = |items: &[Value], loader: &mut Loader| {
        let mut one = |item| {
            let inner = loader.resolve(given.inside(item))?;
            convert(&inner.value, &inner, path, loader)
        };
        // All of them first, so that each reports its errors.
        let items: Vec<Option<Datum>> = items.iter().map(&mut one).collect();
        items.into_iter().collect::<Option<Vec<Datum>>>().map(Datum::List)
    };
    Some(match &value.value {
        ValueKind::Unit => Datum::Unit,
        ValueKind::Bool(b) => Datum::Bool(*b),
        ValueKind::Char(c) => Datum::Text(c.to_string()),
        ValueKind::Int(i) => i64::try_from(*i).map_or_else(|_| Datum::Float(*i as f64), Datum::Int),
        ValueKind::Float(x) => Datum::Float(*x),
        ValueKind::Str(text) if path => Datum::Text(asset(text, given, loader)?),
        ValueKind::Str(text) => Datum::Text(text.clone()),
        ValueKind::List(items) | ValueKind::Tuple(items) => return list(items, loader),
        ValueKind::Name(name) => Datum::Name(name.value.clone()),
        ValueKind::Option(None) => Datum::Name("None".into()),
        ValueKind::Option(Some(inner)) => {
            let inner = loader.resolve(given.inside(inner))?;
            if matches!(inner.value.value, ValueKind::Option(_)) {
                return Some(Datum::Other(format!("{} in `Some`", inner.value.describe())));
            }
            return convert(&inner.value, &inner, path, loader);
        }
        ValueKind::Error => return None,
        _ => Datum::Other(value.describe().to_owned()),
    })
}

/// The path of an asset; `None` if its origin may not name it. A path from the command line may be read anywhere, and `~` at its start is the
/// home of the user; one of a message only below the folder of the graph.
fn asset(text: &str, given: &Given, loader: &mut Loader) -> Option<String> {
    match given.origin {
        Origin::CommandLine => {
            let joined = join(&given.folder, &in_home(text));
            loader.root.allow_named(Path::new(&joined));
            Some(joined)
        }
        Origin::Message => {
            let joined = join(&given.folder, text);
            if Path::new(text).is_absolute() || !loader.root.own_folder_holds(&given.folder, &joined) {
                let message =
                    format!("a message may not name {text:?}, which lies outside the folder of the graph");
                let found = Diagnostic::error("F062", message, given.location.clone());
                let help = "copy the file beside the graph, or name it by --set when foley starts";
                loader.found.push(found.help(help));
                return None;
            }
            Some(joined)
        }
        Origin::Text => Some(join(&given.folder, text)),
    }
}

/// A path whose first part is `~` in the home of the user; shells replace it at the start of a word only, and not in `--set in.path=~/a.wav`.
fn in_home(text: &str) -> String {
    let below = text.strip_prefix('~').filter(|rest| rest.is_empty() || rest.starts_with('/'));
    match below.zip(std::env::home_dir().as_deref().and_then(Path::to_str)) {
        Some((below, home)) => format!("{home}{below}"),
        None => text.to_owned(),
    }
}

/// Locations of the items of a list, and of nested lists: `inputs[2]`.
fn item_locations(name: &str, list: &Value, file: usize, locations: &mut BTreeMap<String, SourceLocation>) {
    let (ValueKind::List(items) | ValueKind::Tuple(items)) = &list.value else { return };
    for (k, item) in items.iter().enumerate() {
        let name = format!("{name}[{k}]");
        item_locations(&name, item, file, locations);
        locations.insert(name, SourceLocation { file, span: item.span() });
    }
}

/// Files that do not exist, named by a node that cannot open them itself since other fields of it are wrong.
fn missing_assets(
    specs: &[ParamSpec],
    data: &BTreeMap<&str, Datum>,
    fields: &BTreeMap<String, SourceLocation>,
    node: &RawNode,
    loader: &mut Loader,
) {
    for spec in specs.iter().filter(|spec| *spec.kind.innermost() == ParamKind::Asset) {
        let paths = match data.get(spec.name) {
            Some(Datum::List(items)) => {
                items.iter().enumerate().map(|(k, d)| (format!("[{k}]"), d)).collect()
            }
            Some(one) => vec![(String::new(), one)],
            None => Vec::new(),
        };
        for (item, path) in paths {
            // A numbered sequence is more than one file.
            let Datum::Text(path) = path else { continue };
            if path.contains('#') {
                continue;
            }
            if let Err(e) = loader.root.resolve(path) {
                let whole = fields.get(spec.name).unwrap_or(&node.location);
                let location = fields.get(&format!("{}{item}", spec.name)).unwrap_or(whole);
                loader.found.push(Diagnostic::error(e.code, e.message, location.clone()).node(&node.id));
            }
        }
    }
}

/// Bytes of a text that may begin with a number.
const MAX_NUMBER: usize = 32;

/// Interprets a text in place of a number, a rate or a choice: `"48 kHz"` is 48000.
///
/// Returns the value, and the text that explains it.
fn interpret(text: &str, spec: &ParamSpec) -> Option<(String, String)> {
    let unit = match spec.kind.innermost() {
        ParamKind::Choice(choices) => {
            let (name, _) = choices.iter().find(|(name, _)| name.eq_ignore_ascii_case(text))?;
            return Some(((*name).to_owned(), format!("{name}, without quotes")));
        }
        ParamKind::Rate => "Hz",
        ParamKind::Int | ParamKind::Float => spec.unit.unwrap_or_default(),
        _ => return None,
    };
    let ends = (1..=text.len().min(MAX_NUMBER)).rev().filter(|end| text.is_char_boundary(*end));
    let number = |end: usize| text[..end].trim_end().parse::<f64>().ok().filter(|x| x.is_finite());
    let (end, number) = ends.into_iter().find_map(|end| Some((end, number(end)?)))?;
    let written = text[end..].trim();
    let prefix = if written.is_empty() { "" } else { written.strip_suffix(unit)? };
    let factor = match prefix {
        _ if prefix.is_empty() || unit.is_empty() => 1.0,
        "M" => 1e6,
        "k" => 1e3,
        "c" => 1e-2,
        "m" => 1e-3,
        "u" | "µ" => 1e-6,
        _ => return None,
    };
    // Without the last digits, which the product of decimals leaves.
    let value: f64 = format!("{:.12e}", factor * number).parse().ok()?;
    let unit = if unit.is_empty() { String::new() } else { format!("; the unit is {unit}") };
    Some((value.to_string(), format!("{value}, without quotes{unit}")))
}

/// Error for a value that a parameter, or the item `name` of it, does not accept.
fn mismatched(
    name: &str,
    mismatch: &Mismatch,
    spec: Option<&ParamSpec>,
    location: SourceLocation,
) -> Diagnostic {
    let unit = spec.and_then(|s| s.unit).filter(|unit| !unit.is_empty());
    let unit = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
    match mismatch {
        Mismatch::Type { expected, found } => {
            let message = format!("`{name}` takes {expected}, found {found}");
            let error = Diagnostic::error("F014", message, location.clone());
            let text = found.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
            match text.zip(spec).and_then(|(text, spec)| interpret(text, spec)) {
                Some((value, meant)) => error.help(meant).fixes([fixes::write(&value, &location)]),
                None => error,
            }
        }
        Mismatch::Range { found, bounds } => {
            let message = format!("`{name}` is {found}{unit}, out of its range");
            let help = format!("from {} to {}{unit}", bounds.min, bounds.max);
            let fix = fixes::clamp(*found, *bounds, &location);
            Diagnostic::error("F015", message, location).help(help).fixes([fix])
        }
        Mismatch::NotFinite { found } => {
            Diagnostic::error("F016", format!("`{name}` is {found}, which is not a finite number"), location)
        }
        Mismatch::Choice { found, choices } => {
            let names = choices.iter().map(|(n, _)| *n);
            let fixes = fixes::choices(found, choices, &location);
            Diagnostic::error("F017", format!("`{name}` has no choice `{found}`"), location)
                .help(help(found, "choices", names))
                .fixes(fixes)
        }
        Mismatch::Items(_) => Diagnostic::error("F014", format!("`{name}` has wrong items"), location),
    }
}
