//! Values of parameters: choices, defaults and files.

use super::item::{Completion, Item};
use crate::docs::param_words;
use crate::lsp::context::doc;
use crate::lsp::workspace::beside;
use foley_nodes::core::params::{ParamKind, ParamSpec};
use lsp_types::CompletionItemKind;

/// Maximum number of files of a folder that are examined.
const MAX_FILES: usize = 4000;

/// Files that a field takes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Files {
    All,
    Graphs,
    Folders,
}

impl Completion<'_> {
    pub(super) fn values(&self, spec: &ParamSpec, in_list: bool) -> Vec<Item> {
        let mut items = Vec::new();
        let innermost = spec.kind.innermost();
        match innermost {
            ParamKind::Asset => items.extend(self.files(self.typed(), Files::All)),
            ParamKind::Folder => items.extend(self.files(self.typed(), Files::Folders)),
            _ if self.in_text() => {}
            ParamKind::Choice(names) => items.extend(names.iter().map(|(name, text)| Item {
                label: (*name).to_owned(),
                insert: (*name).to_owned(),
                kind: Some(CompletionItemKind::ENUM_MEMBER),
                doc: doc(text),
                ..Item::default()
            })),
            ParamKind::Bool => items.extend(["true", "false"].map(|word| Item {
                label: word.to_owned(),
                insert: word.to_owned(),
                kind: Some(CompletionItemKind::VALUE),
                ..Item::default()
            })),
            _ => {}
        }
        if self.in_text() {
            return items;
        }
        if matches!(spec.kind, ParamKind::Maybe(_)) {
            items.push(Item {
                label: "None".into(),
                insert: "None".into(),
                kind: Some(CompletionItemKind::VALUE),
                ..Item::default()
            });
        }
        if let Some(default) = spec.default.as_ref().filter(|_| !in_list).map(ToString::to_string)
            && items.iter().all(|item| item.label != default)
        {
            items.push(Item {
                insert: default.clone(),
                label: default,
                kind: Some(CompletionItemKind::VALUE),
                detail: format!("the default; {}", param_words(spec)),
                ..Item::default()
            });
        }
        items
    }

    /// Files and folders beside the graph, or in the folder that is typed already.
    pub(super) fn files(&self, typed: &str, wanted: Files) -> Vec<Item> {
        let typed = if typed.is_empty() { self.typed() } else { typed };
        let typed = if self.in_text() { typed } else { "" };
        let folder = typed.rfind('/').map_or("", |at| &typed[..=at]);
        let mut items = Vec::new();
        let mut add = |name: &str, is_folder: bool, size: u64| {
            let text = format!("{folder}{name}{}", if is_folder { "/" } else { "" });
            let kind = if is_folder { CompletionItemKind::FOLDER } else { CompletionItemKind::FILE };
            let size = if is_folder { String::new() } else { crate::plan::format_bytes(size as usize) };
            let order = if is_folder { 4 } else { 3 };
            items.push(Item { order, ..self.text(&text, kind, &size) });
        };
        let root = beside(self.at.path, folder);
        for entry in std::fs::read_dir(root).into_iter().flatten().flatten().take(MAX_FILES) {
            let (name, path) = (entry.file_name(), entry.path());
            let (Some(name), Ok(meta)) = (name.to_str(), path.metadata()) else { continue };
            let fits = match wanted {
                Files::Folders => meta.is_dir(),
                Files::Graphs => meta.is_dir() || name.ends_with(".ron") && path != self.at.path,
                Files::All => true,
            };
            if fits && !name.starts_with('.') {
                add(name, meta.is_dir(), meta.len());
            }
        }
        // The folders that a graph may read besides its own.
        for shared in ["../assets", "../lib"] {
            if folder.is_empty() && beside(self.at.path, shared).is_dir() {
                add(shared, true, 0);
            }
        }
        items.sort_by(|a, b| (a.order, &a.label).cmp(&(b.order, &b.label)));
        items
    }
}
