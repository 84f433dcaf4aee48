//! Files that are written under a temporary name and then renamed, so that no reader sees a part of one.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Returns a path beside a file that no other thread or process uses, and creates the folder.
///
/// # Errors
/// When the folder cannot be created.
pub fn temporary_path(path: &Path) -> io::Result<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    name.push(format!(".{}-{count}.part", std::process::id()));
    Ok(path.with_file_name(name))
}

/// Writes a file under a temporary name, syncs it, and renames it.
///
/// # Errors
/// When it cannot be written or renamed.
pub fn write_atomically(path: &Path, pieces: &[&[u8]]) -> io::Result<()> {
    let part = temporary_path(path)?;
    let write = || {
        let mut file = File::create(&part)?;
        pieces.iter().try_for_each(|piece| file.write_all(piece))?;
        file.sync_all()?;
        fs::rename(&part, path)
    };
    write().inspect_err(|_| {
        let _ = fs::remove_file(&part);
    })
}
