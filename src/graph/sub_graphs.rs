//! The sub-graphs that a graph file uses.

use super::loader::{Layer, Loader};
use super::raw_node::valid_id;
use super::root::join;
use super::texts::read_text;
use super::values::{Given, Origin, Scope};
use crate::diag::{Diagnostic, SourceLocation, any_error};
use crate::lang::{self, Value, ValueKind};
use std::path::{Path, PathBuf};

impl Loader {
    /// Reads the sub-graphs; returns their names. A sub-graph of a file replaces that of the same name of the files that it extends.
    pub(super) fn uses(
        &mut self,
        layers: &[Layer],
        scope: &Scope,
        sets: &[(String, Given)],
        chain: &mut Vec<PathBuf>,
    ) -> Vec<String> {
        let (mut names, start) = (Vec::new(), self.found.len());
        let mut entries: Vec<(&Layer, &lang::ast::Entry)> = Vec::new();
        for layer in layers {
            let own = entries.len();
            for entry in self.entries(layer.get("use"), layer.file, "use") {
                let Some(name) = entry.key.as_str() else { continue };
                let key = SourceLocation { file: layer.file, span: entry.key.span() };
                let earlier = entries.iter().position(|(_, e)| e.key.as_str() == Some(name));
                match earlier {
                    _ if !valid_id(name) => self.bad_id(name, key),
                    Some(at) if at >= own => {
                        self.error("F006", format!("sub-graph `{name}` exists twice"), key)
                    }
                    Some(at) => entries[at] = (layer, entry),
                    None => entries.push((layer, entry)),
                }
            }
        }
        for (Layer { file, folder, .. }, entry) in entries {
            let (file, name) = (*file, entry.key.as_str().unwrap_or_default());
            names.push(name.to_owned());
            let location = SourceLocation { file, span: entry.value.span() };
            let inner = |params: Option<&Value>| -> Vec<(String, Given)> {
                let entries = params.and_then(Value::as_map).unwrap_or_default();
                let one = |e: &lang::ast::Entry| {
                    let location = SourceLocation { file, span: e.value.span() };
                    let given = Given {
                        value: e.value.clone(),
                        location,
                        folder: folder.clone(),
                        scope: scope.clone(),
                        origin: Origin::Text,
                    };
                    Some((e.key.as_str()?.to_owned(), given))
                };
                entries.iter().filter_map(one).collect()
            };
            let params = || inner(entry.value.field("params"));
            let path = match &entry.value.value {
                ValueKind::Str(path) => path.as_str(),
                ValueKind::Error => continue,
                _ => match entry.value.field("path").and_then(Value::as_str) {
                    Some(path) => path,
                    None => {
                        let message = format!(
                            "a sub-graph is a path, Sub(path: \"...\", params: {{...}}) or Array(path: \"...\", items: [...]), \
                             found {}",
                            entry.value.describe()
                        );
                        self.error("F030", message, location);
                        continue;
                    }
                },
            };
            let path = join(folder, path);
            let own = format!("{}{name}.", scope.prefix);
            let set = |part: &str| {
                let of_part = |(target, value): &(String, Given)| {
                    let rest = target.strip_prefix(name)?.strip_prefix('.')?;
                    // A value without the number of an item is for all of them.
                    let rest = rest.strip_prefix(part).unwrap_or(rest);
                    let other = rest.split('.').next().is_some_and(|first| first.parse::<usize>().is_ok());
                    (!other).then(|| (rest.to_owned(), value.clone()))
                };
                sets.iter().filter_map(of_part).collect::<Vec<_>>()
            };
            let is_array = matches!(entry.value.as_struct(), Some((Some(kind), _)) if kind.value == "Array");
            if !is_array {
                let given = params().into_iter().chain(set("")).collect();
                self.sub_graph(&path, location, &own, given, chain);
                continue;
            }
            let Some(items) = entry.value.field("items").and_then(Value::as_list) else {
                let message =
                    "an array needs `items`, a list of parameters such as [{\"frequency\": 220.0}, {}]";
                self.error("F030", message, location);
                continue;
            };
            self.arrays.insert(own.clone(), items.len());
            for (k, item) in items.iter().enumerate() {
                let at = SourceLocation { file, span: item.span() };
                if item.as_map().is_none() && !item.is_error() {
                    let message =
                        format!("an item of an array is a map of parameters, found {}", item.describe());
                    self.error("F030", message, at);
                    continue;
                }
                let part = format!("{k}.");
                let given = params().into_iter().chain(inner(Some(item))).chain(set(&part)).collect();
                self.sub_graph(&path, at, &format!("{own}{part}"), given, chain);
            }
        }
        if any_error(&self.found[start..]) {
            let prefixes = names.iter().map(|name| format!("{}{name}.", scope.prefix));
            let lost = prefixes.filter(|prefix| !self.nodes.iter().any(|n| n.id.starts_with(prefix)));
            self.lost.extend(lost.collect::<Vec<_>>());
        }
        names
    }

    fn sub_graph(
        &mut self,
        path: &str,
        location: SourceLocation,
        prefix: &str,
        given: Vec<(String, Given)>,
        chain: &mut Vec<PathBuf>,
    ) {
        let Some((real, text)) = self.other(path, location.clone(), chain) else { return };
        chain.push(real);
        self.used_at.push(location);
        self.file(path, text, Path::new(path), prefix, given, chain);
        self.used_at.pop();
        chain.pop();
    }

    /// The real path and the text of a graph that another one uses or extends; `chain` are the graphs that are being read.
    pub(super) fn other(
        &mut self,
        path: &str,
        location: SourceLocation,
        chain: &[PathBuf],
    ) -> Option<(PathBuf, String)> {
        if self.full {
            return None;
        }
        let known = self.texts.as_ref().and_then(|texts| texts.get(Path::new(path)));
        let (real, known) = match known {
            Some((real, text)) => {
                self.root.note(Path::new(path));
                (real, Some(text))
            }
            None => match self.root.resolve(path) {
                Ok(real) => (real, None),
                Err(e) => {
                    self.error(e.code, e.message, location);
                    return None;
                }
            },
        };
        if chain.contains(&real) {
            self.error("F031", format!("{path:?} uses itself"), location);
            return None;
        }
        if chain.len() > self.limits.depth {
            let message = format!("more than {} sub-graphs inside each other", self.limits.depth);
            self.found.push(Diagnostic::error("F009", message, location).help("--max-depth allows more"));
            return None;
        }
        self.uses += 1;
        if self.uses > self.limits.nodes {
            let message = format!("more than {} uses of sub-graphs", self.limits.nodes);
            self.stop(Diagnostic::error("F009", message, location).help("--max-nodes allows more"));
            return None;
        }
        let limit = self.limits.graph_bytes;
        let text = match known.map_or_else(|| read_text(&real, path, limit), Ok) {
            Ok(text) => text,
            Err(e) => {
                self.error("F030", e.message, location);
                return None;
            }
        };
        self.cache_text(Path::new(path), &real, &text);
        self.text_bytes += text.len() as u64;
        if self.text_bytes > self.limits.graph_bytes {
            let most = self.limits.graph_bytes;
            let message =
                format!("the sub-graphs have more than {most} bytes, each counted as often as it is used");
            self.stop(Diagnostic::error("F009", message, location));
            return None;
        }
        Some((real, text))
    }
}
