//! Opens files of a cache, which anybody may have written: plain files only, never the target of a link, a pipe or a device.

use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// Maximum bytes of a file that is not an entry: key histories, costs and checkpoints.
pub const MAX_BYTES: u64 = 1 << 30;

fn refuse_other(meta: &Metadata) -> io::Result<()> {
    if meta.is_file() {
        Ok(())
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no plain file"))
    }
}

/// Opens a plain file.
///
/// # Errors
/// As [`File::open`], and for anything but a plain file, which is not opened.
pub fn open(path: &Path) -> io::Result<File> {
    // Before it is opened: to open a pipe waits for its other end.
    refuse_other(&fs::symlink_metadata(path)?)?;
    let file = File::open(path)?;
    refuse_other(&file.metadata()?)?;
    Ok(file)
}

/// Reads a plain file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; if reading fails; and if the file is larger.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    if file.metadata()?.len() > most {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "it is larger than the whole cache may be"));
    }
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn links_pipes_devices_and_large_files_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("plain"), b"12345").unwrap();
        std::os::unix::fs::symlink(at("plain"), at("link")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", at("device")).unwrap();
        assert!(Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        assert_eq!(read(&at("plain"), 5).unwrap(), b"12345");
        assert_eq!(read(&at("plain"), 4).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        for other in [at("link"), at("device"), at("pipe"), folder.path().to_owned(), "/dev/zero".into()] {
            assert_eq!(read(&other, 100).unwrap_err().kind(), io::ErrorKind::InvalidInput, "{other:?}");
        }
        assert_eq!(read(&at("none"), 1).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
