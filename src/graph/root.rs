//! Access of graphs to files: permission and opening.

use foley_nodes::core::files::{FileError, Files, ReadSeek, number_in, sorted_sequence};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, Metadata};
use std::io::BufReader;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// Limits of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one graph file, and of all its sub-graphs, each as often as it is used.
    pub graph_bytes: u64,
    /// Bytes of one input file.
    pub file_bytes: u64,
    /// Bytes of all buffers, and of a file that is held as a whole.
    pub memory: usize,
    /// Nodes of a graph, sub-graphs included.
    pub nodes: usize,
    /// Links of a graph.
    pub links: usize,
    /// Sub-graphs inside sub-graphs.
    pub depth: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            graph_bytes: 4 << 20,
            file_bytes: 64 << 30,
            memory: 4 << 30,
            nodes: 20_000,
            links: 200_000,
            depth: 16,
        }
    }
}

/// The folders and files that a graph may read: its own folder, `assets` and `lib` beside it, and what the user allowed.
#[derive(Clone, Debug, Default)]
pub struct Root {
    folders: Vec<PathBuf>,
    files: Vec<PathBuf>,
    /// Numbered sequences whose folders may be listed for them alone.
    patterns: Vec<PathBuf>,
    /// Shared by all copies, so that it includes the files that nodes open.
    asked: Arc<Mutex<Asked>>,
}

/// All files that were requested while a graph was read and run, also missing ones.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Files and folders, by the requested path, with their stamps before they were first read.
    pub files: BTreeMap<PathBuf, Option<Stamp>>,
    /// Patterns of numbered sequences.
    pub sequences: BTreeSet<String>,
    /// Folders whose files were listed.
    pub folders: BTreeSet<PathBuf>,
}

/// Properties of a file that identify its content without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Bytes.
    pub len: u64,
    /// Time of the last change of its content.
    pub modified: Option<SystemTime>,
    /// Device, inode, and time of the last change of either, if the system has them.
    pub identity: Option<(u64, u64, i64, i64)>,
}

impl Stamp {
    /// The stamp of the file at a path; `None` if there is none.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        fs::metadata(path).ok().map(|meta| Self::from(&meta))
    }
}

impl From<&Metadata> for Stamp {
    fn from(meta: &Metadata) -> Self {
        #[cfg(unix)]
        let identity = {
            use std::os::unix::fs::MetadataExt as _;
            Some((meta.dev(), meta.ino(), meta.ctime(), meta.ctime_nsec()))
        };
        #[cfg(not(unix))]
        let identity = None;
        Self { len: meta.len(), modified: meta.modified().ok(), identity }
    }
}

impl Root {
    /// Returns the default permissions of the graph at `path`.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        let mut root = Self::default();
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p.to_owned(),
            _ => PathBuf::from("."),
        };
        let _ = root.allow_folder(&folder);
        if let Some(own) = root.folders.first().cloned() {
            for beside in ["assets", "lib"] {
                let _ = own.parent().map(|p| root.allow_folder(&p.join(beside)));
            }
        }
        root
    }

    /// Allows everything below a folder.
    ///
    /// # Errors
    /// When the folder does not exist.
    pub fn allow_folder(&mut self, folder: &Path) -> std::io::Result<()> {
        self.folders.push(fs::canonicalize(folder)?);
        Ok(())
    }

    /// Allows a file or folder that the user named on the command line, and what belongs to it: the faces of a point cache and the
    /// buffer of a glTF of the same name beside it, all frames of a numbered sequence, or all files in the folder.
    pub fn allow_named(&mut self, file: &Path) {
        if file.is_dir() {
            let _ = self.allow_folder(file);
            return;
        }
        if file.to_string_lossy().contains('#') {
            let frames = matching(&file.to_string_lossy()).unwrap_or_default();
            self.files.extend(frames.into_iter().filter_map(|(_, frame)| fs::canonicalize(frame).ok()));
            self.patterns.push(file.to_owned());
        }
        let beside = ["obj", "bin"].map(|ending| file.with_extension(ending));
        let all = std::iter::once(file.to_owned()).chain(beside);
        self.files.extend(all.filter_map(|file| fs::canonicalize(file).ok()));
    }

    /// Returns true if a path lies below the graph's own folder, which is written as `folder`, links followed. A file that
    /// is missing counts by its text, so that the answer does not reveal which files exist elsewhere.
    pub(super) fn own_folder_holds(&self, folder: &Path, path: &str) -> bool {
        let folder = join(folder, "");
        let path =
            if folder == "." { Some(Path::new(path)) } else { Path::new(path).strip_prefix(&folder).ok() };
        let inside = |path: &&Path| path.components().all(|part| matches!(part, Component::Normal(_)));
        let Some(path) = path.filter(inside).map(|inside| Path::new(&folder).join(inside)) else {
            return false;
        };
        let sequence = path.to_string_lossy().contains('#').then(|| path.parent()).flatten();
        let real = fs::canonicalize(sequence.unwrap_or(&path));
        self.folders.first().is_some_and(|own| real.map_or(true, |real| real.starts_with(own)))
    }

    /// All files that were requested so far.
    #[must_use]
    pub fn asked(&self) -> Asked {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Records that a path was requested.
    pub(super) fn note(&self, path: &Path) {
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.files.entry(path.to_owned()).or_insert_with(|| Stamp::of(path));
    }

    fn allows(&self, real: &Path) -> bool {
        self.folders.iter().any(|f| real.starts_with(f)) || self.files.iter().any(|f| f == real)
    }

    /// The first part of a path that is a link inside the permitted folders, and its target.
    fn link_out(&self, path: &Path) -> Option<String> {
        let mut part = PathBuf::new();
        path.components().find_map(|component| {
            let folder = if part.as_os_str().is_empty() { PathBuf::from(".") } else { part.clone() };
            part.push(component);
            let target = fs::read_link(&part).ok()?;
            fs::canonicalize(folder).is_ok_and(|folder| self.allows(&folder)).then(|| {
                format!("{:?} is a link to {:?}", part.display().to_string(), target.display().to_string())
            })
        })
    }

    /// The real path of a file or folder that may be read.
    fn real(&self, path: &str) -> Result<PathBuf, FileError> {
        let error = |code, message| Err(FileError { code, message });
        if path.contains('\0') {
            return error("F062", "a path cannot hold a zero character".into());
        }
        self.note(Path::new(path));
        let real = match fs::canonicalize(path) {
            Ok(real) => real,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                // What lies outside is not disclosed.
                let similar = similar(Path::new(path))
                    .filter(|similar| fs::canonicalize(similar).is_ok_and(|similar| self.allows(&similar)));
                let similar = similar.map(|similar| {
                    let same_folder = similar.parent() == Path::new(path).parent();
                    let name = similar.file_name().filter(|_| same_folder).map(Path::new);
                    format!("; there is {:?}", name.unwrap_or(&similar).display().to_string())
                });
                return error("F060", format!("there is no file {path:?}{}", similar.unwrap_or_default()));
            }
            Err(e) => return error("F061", format!("cannot read {path:?}: {e}")),
        };
        if !self.allows(&real) {
            let link = self.link_out(Path::new(path)).map(|link| format!(" ({link})")).unwrap_or_default();
            let message = format!(
                "{path:?}{link} lies outside what this graph may read: its own folder, and `assets` and `lib` beside it \
                 (allow more with --allow-read DIR)"
            );
            return error("F062", message);
        }
        Ok(real)
    }

    /// The real path of a file that may be read.
    ///
    /// # Errors
    /// When it is missing, not a plain file, or outside.
    pub fn resolve(&self, path: &str) -> Result<PathBuf, FileError> {
        let error = |code, message| Err(FileError { code, message });
        let real = self.real(path)?;
        match fs::metadata(&real) {
            Ok(meta) if meta.is_file() => Ok(real),
            Ok(meta) if meta.is_dir() => error("F064", format!("{path:?} is a folder, not a file")),
            Ok(_) => error("F064", format!("{path:?} is not a plain file")),
            Err(e) => error("F061", format!("cannot read {path:?}: {e}")),
        }
    }
}

/// Maximum number of names of a folder that are compared.
const MAX_NAMES: usize = 10_000;

/// The path that exists and differs from a missing one by slips in the names of its folders and its file; the folder, if it has no such
/// file.
fn similar(path: &Path) -> Option<PathBuf> {
    let (mut found, mut corrected) = (PathBuf::new(), false);
    for component in path.components() {
        let next = found.join(component);
        if next.symlink_metadata().is_ok() || !matches!(component, Component::Normal(_)) {
            found = next;
            continue;
        }
        let folder = if found.as_os_str().is_empty() { Path::new(".") } else { &found };
        let entries = fs::read_dir(folder).ok()?.flatten().take(MAX_NAMES);
        let names: Vec<String> = entries.filter_map(|e| e.file_name().into_string().ok()).collect();
        match super::nearest(component.as_os_str().to_str()?, names.iter().map(String::as_str)) {
            Some(name) => found.push(name),
            None => return corrected.then_some(found),
        }
        corrected = true;
    }
    corrected.then_some(found)
}

/// The files of a [`Root`], for nodes.
///
/// A clone reads the same files, and both count the files that it opens.
#[derive(Clone, Debug, Default)]
pub struct DirFiles {
    root: Root,
    limits: Limits,
    opened: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl DirFiles {
    /// The files of a root.
    #[must_use]
    pub fn new(root: Root, limits: Limits) -> Self {
        Self { root, limits, opened: Arc::default() }
    }

    /// Returns the limits of files.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// All files that were requested so far, by the graph's texts and by its nodes.
    #[must_use]
    pub fn asked(&self) -> Asked {
        self.root.asked()
    }

    /// Returns the stamp of the present content of a file.
    #[must_use]
    pub fn stamp(&self, path: &str) -> Option<Stamp> {
        Stamp::of(&self.root.resolve(path).ok()?)
    }

    /// Every file that was opened so far.
    #[must_use]
    pub fn opened(&self) -> Vec<PathBuf> {
        self.opened.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }
}

impl Files for DirFiles {
    fn room(&self) -> u64 {
        self.limits.memory as u64
    }

    fn open(&self, path: &str) -> Result<Box<dyn ReadSeek>, FileError> {
        let real = self.root.resolve(path)?;
        let file = File::open(&real)
            .map_err(|e| FileError { code: "F061", message: format!("cannot read {path:?}: {e}") })?;
        let bytes = file.metadata().map_or(0, |m| m.len());
        if bytes > self.limits.file_bytes {
            let message = format!("{path:?} has {bytes} bytes, the limit is {}", self.limits.file_bytes);
            return Err(FileError { code: "F063", message });
        }
        self.opened.lock().unwrap_or_else(PoisonError::into_inner).insert(real);
        Ok(Box::new(BufReader::with_capacity(1 << 16, file)))
    }

    fn sequence(&self, pattern: &str) -> Result<Vec<(u64, String)>, FileError> {
        let mut asked = self.root.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.sequences.insert(pattern.to_owned());
        drop(asked);
        let path = Path::new(pattern);
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        let failed = |code, what: &dyn std::fmt::Display| FileError {
            code,
            message: format!("cannot list the files of {pattern:?}: {what}"),
        };
        let text = folder.to_str().ok_or_else(|| failed("F061", &"the folder's name is no text"))?;
        let real = if self.root.patterns.iter().any(|named| named == path) {
            fs::canonicalize(text).map_err(|e| failed("F061", &e))?
        } else {
            self.root.real(text).map_err(|e| failed(e.code, &e.message))?
        };
        let entries = fs::read_dir(real).map_err(|e| failed("F061", &e))?;
        let found = entries.flatten().filter_map(|entry| {
            let file = entry.file_name().into_string().ok()?;
            Some((number_in(name, &file)?, folder.join(&file).to_str()?.to_owned()))
        });
        sorted_sequence(pattern, found.collect())
    }

    fn folder(&self, path: &str) -> Result<Vec<String>, FileError> {
        self.root.asked.lock().unwrap_or_else(PoisonError::into_inner).folders.insert(path.into());
        let error = |code, message| Err(FileError { code, message });
        let real = self.root.real(path)?;
        if !real.is_dir() {
            return error("F064", format!("{path:?} is a file, not a folder"));
        }
        match files_in(&real) {
            Ok(names) if names.len() > MAX_FILES => {
                error("F063", format!("{path:?} has {} files, the limit is {MAX_FILES}", names.len()))
            }
            Ok(names) => Ok(names.iter().map(|name| join(Path::new(path), name)).collect()),
            Err(e) => error("F061", format!("cannot list the files in {path:?}: {e}")),
        }
    }

    fn shared(&self) -> Option<Arc<dyn Files>> {
        Some(Arc::new(self.clone()))
    }
}

/// Maximum number of files in a folder that is read as a whole.
const MAX_FILES: usize = 100_000;

/// The names of the plain files in a folder, without hidden ones, in order.
///
/// # Errors
/// When the folder cannot be listed.
pub fn files_in(folder: &Path) -> std::io::Result<Vec<String>> {
    let plain = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().ok()?;
        (!name.starts_with('.') && entry.path().is_file()).then_some(name)
    };
    let mut names: Vec<String> = fs::read_dir(folder)?.flatten().filter_map(plain).collect();
    names.sort();
    Ok(names)
}

/// The files whose names fit the pattern of a sequence, with their numbers, in no order.
///
/// # Errors
/// The folder, and why it cannot be listed.
pub fn matching(pattern: &str) -> Result<Vec<(u64, String)>, (PathBuf, std::io::Error)> {
    let path = Path::new(pattern);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let entries = fs::read_dir(folder).map_err(|e| (folder.to_owned(), e))?;
    let found = entries.flatten().filter_map(|entry| {
        let file = entry.file_name().into_string().ok()?;
        Some((number_in(name, &file)?, folder.join(&file).to_str()?.to_owned()))
    });
    Ok(found.collect())
}

/// `folder/path` with `.` and `..` resolved in the text alone.
#[must_use]
pub fn join(folder: &Path, path: &str) -> String {
    let mut out = PathBuf::new();
    for part in folder.join(path).components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            part => out.push(part),
        }
    }
    if out.as_os_str().is_empty() {
        out.push(Component::CurDir);
    }
    out.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_paths_are_short() {
        assert_eq!(join(Path::new("graphs/cloth"), "../assets/a.wav"), "graphs/assets/a.wav");
        assert_eq!(join(Path::new(""), "a.wav"), "a.wav");
        assert_eq!(join(Path::new("."), "../../a.wav"), "../../a.wav");
        assert_eq!(join(Path::new("cloth"), ".."), ".");
        assert_eq!(join(Path::new(""), "."), ".");
    }

    #[test]
    fn a_graph_reads_its_folder_and_the_assets_beside_it_only() {
        let dir = tempfile::tempdir().unwrap();
        let base = dir.path();
        for folder in ["cloth", "assets", "other"] {
            fs::create_dir(base.join(folder)).unwrap();
            fs::write(base.join(folder).join("a.wav"), b"x").unwrap();
        }
        let root = Root::of(&base.join("cloth/graph.ron"));
        let resolve = |p: &str| root.resolve(base.join(p).to_str().unwrap()).map_err(|e| e.code);
        assert!(resolve("cloth/a.wav").is_ok());
        assert!(resolve("cloth/../assets/a.wav").is_ok());
        assert_eq!(resolve("other/a.wav"), Err("F062"));
        assert_eq!(resolve("cloth/b.wav"), Err("F060"));
        assert_eq!(resolve("assets"), Err("F064"));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(base.join("other/a.wav"), base.join("cloth/link.wav")).unwrap();
            assert_eq!(resolve("cloth/link.wav"), Err("F062"));
            let message = root.resolve(base.join("cloth/link.wav").to_str().unwrap()).unwrap_err().message;
            assert!(
                message.contains("link.wav\" is a link to ") && message.contains("other/a.wav"),
                "{message}"
            );
        }
    }

    #[test]
    fn sequences_are_listed_inside_the_root_only_and_kept_files_count_with_the_others() {
        let dir = tempfile::tempdir().unwrap();
        let base = dir.path();
        for folder in ["cloth", "other"] {
            fs::create_dir(base.join(folder)).unwrap();
            for frame in [10, 9] {
                fs::write(base.join(folder).join(format!("f_{frame}.obj")), b"x").unwrap();
            }
        }
        let files = DirFiles::new(Root::of(&base.join("cloth/graph.ron")), Limits::default());
        let list = |p: &str| files.sequence(base.join(p).to_str().unwrap()).map_err(|e| e.code);
        let found = list("cloth/f_#.obj").unwrap();
        assert_eq!(found.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [9, 10]);
        assert_eq!(list("other/f_#.obj"), Err("F062"));
        assert_eq!(list("cloth/../other/f_#.obj"), Err("F062"));
        assert_eq!(list("cloth/none/f_#.obj"), Err("F060"));
        assert_eq!(list("cloth/g_#.obj"), Err("F060"));
        assert!(files.opened().is_empty());
        // A path on the command line may be anywhere.
        let mut root = Root::of(&base.join("cloth/graph.ron"));
        root.allow_named(&base.join("other/f_#.obj"));
        let named = DirFiles::new(root, Limits::default());
        let found_there = named.sequence(base.join("other/f_#.obj").to_str().unwrap()).unwrap();
        assert_eq!(found_there.len(), 2);
        assert_eq!(named.bytes(&found_there[1].1).unwrap(), b"x");
        assert!(named.sequence(base.join("other/#.obj").to_str().unwrap()).is_err());
        assert_eq!(files.shared().unwrap().bytes(&found[0].1).unwrap(), b"x");
        assert_eq!(files.opened().len(), 1);
    }

    #[test]
    fn folders_are_listed_inside_the_root_in_order_and_without_hidden_files() {
        let dir = tempfile::tempdir().unwrap();
        let base = dir.path();
        fs::create_dir_all(base.join("knocks/deeper")).unwrap();
        fs::create_dir_all(base.join("other")).unwrap();
        for name in ["knocks/b.wav", "knocks/a.wav", "knocks/.c.wav", "other/d.wav"] {
            fs::write(base.join(name), b"x").unwrap();
        }
        let list = |files: &DirFiles, p: &str| {
            let found = files.folder(base.join(p).to_str().unwrap()).map_err(|e| e.code)?;
            Ok(found.iter().map(|f| f.rsplit('/').next().unwrap_or_default().to_owned()).collect::<Vec<_>>())
        };
        let files = DirFiles::new(Root::of(&base.join("knocks/graph.ron")), Limits::default());
        assert_eq!(list(&files, "knocks").unwrap(), ["a.wav", "b.wav"]);
        assert_eq!(list(&files, "knocks/a.wav"), Err("F064"));
        assert_eq!((list(&files, "none"), list(&files, "other")), (Err("F060"), Err("F062")));
        assert!(files.asked().folders.contains(&base.join("knocks")));
        // A folder that is named on the command line may be anywhere.
        let mut root = Root::of(&base.join("knocks/graph.ron"));
        root.allow_named(&base.join("other"));
        assert_eq!(list(&DirFiles::new(root, Limits::default()), "other").unwrap(), ["d.wav"]);
    }
}
