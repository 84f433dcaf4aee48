//! Data from which requests of an editor are answered.

use super::analysis::{Analysis, NodeFacts, StreamFacts};
use super::file::TextFile;
use super::names::follow;
use super::workspace::Workspace;
use crate::docs::plain;
use crate::live::Levels;
use foley_nodes::core::ports::PortSpec;
use foley_nodes::registry::Registry;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The texts, the node types, and the results of the analyses of graphs.
pub struct Context<'a> {
    /// The texts.
    pub workspace: &'a Workspace,
    /// The node types.
    pub registry: &'a Registry,
    /// The newest analysis of each open graph.
    pub analyses: &'a HashMap<PathBuf, Arc<Analysis>>,
    /// True if the editor takes snippets.
    pub snippets: bool,
}

/// One file, for a request about it.
#[derive(Clone, Copy)]
pub struct At<'a> {
    /// Its path.
    pub path: &'a Path,
    /// Its text.
    pub file: &'a TextFile,
    /// The byte offset of the request.
    pub offset: usize,
}

impl Context<'_> {
    /// Facts about a node of a file: from the analysis of the file, or of an open graph that uses it.
    #[must_use]
    pub fn facts(&self, path: &Path, id: &str) -> Option<&NodeFacts> {
        let own = self.analyses.get(path).and_then(|analysis| analysis.nodes.get(id));
        own.filter(|facts| facts.outputs.iter().any(Option::is_some)).or_else(|| {
            let users =
                self.analyses.values().filter(|a| a.path != path && a.asked.iter().any(|p| p == path));
            let in_user = |user: &Arc<Analysis>| {
                let file = self.workspace.file(&user.path)?;
                let used = file.uses().find(|used| {
                    used.path
                        .as_str()
                        .is_some_and(|named| super::workspace::beside(&user.path, named) == path)
                })?;
                Some(format!("{}.{id}", used.name))
            };
            users.filter_map(|user| user.nodes.get(&in_user(user)?)).next().or(own)
        })
    }

    /// Rate and format of an output of a node that a link of a file names.
    #[must_use]
    pub fn stream(&self, path: &Path, link: &str) -> Option<(&'static PortSpec, Option<StreamFacts>)> {
        let linked = follow(self.workspace, path, link)?;
        let node = linked.file.node(&linked.id)?;
        let ty = self.registry.get(&node.ty.value)?;
        let port = match &linked.port {
            Some(port) => ty.outputs.iter().position(|spec| spec.name == port)?,
            None => 0,
        };
        let spec = ty.outputs.get(port)?;
        let facts = self.analyses.get(path).and_then(|a| {
            let id = link.strip_suffix(&format!(".{}", spec.name)).unwrap_or(link);
            // All items of an array have the rates of the first.
            a.nodes.get(&*id.replace(".*", ".0"))
        });
        let facts = facts.or_else(|| self.facts(&linked.path, &linked.id));
        let stream = facts.and_then(|facts| facts.outputs.get(port).cloned().flatten());
        Some((spec, stream))
    }

    /// The level of a node, or of its meter, in the graph that plays now.
    #[must_use]
    pub fn level(&self, path: &Path, id: &str, meter: &str) -> Option<String> {
        Levels::beside(path).map(|levels| levels.describe(id, meter))
    }

    /// The level of a node of a sub-graph in the graph that plays now, by its id there.
    #[must_use]
    pub fn inner_level(&self, path: &Path, id: &str) -> Option<String> {
        let levels =
            Levels::beside(path).filter(|levels| id.contains('.') && levels.nodes.contains_key(id))?;
        Some(levels.describe(id, id))
    }
}

/// Describes a port with its stream: `audio: stream of audio, 48000 Hz, stereo`.
#[must_use]
pub fn port_line(spec: &PortSpec, stream: Option<&StreamFacts>) -> String {
    let stream = stream.map(|s| format!(", {}, {}", s.rate, s.format)).unwrap_or_default();
    format!("`{}`: {} of {}{stream}", spec.name, spec.kind.word(), spec.kind.name())
}

/// A documentation comment as Markdown for an editor.
#[must_use]
pub fn doc(text: &str) -> String {
    plain(text).replace("\n# ", "\n#### ")
}
