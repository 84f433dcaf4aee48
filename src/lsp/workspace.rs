//! The files that an editor has open, and those on the disk around them.

use super::file::TextFile;
use crate::graph::{Limits, Stamp, Texts, join, read_text};
use lsp_types::Uri;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::str::FromStr as _;
use std::sync::Arc;

/// Maximum number of files of a folder that are searched for uses of a name.
const MAX_FILES: usize = 5000;
/// Maximum depth of folders that are searched.
const MAX_DEPTH: usize = 12;

/// A file that is open in the editor.
#[derive(Clone, Debug)]
pub struct OpenFile {
    /// Its address, as the editor wrote it.
    pub uri: Uri,
    /// Version of its text.
    pub version: i32,
    /// Its text.
    pub file: Arc<TextFile>,
}

/// Texts by their paths: those that are open in the editor, and those of the disk.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Folders of the workspace.
    pub folders: Vec<PathBuf>,
    open: BTreeMap<PathBuf, OpenFile>,
    disk: RefCell<HashMap<PathBuf, (Stamp, Arc<TextFile>)>>,
}

impl Workspace {
    /// Sets the text of an open file.
    pub fn set(&mut self, uri: &Uri, version: i32, text: String) -> PathBuf {
        let path = path_of(uri);
        let file = Arc::new(TextFile::new(text));
        self.open.insert(path.clone(), OpenFile { uri: uri.clone(), version, file });
        path
    }

    /// Discards the unsaved text of a file.
    pub fn close(&mut self, uri: &Uri) -> PathBuf {
        let path = path_of(uri);
        self.open.remove(&path);
        path
    }

    /// The open files, by path.
    pub fn open_files(&self) -> impl Iterator<Item = (&Path, &OpenFile)> {
        self.open.iter().map(|(path, file)| (&**path, file))
    }

    /// An open file.
    #[must_use]
    pub fn open_file(&self, path: &Path) -> Option<&OpenFile> {
        self.open.get(path)
    }

    /// The text of a file: that of the editor, or that of the disk.
    #[must_use]
    pub fn file(&self, path: &Path) -> Option<Arc<TextFile>> {
        if let Some(open) = self.open.get(path) {
            return Some(Arc::clone(&open.file));
        }
        let stamp = Stamp::of(path)?;
        if let Some((known, file)) = self.disk.borrow().get(path)
            && *known == stamp
        {
            return Some(Arc::clone(file));
        }
        let text = read_text(path, &path.display().to_string(), Limits::default().graph_bytes).ok()?;
        let file = Arc::new(TextFile::new(text));
        self.disk.borrow_mut().insert(path.to_owned(), (stamp, Arc::clone(&file)));
        Some(file)
    }

    /// A graph and those that it extends: itself first.
    #[must_use]
    pub fn layers(&self, path: &Path) -> Vec<(PathBuf, Arc<TextFile>)> {
        let mut layers: Vec<(PathBuf, Arc<TextFile>)> = Vec::new();
        let mut next = Some(path.to_owned());
        while let Some(path) = next.take().filter(|path| layers.iter().all(|(known, _)| known != path)) {
            let Some(file) = self.file(&path) else { break };
            next = file.extends().and_then(|base| Some(beside(&path, base.as_str()?)));
            layers.push((path, file));
        }
        layers
    }

    /// The texts of the open files, for loading graphs; `newest` replaces that of one of them.
    #[must_use]
    pub fn texts(&self, newest: Option<(&Path, &str)>) -> Arc<Texts> {
        let texts = Texts::default();
        for (path, open) in &self.open {
            let newest = newest.filter(|(of, _)| of == path).map(|(_, text)| text);
            texts.set(path, newest.unwrap_or(&open.file.text));
        }
        Arc::new(texts)
    }

    /// All graphs in the folders of the workspace and beside the open files.
    #[must_use]
    pub fn graphs(&self) -> Vec<(PathBuf, Arc<TextFile>)> {
        let beside = self.open.keys().filter_map(|path| path.parent());
        let mut folders: Vec<&Path> = self.folders.iter().map(PathBuf::as_path).chain(beside).collect();
        folders.sort();
        // A folder inside another one is searched with it.
        folders.dedup_by(|inner, outer| inner.starts_with(outer));
        let mut paths: Vec<PathBuf> = self.open.keys().cloned().collect();
        folders.into_iter().for_each(|folder| find_ron(folder, 0, &mut paths));
        paths.sort();
        paths.dedup();
        let graph = |path: PathBuf| Some((self.file(&path).filter(|file| file.is_graph())?, path));
        paths.into_iter().filter_map(graph).map(|(file, path)| (path, file)).collect()
    }
}

fn find_ron(folder: &Path, depth: usize, paths: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        let Ok(kind) = entry.file_type() else { continue };
        if name.starts_with('.') || paths.len() >= MAX_FILES {
            continue;
        }
        if kind.is_dir() && depth < MAX_DEPTH && !matches!(&*name, "target" | "node_modules") {
            find_ron(&path, depth + 1, paths);
        } else if kind.is_file() && name.ends_with(".ron") {
            paths.push(path);
        }
    }
}

/// The path that a file names, without detours.
#[must_use]
pub fn beside(file: &Path, named: &str) -> PathBuf {
    join(file.parent().unwrap_or(Path::new("")), named).into()
}

/// The path of an address: of an unsaved text without a file, one that no file has.
#[must_use]
pub fn path_of(uri: &Uri) -> PathBuf {
    let text = uri.as_str();
    let Some(path) = text.strip_prefix("file://") else { return PathBuf::from(text) };
    // The host, if any, is this machine.
    let path = path.find('/').map_or(path, |at| &path[at..]);
    let mut bytes = Vec::with_capacity(path.len());
    let mut rest = path.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let code = (first == b'%').then(|| std::str::from_utf8(tail.get(..2)?).ok()).flatten();
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    let text = String::from_utf8_lossy(&bytes).into_owned();
    // `/c:/a` is a path of Windows.
    let drive =
        text.as_bytes().get(2) == Some(&b':') && text.as_bytes().get(1).is_some_and(u8::is_ascii_alphabetic);
    let text = if drive && cfg!(windows) { &text[1..] } else { &text };
    join(Path::new(""), text).into()
}

/// The address of a path.
#[must_use]
pub fn uri_of(path: &Path) -> Option<Uri> {
    let text = path.to_str()?;
    if text.contains(':') && !text.starts_with('/') && !cfg!(windows) {
        return Uri::from_str(text).ok();
    }
    let mut out = "file://".to_owned();
    let text = text.replace('\\', if cfg!(windows) { "/" } else { "\\" });
    if !text.starts_with('/') {
        out.push('/');
    }
    for byte in text.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' => {
                out.push(char::from(byte))
            }
            byte => out.push_str(&format!("%{byte:02X}")),
        }
    }
    Uri::from_str(&out).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_survive_addresses() {
        for path in ["/a b/ü#%.ron", "/x/a+b.ron", "/x/[1].ron"] {
            let uri = uri_of(Path::new(path)).unwrap();
            assert_eq!(path_of(&uri), Path::new(path), "{}", uri.as_str());
        }
        let encoded = Uri::from_str("file:///tmp/a%20b/../c.ron").unwrap();
        assert_eq!(path_of(&encoded), Path::new("/tmp/c.ron"));
        let untitled = Uri::from_str("untitled:Untitled-1").unwrap();
        assert_eq!(uri_of(&path_of(&untitled)), Some(untitled));
    }
}
