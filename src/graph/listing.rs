//! Folders that are listed: their plain files, and numbered sequences.

use foley_nodes::core::files::number_in;
use std::fs;
use std::path::{Path, PathBuf};

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
