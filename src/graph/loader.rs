//! Reads a graph file and its sub-graphs into one flat list of nodes, each with its origin.

use super::Graph;
use super::fixes;
use super::limits::Limits;
use super::load_options::LoadOptions;
use super::raw_node::RawNode;
use super::root::{Root, join};
use super::suggest::help;
use super::texts::Texts;
use super::values::{Given, Scope};
use crate::diag::{Diagnostic, Fix, SourceLocation, Sources};
use crate::lang::edit::quote;
use crate::lang::{self, Value};
use foley_nodes::registry::Registry;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The schema that graph files of this version declare.
pub const SCHEMA: &str = "foley:graph/1";

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
}
