//! The command as it runs in a folder, without colours.

use std::path::Path;
use std::process::{Command, Output};

pub fn foley(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_foley"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .unwrap()
}
