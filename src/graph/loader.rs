//! Reads a graph file and its sub-graphs into one flat list of nodes, each with its origin.

use super::Graph;
use super::fixes;
use super::root::{Limits, Root, join};
use super::suggest::help;
use super::values::{Given, Origin, Override, Scope};
use crate::diag::{Diagnostic, Fix, SourceLocation, Sources};
use crate::lang::edit::quote;
use crate::lang::{self, Value, ValueKind};
use foley_nodes::core::files::FileError;
use foley_nodes::registry::Registry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// The schema that graph files of this version declare.
pub const SCHEMA: &str = "foley:graph/1";

/// A node as written in the text.
#[derive(Debug)]
pub struct RawNode {
    /// Its full id.
    pub id: String,
    /// Name of its type.
    pub type_name: String,
    /// Location of the type's name.
    pub type_location: SourceLocation,
    /// Location of its id.
    pub location: SourceLocation,
    /// End of its text in that file.
    pub end: usize,
    /// Its fields in order: name, location of the name, value.
    pub fields: Vec<(String, SourceLocation, Given)>,
    /// True if its text is complete enough to check.
    pub whole: bool,
    /// True for `None`, which removes the node of a graph that is extended.
    pub removes: bool,
}

/// Texts of graph files as they were first read: loads that share them do not read the files again, so that a half-done edit
/// on the disk stays where it is.
#[derive(Debug, Default)]
pub struct Texts(Mutex<BTreeMap<PathBuf, (PathBuf, String)>>);

impl Texts {
    /// Sets the text of a file that is not to be read from the disk, such as one with unsaved changes in an editor.
    ///
    /// `path` is the path as graphs resolve it: that of the graph, or the folder of the graph joined with the path in the text.
    pub fn set(&self, path: &Path, text: impl Into<String>) {
        let real = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        texts.insert(path.to_owned(), (real, text.into()));
    }

    /// The real path and the text of a file that was read before.
    pub(super) fn get(&self, path: &Path) -> Option<(PathBuf, String)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned()
    }

    /// Caches the text of a file.
    pub(super) fn insert(&self, path: &Path, real: &Path, text: &str) {
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        texts.entry(path.to_owned()).or_insert_with(|| (real.to_owned(), text.to_owned()));
    }
}

/// Settings for loading a graph.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LoadOptions {
    /// The node types that it can use.
    pub registry: Arc<Registry>,
    /// Values for its parameters and nodes; later ones win.
    pub overrides: Vec<Override>,
    /// Folder to which paths in `overrides` are relative; empty for the working folder.
    pub override_folder: PathBuf,
    /// Values that arrived in messages; they win over `overrides`, and name only files below the graph's own folder.
    pub messages: Vec<Override>,
    /// Folders outside its own that it may read.
    pub allow_read: Vec<PathBuf>,
    /// Limits on its files and its size.
    pub limits: Limits,
    /// Texts of its files from an earlier load.
    pub texts: Option<Arc<Texts>>,
}

impl Default for LoadOptions {
    /// The node types of `foley-nodes`, no overrides, the graph's own folder, the default limits.
    fn default() -> Self {
        static STANDARD: LazyLock<Arc<Registry>> = LazyLock::new(|| Arc::new(Registry::standard()));
        Self {
            registry: Arc::clone(&STANDARD),
            overrides: Vec::new(),
            override_folder: PathBuf::new(),
            messages: Vec::new(),
            allow_read: Vec::new(),
            limits: Limits::default(),
            texts: None,
        }
    }
}

impl LoadOptions {
    /// Sets the node types.
    #[must_use]
    pub fn registry(mut self, registry: Arc<Registry>) -> Self {
        self.registry = registry;
        self
    }

    /// Adds overrides.
    #[must_use]
    pub fn overrides(mut self, overrides: impl IntoIterator<Item = Override>) -> Self {
        self.overrides.extend(overrides);
        self
    }

    /// Adds values that arrived in messages.
    #[must_use]
    pub fn messages(mut self, messages: impl IntoIterator<Item = Override>) -> Self {
        self.messages.extend(messages);
        self
    }

    /// Adds a folder that may be read.
    #[must_use]
    pub fn allow_read(mut self, folder: impl Into<PathBuf>) -> Self {
        self.allow_read.push(folder.into());
        self
    }

    /// Sets the limits.
    #[must_use]
    pub fn limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self
    }
}

/// Result of loading: the graph, if there was no error, and all diagnostics.
#[derive(Debug)]
pub struct Loaded {
    /// The graph, if it can run.
    pub graph: Option<Graph>,
    /// Otherwise the valid nodes that read only valid nodes, in which further errors can be found in the same pass.
    pub sound: Option<Graph>,
    /// Errors and warnings.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts that they point into.
    pub sources: Sources,
    /// The files that the graph may read.
    pub root: Root,
}

/// One file of a graph that extends others: each adds to those before, and replaces their entries.
#[derive(Debug)]
pub(super) struct Layer {
    /// The file.
    pub file: usize,
    /// Folder to which its paths are relative.
    pub folder: PathBuf,
    fields: Vec<lang::ast::Field>,
}

impl Layer {
    /// The value of a field of the graph.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.fields.iter().find(|field| field.name.value == name).map(|field| &field.value)
    }
}

/// Everything read so far.
#[derive(Debug, Default)]
pub(super) struct Loader {
    pub registry: Arc<Registry>,
    pub title: Option<String>,
    pub seed: Option<u64>,
    pub nodes: Vec<RawNode>,
    pub found: Vec<Diagnostic>,
    pub sources: Sources,
    pub used_params: std::cell::RefCell<std::collections::BTreeSet<String>>,
    pub all_params: Vec<(String, SourceLocation)>,
    pub root: Root,
    /// Folder of the graph, as its paths begin.
    pub folder: PathBuf,
    pub limits: Limits,
    pub texts: Option<Arc<Texts>>,
    /// Number of uses of sub-graphs, and their size in bytes.
    pub uses: usize,
    pub text_bytes: u64,
    /// Locations of the uses of the sub-graphs that are being read, the innermost last.
    pub used_at: Vec<SourceLocation>,
    /// Number of uses of required parameters that are not set.
    pub missing: usize,
    /// Prefixes of the ids of unreadable sub-graphs.
    pub lost: Vec<String>,
    /// Prefixes of the ids of arrays of sub-graphs, and the number of items of each.
    pub arrays: BTreeMap<String, usize>,
    /// True if a limit was exceeded: it is reported once, and reading stops.
    pub full: bool,
}

/// The text of a graph file of at most `limit` bytes; `show` is its name for people.
///
/// # Errors
/// If it is missing, not a plain file, too large, or not UTF-8.
pub fn read_text(path: &Path, show: &str, limit: u64) -> Result<String, FileError> {
    let error = |code, message: String| FileError { code, message };
    let unreadable = |e: std::io::Error| {
        let code = if e.kind() == std::io::ErrorKind::NotFound { "F060" } else { "F061" };
        error(code, format!("cannot read {show}: {e}"))
    };
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if !meta.is_file() {
        return Err(error("F064", format!("{show} is not a plain file")));
    }
    if meta.len() > limit {
        let message = format!("{show} has {} bytes, a graph file at most {limit}", meta.len());
        return Err(error("F063", message));
    }
    let bytes = std::fs::read(path).map_err(unreadable)?;
    String::from_utf8(bytes).map_err(|e| {
        let message = format!("{show} is not UTF-8 from byte {} on", e.utf8_error().valid_up_to());
        error("F061", message)
    })
}

/// Returns true for a text that can be the id of a node: a letter or `_`, then letters, digits, `_` and `-`.
#[must_use]
pub fn valid_id(id: &str) -> bool {
    let start = id.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_');
    start && id.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-')
}

impl RawNode {
    /// Takes over the fields of this node in a file that extends this one.
    fn extend(&mut self, new: Self) {
        if new.type_name != self.type_name {
            *self = new;
            return;
        }
        self.whole &= new.whole;
        for field in new.fields {
            match self.fields.iter_mut().find(|(name, _, _)| *name == field.0) {
                Some(old) => *old = field,
                None => self.fields.push(field),
            }
        }
    }

    /// Location of its type and fields.
    pub fn body(&self) -> SourceLocation {
        let SourceLocation { file, span } = self.type_location.clone();
        SourceLocation { file, span: span.start..self.end }
    }
}

impl Loader {
    pub(super) fn new(path: &Path, options: &LoadOptions) -> Self {
        Self {
            registry: Arc::clone(&options.registry),
            root: Root::of(path),
            folder: path.parent().map(Path::to_owned).unwrap_or_default(),
            limits: options.limits,
            texts: options.texts.clone(),
            ..Self::default()
        }
    }

    /// Caches a text for the loads that share [`LoadOptions::texts`].
    pub(super) fn cache_text(&self, path: &Path, real: &Path, text: &str) {
        if let Some(texts) = &self.texts {
            texts.insert(path, real, text);
        }
    }

    pub(super) fn error(&mut self, code: &'static str, message: impl Into<String>, location: SourceLocation) {
        self.found.push(Diagnostic::error(code, message, location));
    }

    /// Reads one file below the id `prefix`, after the files that it extends; `given` are values for its parameters and nodes.
    pub(super) fn file(
        &mut self,
        name: &str,
        text: String,
        path: &Path,
        prefix: &str,
        given: Vec<(String, Given)>,
        chain: &mut Vec<PathBuf>,
    ) {
        let length = chain.len();
        let mut layers = Vec::new();
        self.layers(name, text, path, chain, &mut layers);
        chain.truncate(length);
        for layer in layers.iter().filter(|_| prefix.is_empty()) {
            self.header(layer.get("title"), layer.get("seed"), layer.file);
        }
        let (params, node_sets) = self.params(&layers, &given, prefix);
        let scope = Scope { prefix: prefix.to_owned(), params: Arc::new(params) };
        let uses = self.uses(&layers, &scope, &node_sets, chain);
        self.node_list(&layers, &scope, &node_sets, &uses);
    }

    /// Reads a file and those that it extends, which come first.
    fn layers(
        &mut self,
        name: &str,
        text: String,
        path: &Path,
        chain: &mut Vec<PathBuf>,
        layers: &mut Vec<Layer>,
    ) {
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let Some(layer) = self.layer(name, text, folder) else { return };
        if let Some(base) = layer.get("extends").filter(|base| !base.is_error()) {
            let location = SourceLocation { file: layer.file, span: base.span() };
            match base.as_str() {
                Some(base) => self.base(&join(&layer.folder, base), location, chain, layers),
                None => {
                    let message = format!("`extends` is the path of a graph, found {}", base.describe());
                    self.error("F008", message, location);
                }
            }
        }
        layers.push(layer);
    }

    /// Reads the graph that another one extends.
    fn base(
        &mut self,
        path: &str,
        location: SourceLocation,
        chain: &mut Vec<PathBuf>,
        layers: &mut Vec<Layer>,
    ) {
        if let Some((real, text)) = self.other(path, location, chain) {
            chain.push(real);
            self.layers(path, text, Path::new(path), chain, layers);
        }
    }

    /// Parses one file, and checks its fields.
    fn layer(&mut self, name: &str, text: String, folder: PathBuf) -> Option<Layer> {
        let parsed = lang::parse(&text);
        let file = self.sources.add(name, text);
        self.found.extend(parsed.errors().iter().map(|e| Diagnostic::of_syntax(e, file)));
        let document = parsed.document();
        let at = |span: std::ops::Range<usize>| SourceLocation { file, span };
        match document.attribute("schema") {
            Some(schema) if schema.value == SCHEMA => {}
            Some(schema) => {
                let message = format!("schema {:?} is not one that this version reads", schema.value);
                let found = Diagnostic::error("F003", message, at(schema.span()));
                self.found.push(
                    found
                        .help(format!("write #![schema = {SCHEMA:?}]"))
                        .fixes([fixes::write(&quote(SCHEMA), &at(schema.span()))]),
                );
            }
            None => {
                let warning = Diagnostic::warning("F003", "the file does not state its schema", at(0..0));
                let line = format!("#![schema = {SCHEMA:?}]");
                let fix = Fix::replace(format!("begin with {line}"), at(0..0), format!("{line}\n"));
                self.found.push(warning.help(format!("begin with {line}")).fixes([fix]));
            }
        }
        let value = document.value?;
        let fields = match value.as_struct() {
            Some((Some(name), fields)) if name.value == "Graph" => fields.to_vec(),
            _ => {
                if !value.is_error() {
                    let what = match value.as_struct() {
                        Some((Some(name), _)) => format!("{}(...)", name.value),
                        _ => value.describe().to_owned(),
                    };
                    let found = format!("expected Graph(...), found {what}");
                    self.error("F002", found, at(value.span()));
                }
                return None;
            }
        };
        let mut seen: BTreeMap<&str, SourceLocation> = BTreeMap::new();
        for field in &fields {
            let name = field.name.value.as_str();
            if let Some(first) = seen.get(name) {
                let found =
                    Diagnostic::error("F005", format!("`{name}` is given twice"), at(field.name.span()));
                self.found.push(found.label(first.clone(), "first here"));
                continue;
            }
            seen.insert(name, at(field.name.span()));
            let known = ["title", "seed", "extends", "params", "use", "nodes"];
            if !known.contains(&name) {
                let found = Diagnostic::error(
                    "F004",
                    format!("a graph has no field `{name}`"),
                    at(field.name.span()),
                );
                let fix = fixes::rename(name, known, &at(field.name.span()), str::to_owned);
                self.found.push(found.help(help(name, "fields", known)).fixes(fix));
            }
        }
        Some(Layer { file, folder, fields })
    }

    fn header(&mut self, title: Option<&Value>, seed: Option<&Value>, file: usize) {
        let at = |v: &Value| SourceLocation { file, span: v.span() };
        if let Some(v) = title.filter(|v| !v.is_error()) {
            match v.as_str() {
                Some(title) => self.title = Some(title.to_owned()),
                None => {
                    self.error("F008", format!("the title is text in quotes, found {}", v.describe()), at(v))
                }
            }
        }
        if let Some(v) = seed.filter(|v| !v.is_error()) {
            match v.as_int().and_then(|i| u64::try_from(i).ok()) {
                Some(seed) => self.seed = Some(seed),
                None => self.error(
                    "F008",
                    format!("the seed is a whole number from 0 on, found {}", v.describe()),
                    at(v),
                ),
            }
        }
    }

    /// The entries of a map field with text keys, in order; anything else is an error.
    pub(super) fn entries<'v>(
        &mut self,
        value: Option<&'v Value>,
        file: usize,
        what: &str,
    ) -> Vec<&'v lang::ast::Entry> {
        let Some(value) = value.filter(|v| !v.is_error()) else { return Vec::new() };
        let Some(map) = value.as_map() else {
            let message = format!("`{what}` is a map such as {{\"name\": ...}}, found {}", value.describe());
            self.error("F008", message, SourceLocation { file, span: value.span() });
            return Vec::new();
        };
        for entry in map.iter().filter(|e| e.key.as_str().is_none() && !e.key.is_error()) {
            let message = format!("names in `{what}` are text in quotes, found {}", entry.key.describe());
            self.error("F007", message, SourceLocation { file, span: entry.key.span() });
        }
        map.iter().filter(|e| e.key.as_str().is_some()).collect()
    }

    /// Reports an exceeded limit, and stops reading.
    pub(super) fn stop(&mut self, found: Diagnostic) {
        if !self.full {
            self.found.push(found);
        }
        self.full = true;
    }

    pub(super) fn bad_id(&mut self, id: &str, location: SourceLocation) {
        let found = Diagnostic::error("F007", format!("{id:?} cannot be an id"), location);
        self.found
            .push(found.help("an id starts with a letter and continues with letters, digits, `_` and `-`"));
    }

    fn node_list(&mut self, layers: &[Layer], scope: &Scope, sets: &[(String, Given)], uses: &[String]) {
        let start = self.nodes.len();
        for layer in layers {
            let before = self.nodes.len();
            if !self.layer_nodes(layer, scope, uses) {
                return;
            }
            self.merge_nodes(start, before);
        }
        for (target, value) in sets {
            let Some((id, param)) = target.split_once('.') else { continue };
            if uses.iter().any(|u| u == id) {
                continue;
            }
            match self.nodes[start..].iter_mut().find(|n| n.id == format!("{}{id}", scope.prefix)) {
                Some(node) => {
                    node.fields.retain(|(name, _, _)| name != param);
                    node.fields.push((param.to_owned(), value.location.clone(), value.clone()));
                }
                None => {
                    let names: Vec<String> = self.nodes[start..].iter().map(|n| n.id.clone()).collect();
                    let found = Diagnostic::error(
                        "F028",
                        format!("this graph has no node `{id}`"),
                        value.location.clone(),
                    );
                    self.found.push(found.help(help(id, "nodes", names.iter().map(String::as_str))));
                }
            }
        }
    }

    /// Adds the nodes of one file; returns false where there are too many.
    fn layer_nodes(&mut self, layer: &Layer, scope: &Scope, uses: &[String]) -> bool {
        let mut first: BTreeMap<String, SourceLocation> = BTreeMap::new();
        for entry in self.entries(layer.get("nodes"), layer.file, "nodes") {
            let Some(id) = entry.key.as_str() else { continue };
            let key = SourceLocation { file: layer.file, span: entry.key.span() };
            // A node whose id is wrong is checked like any other.
            if !valid_id(id) {
                self.bad_id(id, key.clone());
            } else if let Some(earlier) = first.get(id) {
                let found = Diagnostic::error("F006", format!("the id `{id}` exists twice"), key.clone());
                self.found.push(
                    found
                        .label(earlier.clone(), "first here")
                        .help("ids are the identity of nodes: give one of them another name"),
                );
            } else if uses.iter().any(|u| u == id) {
                self.error("F006", format!("`{id}` is the name of a sub-graph already"), key.clone());
            }
            first.entry(id.to_owned()).or_insert_with(|| key.clone());
            if self.nodes.len() >= self.limits.nodes {
                let found = Diagnostic::error("F009", format!("more than {} nodes", self.limits.nodes), key);
                self.stop(found.help("--max-nodes allows more"));
                return false;
            }
            self.node(id, key, &entry.value, layer, scope);
        }
        true
    }

    /// Merges the nodes from `new` on into those of the files that are extended, from `start` on: fields replace those of the
    /// same node, another type replaces the node, and `None` removes it.
    fn merge_nodes(&mut self, start: usize, new: usize) {
        if start == new {
            return;
        }
        let added = self.nodes.split_off(new);
        let place: HashMap<String, usize> =
            self.nodes[start..].iter().enumerate().map(|(k, n)| (n.id.clone(), start + k)).collect();
        let mut removed = BTreeSet::new();
        for node in added {
            match place.get(&node.id) {
                Some(&at) if node.removes => drop(removed.insert(at)),
                Some(&at) => self.nodes[at].extend(node),
                None => self.nodes.push(node),
            }
        }
        let mut at = 0;
        self.nodes.retain(|_| {
            at += 1;
            !removed.contains(&(at - 1))
        });
    }

    fn node(&mut self, id: &str, location: SourceLocation, value: &Value, layer: &Layer, scope: &Scope) {
        let file = layer.file;
        let at = |span: std::ops::Range<usize>| SourceLocation { file, span };
        let id = format!("{}{id}", scope.prefix);
        let (name, fields) = match value.as_struct() {
            Some((Some(name), fields)) => (name, fields),
            _ => {
                let removes = value.value == ValueKind::Option(None);
                let is_known = || self.nodes.iter().any(|node| node.id == id && node.location.file != file);
                if !(value.is_error() || removes && is_known()) {
                    let message =
                        format!("a node is NodeType(field: value, ...), found {}", value.describe());
                    self.found.push(Diagnostic::error("F010", message, at(value.span())).node(&id));
                }
                self.nodes.push(RawNode {
                    id,
                    type_name: String::new(),
                    type_location: at(value.span()),
                    location,
                    end: value.span().end,
                    fields: Vec::new(),
                    whole: false,
                    removes,
                });
                return;
            }
        };
        let mut whole = true;
        let mut seen: BTreeMap<&str, SourceLocation> = BTreeMap::new();
        let mut read = Vec::new();
        for field in fields {
            let field_name = field.name.value.as_str();
            let key = at(field.name.span());
            if let Some(first) = seen.get(field_name) {
                let found =
                    Diagnostic::error("F005", format!("`{field_name}` is given twice"), key).node(&id);
                self.found.push(found.label(first.clone(), "first here"));
                continue;
            }
            seen.insert(field_name, key.clone());
            whole &= !field.value.is_error();
            let given = Given {
                value: field.value.clone(),
                location: at(field.value.span()),
                folder: layer.folder.clone(),
                scope: scope.clone(),
                origin: Origin::Text,
            };
            read.push((field_name.to_owned(), key, given));
        }
        let (type_name, type_location) = (name.value.clone(), at(name.span()));
        let end = value.span().end;
        let removes = false;
        self.nodes.push(RawNode {
            id,
            type_name,
            type_location,
            location,
            end,
            fields: read,
            whole,
            removes,
        });
    }
}
