//! `foley new`.

use super::Exit;
use super::args::NewArgs;
use super::console::stdout;
use anyhow::Context as _;
use std::fs;
use std::io::Write as _;

/// The files of a new project: names and texts.
#[must_use]
pub fn template(name: &str) -> [(&'static str, String); 3] {
    let read_me = include_str!("new/README.md").replace("NAME", name);
    [
        ("wind.ron", include_str!("new/wind.ron").into()),
        ("README.md", read_me),
        (".gitignore", "/out\n.foley/\n".into()),
    ]
}

/// Makes a small project that runs.
///
/// # Errors
/// When the folder or a file cannot be made.
pub fn new(args: &NewArgs) -> anyhow::Result<Exit> {
    let dir = &args.dir;
    let shown = dir.display();
    if fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_some()) || dir.is_file() {
        super::console::tell(format_args!("{shown} exists already and is not empty"));
        return Ok(Exit::Wrong);
    }
    fs::create_dir_all(dir).with_context(|| shown.to_string())?;
    let name = fs::canonicalize(dir).ok().and_then(|d| d.file_name()?.to_str().map(str::to_owned));
    for (file, text) in template(&name.unwrap_or_else(|| "A sound".into())) {
        let path = dir.join(file);
        fs::write(&path, text).with_context(|| path.display().to_string())?;
    }
    writeln!(stdout(), "made {shown}; now: cd {shown} && foley run wind.ron")?;
    Ok(Exit::Done)
}
