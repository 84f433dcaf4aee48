//! The folders and files that a graph may read.

use super::asked::{Asked, Stamp};
use super::listing::matching;
use foley_nodes::core::files::FileError;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The folders and files that a graph may read: its own folder, `assets` and `lib` beside it, and what the user allowed.
#[derive(Clone, Debug, Default)]
pub struct Root {
    folders: Vec<PathBuf>,
    files: Vec<PathBuf>,
    /// Numbered sequences whose folders may be listed for them alone.
    pub(super) patterns: Vec<PathBuf>,
    /// Shared by all copies, so that it includes the files that nodes open.
    pub(super) asked: Arc<Mutex<Asked>>,
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
    pub(super) fn real(&self, path: &str) -> Result<PathBuf, FileError> {
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
}
