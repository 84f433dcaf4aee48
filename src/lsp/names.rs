//! Names in the texts of graphs, and their referents: nodes, sub-graphs, parameters and files.

use super::file::{NodeText, TextFile};
use super::workspace::{Workspace, beside};
use crate::lang::{Span, Value};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{ParamKind, ParamSpec};
use foley_nodes::core::ports::PortSpec;
use foley_nodes::registry::Registry;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum depth of sub-graphs that are followed.
const MAX_DEPTH: usize = 16;

/// Referent of a name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// A node: its file and its id in it.
    Node(PathBuf, String),
    /// A sub-graph that a file uses: the file and the name.
    Use(PathBuf, String),
    /// A parameter of a graph: its file and its name.
    Param(PathBuf, String),
    /// An output of a node: the file and the id of the node, and the port.
    Port(PathBuf, String, String),
    /// A file.
    File(PathBuf),
}

/// A name in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// Its location, without quotes.
    pub span: Span,
    /// Its referent.
    pub target: Target,
    /// True where it is declared.
    pub declares: bool,
}

/// Finds the names of one file.
struct Names<'a> {
    workspace: &'a Workspace,
    registry: &'a Registry,
    path: &'a Path,
    file: &'a TextFile,
    /// The file and those that it extends.
    layers: Vec<(PathBuf, Arc<TextFile>)>,
    found: Vec<Occurrence>,
}

/// All names in the text of a graph, in the order of the text.
///
/// # Complexity
/// Linear in the text, and in those of the sub-graphs that it names.
#[must_use]
pub fn names(workspace: &Workspace, registry: &Registry, path: &Path, file: &TextFile) -> Vec<Occurrence> {
    let layers = workspace.layers(path);
    let mut names = Names { workspace, registry, path, file, layers, found: Vec::new() };
    names.graph();
    names.found.sort_by_key(|occurrence| occurrence.span.start);
    names.found
}

/// The name at an offset of a text.
#[must_use]
pub fn name_at(
    workspace: &Workspace,
    registry: &Registry,
    (path, file): (&Path, &TextFile),
    offset: usize,
) -> Option<Occurrence> {
    let all = names(workspace, registry, path, file);
    all.into_iter().find(|name| name.span.start <= offset && offset <= name.span.end)
}

/// All locations in the graphs of the workspace that name a target.
#[must_use]
pub fn occurrences(
    workspace: &Workspace,
    registry: &Registry,
    target: &Target,
) -> Vec<(PathBuf, Occurrence)> {
    let graphs = workspace.graphs().into_iter();
    let all = graphs.flat_map(|(path, file)| {
        let found = names(workspace, registry, &path, &file);
        found.into_iter().map(move |occurrence| (path.clone(), occurrence))
    });
    all.filter(|(_, occurrence)| occurrence.target == *target).collect()
}

/// The type of a node, if its name is one.
#[must_use]
pub fn type_of<'r>(registry: &'r Registry, node: &NodeText<'_>) -> Option<&'r Arc<NodeType>> {
    registry.get(&node.ty.value)
}

/// The input of a type that a field is, and the parameter that it is.
#[must_use]
pub fn field_of(ty: &NodeType, name: &str) -> (Option<&'static PortSpec>, Option<ParamSpec>) {
    let port = ty.inputs.iter().find(|port| port.name == name);
    (port, (ty.params)().into_iter().find(|spec| spec.name == name))
}

/// A node that a link names, as seen from a file.
#[derive(Clone, Debug)]
pub struct Linked {
    /// The file of the node.
    pub path: PathBuf,
    /// The text of that file.
    pub file: Arc<TextFile>,
    /// The id of the node in that file.
    pub id: String,
    /// The port that the link names.
    pub port: Option<String>,
}

/// The graph that declares something: of a graph and those that it extends, the last that has it.
fn owner(layers: &[(PathBuf, Arc<TextFile>)], path: &Path, has: impl Fn(&TextFile) -> bool) -> PathBuf {
    layers.iter().rfind(|(_, file)| has(file)).map_or_else(|| path.to_owned(), |(path, _)| path.clone())
}

/// Follows a link from a file to the node that it names.
#[must_use]
pub fn follow(workspace: &Workspace, path: &Path, text: &str) -> Option<Linked> {
    let (mut path, mut rest) = (path.to_owned(), text);
    for _ in 0..MAX_DEPTH {
        let (first, tail) = rest.split_once('.').map_or((rest, None), |(first, tail)| (first, Some(tail)));
        let layers = workspace.layers(&path);
        let used = layers.iter().find_map(|(path, file)| Some((path, file.use_of(first)?)));
        match used.and_then(|(path, used)| Some((beside(path, used.path.as_str()?), used.rest(tail?)))) {
            Some((inner, tail)) => {
                path = inner;
                rest = tail;
            }
            None if used.is_some() => return None,
            None => {
                // What the node is stands in the first file that names its type.
                let node = |(_, file): &&(PathBuf, Arc<TextFile>)| file.node(first).is_some();
                let entry = |(_, file): &&(PathBuf, Arc<TextFile>)| file.node_entry(first).is_some();
                let (path, file) = layers.iter().find(node).or_else(|| layers.iter().find(entry))?.clone();
                let (id, port) = (first.to_owned(), tail.map(str::to_owned));
                return Some(Linked { path, file, id, port });
            }
        }
    }
    None
}

impl Names<'_> {
    fn add(&mut self, span: Span, target: Target, declares: bool) {
        self.found.push(Occurrence { span, target, declares });
    }

    /// The span of the text in quotes, if it has no escapes.
    fn inside(&self, value: &Value) -> Option<Span> {
        let (start, end) = (value.span.start + 1, value.span.end.checked_sub(1)?);
        (self.file.text.get(start..end)? == value.as_str()?).then_some(start..end)
    }

    fn graph(&mut self) {
        let (file, path) = (self.file, self.path.to_owned());
        if let Some(base) = file.extends()
            && let Some((span, named)) = self.inside(base).zip(base.as_str())
        {
            self.add(span, Target::File(beside(&path, named)), false);
        }
        let links = self.link_params(&path, file, 0);
        for entry in file.entries("params") {
            if let Some((span, name)) = self.inside(&entry.key).zip(entry.key.as_str()) {
                let owner = owner(&self.layers, &path, |file| file.param(name).is_some());
                let declares = owner == path;
                self.add(span, Target::Param(owner, name.to_owned()), declares);
                self.strings(&entry.value, links.contains(name));
            }
        }
        for used in file.uses() {
            if let Some(span) = self.inside(&used.entry.key) {
                let owner = owner(&self.layers, &path, |file| file.use_of(used.name).is_some());
                let declares = owner == path;
                self.add(span, Target::Use(owner, used.name.to_owned()), declares);
            }
            let Some(named) = used.path.as_str() else { continue };
            let inner = beside(&path, named);
            if let Some(span) = self.inside(used.path) {
                self.add(span, Target::File(inner.clone()), false);
            }
            let inner_file = self.workspace.file(&inner);
            let links = inner_file.as_ref().map(|file| self.link_params(&inner, file, 1)).unwrap_or_default();
            for entry in used.params() {
                let Some((span, name)) = self.inside(&entry.key).zip(entry.key.as_str()) else { continue };
                match name.split_once('.') {
                    None => self.add(span, Target::Param(inner.clone(), name.to_owned()), false),
                    Some(_) => self.path(&inner, name, span.start),
                }
                self.strings(&entry.value, links.contains(name));
            }
        }
        for node in file.nodes() {
            if let Some(span) = self.inside(&node.entry.key) {
                let owner = owner(&self.layers, &path, |file| file.node_entry(node.id).is_some());
                let declares = owner == path;
                self.add(span, Target::Node(owner, node.id.to_owned()), declares);
            }
            let ty = type_of(self.registry, &node);
            for field in node.fields {
                let is_input =
                    ty.is_some_and(|ty| ty.inputs.iter().any(|port| port.name == field.name.value));
                self.strings(&field.value, is_input);
                let spec = ty.and_then(|ty| field_of(ty, &field.name.value).1);
                if let Some(spec) = spec.filter(|_| !is_input) {
                    self.files(&field.value, &spec);
                }
            }
        }
    }

    /// The names in the strings of a value: parameters, and links if it is an input.
    fn strings(&mut self, value: &Value, links: bool) {
        value.walk(&mut |value| {
            let Some((span, text)) = self.inside(value).zip(value.as_str()) else { return };
            match text.strip_prefix('$') {
                Some(name) if !name.starts_with('$') => {
                    let owner = owner(&self.layers, self.path, |file| file.param(name).is_some());
                    let target = Target::Param(owner, name.to_owned());
                    self.add(span.start + 1..span.end, target, false);
                }
                None if links => self.path(self.path, text, span.start),
                _ => {}
            }
        });
    }

    /// The names in a link or in the name of a node's parameter, from a file on.
    fn path(&mut self, from: &Path, text: &str, start: usize) {
        let (mut path, mut at) = (from.to_owned(), 0);
        for _ in 0..MAX_DEPTH {
            let layers = self.workspace.layers(&path);
            let rest = &text[at..];
            let first = rest.split('.').next().unwrap_or(rest);
            let span = start + at..start + at + first.len();
            let next = at + first.len() + 1;
            let used = layers.iter().find_map(|(path, file)| Some((path, file.use_of(first)?)));
            if let Some((user, used)) = used {
                let of = owner(&layers, &path, |file| file.use_of(first).is_some());
                self.add(span, Target::Use(of, first.to_owned()), false);
                let Some(named) = used.path.as_str() else { return };
                let tail = text.get(next..).unwrap_or_default();
                at = next + tail.len() - used.rest(tail).len();
                path = beside(user, named);
                if at >= text.len() {
                    return;
                }
            } else {
                let path = owner(&layers, &path, |file| file.node_entry(first).is_some());
                self.add(span, Target::Node(path.clone(), first.to_owned()), false);
                if let Some(port) = text.get(next..) {
                    let target = Target::Port(path, first.to_owned(), port.to_owned());
                    self.add(start + next..start + text.len(), target, false);
                }
                return;
            }
        }
    }

    /// The files that a parameter names.
    fn files(&mut self, value: &Value, spec: &ParamSpec) {
        if !matches!(spec.kind.innermost(), ParamKind::Asset | ParamKind::Folder) {
            return;
        }
        value.walk(&mut |value| {
            let Some((span, text)) = self.inside(value).zip(value.as_str()) else { return };
            if !text.starts_with('$') && !text.contains('#') && !text.is_empty() {
                self.add(span, Target::File(beside(self.path, text)), false);
            }
        });
    }

    /// The parameters of a graph whose values are links.
    fn link_params(&self, path: &Path, file: &TextFile, depth: usize) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        let mut used = |value: &Value| {
            value.walk(&mut |value| {
                let name = value.as_str().and_then(|text| text.strip_prefix('$'));
                found.extend(name.map(str::to_owned));
            });
        };
        for node in file.nodes() {
            let Some(ty) = type_of(self.registry, &node) else { continue };
            let inputs = node.fields.iter().filter(|f| ty.inputs.iter().any(|p| p.name == f.name.value));
            inputs.for_each(|field| used(&field.value));
        }
        if depth < 4 && file.uses().any(|used| used.params().next().is_some()) {
            for sub in file.uses() {
                let Some(inner) = sub.path.as_str().map(|named| beside(path, named)) else { continue };
                let Some(inner_file) = self.workspace.file(&inner) else { continue };
                let links = self.link_params(&inner, &inner_file, depth + 1);
                let linked = sub.params().filter(|e| e.key.as_str().is_some_and(|k| links.contains(k)));
                linked.for_each(|entry| used(&entry.value));
            }
        }
        found
    }
}
