//! Settings for loading a graph.

use super::limits::Limits;
use super::texts::Texts;
use super::values::Override;
use foley_nodes::registry::Registry;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

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
