//! Parameters of a graph: overrides from the command line, and `"$name"` in texts.

use super::fixes;
use super::load_options::LoadOptions;
use super::loader::{Layer, Loader};
use super::suggest::help;
use super::values::{Given, Origin, Override, Scope};
use crate::diag::{Diagnostic, SourceLocation};
use crate::lang::edit::quote;
use crate::lang::{self, Value, ValueKind};
use std::collections::{BTreeMap, BTreeSet};

/// Name of the source of a value that a message sets, as diagnostics show it.
#[must_use]
pub fn message_source(target: &str) -> String {
    format!("message that sets {target}")
}

/// Name of the value of a parameter that the user of a graph has to give.
const REQUIRED: &str = "Required";

/// Returns true for `Required` and `Required("what it is")`.
fn is_required(value: &Value) -> bool {
    match &value.value {
        ValueKind::Name(name) => name.value == REQUIRED,
        ValueKind::NamedTuple(name, _) => name.value == REQUIRED,
        _ => false,
    }
}

/// Description of a required parameter, as the graph states it.
fn required_words(value: &Value) -> Option<&str> {
    match &value.value {
        ValueKind::NamedTuple(_, items) => items.first()?.as_str(),
        _ => None,
    }
}

impl Loader {
    /// Parses the values from outside, each as a text of its own; those of messages follow those of the command line.
    pub(super) fn overrides(&mut self, options: &LoadOptions) -> Vec<(String, Given)> {
        let named = options.overrides.iter().map(|given| (given, Origin::CommandLine));
        let received = options.messages.iter().map(|given| (given, Origin::Message));
        let mut given = Vec::new();
        for (Override { target, value }, origin) in named.chain(received) {
            let parsed = lang::parse(value);
            let document = parsed.document();
            let text = |file| SourceLocation { file, span: 0..value.len() };
            let source = match origin {
                Origin::Message => message_source(target),
                Origin::Text | Origin::CommandLine => format!("--set {target}"),
            };
            let file = self.sources.add(source, value.as_str());
            let node = match document.value {
                // A bare word that no value starts with is text, and so is a path.
                Some(found)
                    if parsed.is_ok()
                        && !matches!(found.value, ValueKind::Struct(..) | ValueKind::NamedTuple(..)) =>
                {
                    found
                }
                _ => Value { span: 0..value.len(), value: ValueKind::Str(value.clone()) },
            };
            let scope = Scope::default();
            // A message names files as the text of the graph does.
            let folder = match origin {
                Origin::Message => self.folder.clone(),
                Origin::Text | Origin::CommandLine => options.override_folder.clone(),
            };
            given.push((target.clone(), Given { value: node, location: text(file), folder, scope, origin }));
        }
        given
    }

    /// The graph's parameters with the values from outside, and values for nodes. Parameters of a file replace those of the files
    /// that it extends.
    pub(super) fn params(
        &mut self,
        layers: &[Layer],
        given: &[(String, Given)],
        prefix: &str,
    ) -> (BTreeMap<String, Given>, Vec<(String, Given)>) {
        let mut params: BTreeMap<String, Given> = BTreeMap::new();
        let own_file = layers.last().map_or(0, |layer| layer.file);
        for layer in layers {
            let file = layer.file;
            let mut seen = BTreeSet::new();
            for entry in self.entries(layer.get("params"), file, "params") {
                let Some(name) = entry.key.as_str() else { continue };
                let location = SourceLocation { file, span: entry.value.span() };
                let scope = Scope { prefix: prefix.to_owned(), ..Scope::default() };
                let own = Given {
                    value: entry.value.clone(),
                    location,
                    folder: layer.folder.clone(),
                    scope,
                    origin: Origin::Text,
                };
                let key = SourceLocation { file, span: entry.key.span() };
                if !seen.insert(name) {
                    self.error("F005", format!("parameter `{name}` is given twice"), key);
                } else {
                    let replaces = params.insert(name.to_owned(), own).is_some();
                    // A graph that extends another one need not use all of its parameters.
                    if !replaces && file == own_file {
                        self.all_params.push((format!("{prefix}{name}"), key));
                    }
                }
            }
        }
        let mut node_sets = Vec::new();
        for (target, value) in given {
            if target.contains('.') {
                node_sets.push((target.clone(), value.clone()));
            } else if params.contains_key(target) {
                params.insert(target.clone(), value.clone());
            } else {
                let names = params.keys().map(String::as_str);
                let message = format!("this graph has no parameter `{target}`");
                let found = Diagnostic::error("F028", message, value.location.clone());
                self.found.push(found.help(format!(
                    "{}; a parameter of a node is set as NODE.PARAM=VALUE",
                    help(target, "parameters", names)
                )));
            }
        }
        self.required(&params, prefix);
        (params, node_sets)
    }

    /// Reports the required parameters that are not set, at the use of the sub-graph.
    fn required(&mut self, params: &BTreeMap<String, Given>, prefix: &str) {
        let missing: Vec<(&String, &Given)> =
            params.iter().filter(|(_, given)| is_required(&given.value)).collect();
        let Some((first, given)) = missing.first() else { return };
        let name = |(name, given): &(&String, &Given)| match required_words(&given.value) {
            Some(words) => format!("`{name}` ({words})"),
            None => format!("`{name}`"),
        };
        let names: Vec<String> = missing.iter().map(name).collect();
        let names = names.join(", ");
        let found = match self.used_at.last() {
            Some(location) => {
                let message = format!("sub-graph `{}` requires {names}", prefix.trim_end_matches('.'));
                let found = Diagnostic::error("F032", message, location.clone());
                found
                    .label(given.location.clone(), "required here")
                    .help(format!("write Sub(path: \"...\", params: {{ \"{first}\": ... }})"))
            }
            None => {
                let message = format!("this graph requires {names}");
                let help = format!(
                    "it is made for `use` in another graph; --set {first}=VALUE gives a value as well"
                );
                Diagnostic::error("F032", message, given.location.clone()).help(help)
            }
        };
        self.found.push(found);
    }

    /// Follows `"$name"` to the parameter that it refers to.
    pub(super) fn resolve(&mut self, given: Given) -> Option<Given> {
        let mut given = given;
        for _ in 0..=self.limits.depth {
            let Some(name) = given.value.as_str().and_then(|t| t.strip_prefix('$')).map(str::to_owned) else {
                return Some(given);
            };
            if let Some(literal) = name.strip_prefix('$') {
                given.value.value = ValueKind::Str(format!("${literal}"));
                return Some(given);
            }
            self.used_params.borrow_mut().insert(format!("{}{name}", given.scope.prefix));
            match given.scope.params.get(&name).cloned() {
                // That it is missing has been reported.
                Some(next) if is_required(&next.value) => {
                    self.missing += 1;
                    return None;
                }
                Some(mut next) => {
                    // A parameter may stand for another one of the same file.
                    if next.scope.params.is_empty() && next.scope.prefix == given.scope.prefix {
                        next.scope = given.scope;
                    }
                    given = next;
                }
                None => {
                    let names: Vec<String> = given.scope.params.keys().cloned().collect();
                    let names = || names.iter().map(String::as_str);
                    let fix =
                        fixes::rename(&name, names(), &given.location, |name| quote(&format!("${name}")));
                    let message = format!("this graph has no parameter `{name}`");
                    let found = Diagnostic::error("F027", message, given.location);
                    self.found.push(found.help(help(&name, "parameters", names())).fixes(fix));
                    return None;
                }
            }
        }
        self.error("F027", "parameters refer to each other in a cycle", given.location);
        None
    }

    /// The text of the argument of the command, or of the message, that gave a value, where one did.
    pub(super) fn argument(&self, given: &Given) -> Option<&str> {
        let source = self.sources.get(given.location.file).filter(|_| given.origin != Origin::Text)?;
        Some(&*source.text)
    }

    /// Warnings about unused parameters.
    pub(super) fn unused_params(&self) -> Vec<Diagnostic> {
        let used = self.used_params.borrow();
        let unused = self.all_params.iter().filter(|(name, _)| !used.contains(name));
        let warn = |(name, location): &(String, SourceLocation)| {
            let own = name.rsplit('.').next().unwrap_or(name);
            let message = format!("nothing uses the parameter `{name}`");
            Diagnostic::warning("F029", message, location.clone())
                .help(format!("write \"${own}\" where its value is used"))
        };
        unused.map(warn).collect()
    }
}
