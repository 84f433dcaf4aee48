//! `foley new`.

use super::Exit;
use super::args::{NewArgs, OwnFiles, Template};
use super::console::{print_message, stdout};
use super::run::{note_lines, show};
use crate::session::Session;
use anyhow::Context as _;
use clap::ValueEnum as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A file of a new project.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Content {
    /// A text.
    Text(String),
    /// A file that comes with the program.
    Bytes(&'static [u8]),
    /// A copy of a file of the user.
    Copy(PathBuf),
}

impl OwnFiles {
    /// The template that uses these files, and the names of the options that it does not use.
    fn unused(&self, template: Template) -> Vec<&'static str> {
        use Template::{Cloth, Grains, Material, Numbers, Texture};
        let given = [
            ("--mesh", self.mesh.is_some(), &[Cloth, Material][..]),
            ("--recordings", !self.recordings.is_empty(), &[Cloth, Material, Grains, Numbers]),
            ("--image", self.image.is_some(), &[Texture]),
            ("--contacts", self.contacts.is_some(), &[Texture, Grains]),
        ];
        let unused = given.into_iter().filter(|(_, given, by)| *given && !by.contains(&template));
        unused.map(|(name, ..)| name).collect()
    }
}

/// A template with values in place of its placeholders; placeholders in the values remain unchanged.
fn filled(template: &str, values: &[(&str, String)]) -> String {
    let (mut out, mut rest) = (String::new(), template);
    let next = |rest: &str| {
        let found = values.iter().filter_map(|(mark, value)| Some((rest.find(mark)?, *mark, value)));
        found.min_by_key(|(at, ..)| *at).map(|(at, mark, value)| (at, at + mark.len(), value.clone()))
    };
    while let Some((at, end, value)) = next(rest) {
        out.push_str(&rest[..at]);
        out.push_str(&value);
        rest = &rest[end..];
    }
    out + rest
}

/// The name of a copy in a folder of the project.
fn copied(folder: &str, path: &Path) -> String {
    format!("{folder}/{}", path.file_name().unwrap_or_default().to_string_lossy())
}

/// The recordings of a template: their names in the project, and their contents.
fn recordings(template: Template) -> Vec<(String, Content)> {
    macro_rules! recordings {
        ($($name:literal),*) => {
            vec![$((
                format!("recordings/{}", $name),
                Content::Bytes(include_bytes!(concat!("../../graphs/assets/recordings/", $name))),
            )),*]
        };
    }
    match template {
        Template::Material => recordings!["metal_dull_1.flac", "metal_dull_2.flac", "metal_dull_3.flac"],
        Template::Grains => {
            recordings!["wood_hit_a1.flac", "wood_hit_a2.flac", "wood_hit_a3.flac", "scrape_stone_gate.flac"]
        }
        Template::Numbers => recordings!["birds.ogg"],
        _ => Vec::new(),
    }
}

/// The node `mesh`: the shape of an object, from the user or built in.
fn shape_node(mesh: Option<&Path>) -> String {
    let file = mesh.map_or_else(|| "bar.mesh".to_owned(), |path| copied("assets", path));
    let surface = has_extension(mesh, &["obj", "stl", "ply"]);
    if surface {
        let comment =
            "// Metres: `scale: 0.001` for a shape in millimetres. More cells are more exact, and slower.";
        return format!("        {comment}\n        \"mesh\": SurfaceToTets(path: {file:?}, cells: 12),");
    }
    format!(
        "        // Metres: `scale: 0.001` for a shape in millimetres.\n        \"mesh\": TetMeshFile(path: {file:?}),"
    )
}

/// Returns true for an animation in a format that states its times.
fn is_timed(mesh: &Path) -> bool {
    has_extension(Some(mesh), &["abc", "gltf", "glb", "mdd"])
}

/// Returns true for a file with one of these extensions, in any case.
fn has_extension(file: Option<&Path>, extensions: &[&str]) -> bool {
    let extension = file.and_then(Path::extension);
    extension.is_some_and(|found| extensions.iter().any(|wanted| found.eq_ignore_ascii_case(wanted)))
}

/// The node `cloth`: an animation of the user, or a synthetic one.
fn mesh_node(mesh: Option<&Path>, crumples: bool) -> String {
    let Some(path) = mesh else {
        // Friction needs something that slides, crumples something that bends.
        let scene = if crumples {
            "kind: SineSheet, amplitude: 0.02, wavelength: 0.4, speed: 0.3"
        } else {
            "kind: Planes, speed: 0.1, acceleration: 0.4, size: [3.0, 0.3], vertices: [61, 7]"
        };
        return format!("        \"cloth\": MeshGenerator({scene}, duration: 3.0),");
    };
    let file = copied("assets", path);
    if is_timed(path) {
        return format!("        \"cloth\": MeshSequence(path: {file:?}),");
    }
    format!(
        "        // This format does not store the frame rate: set that of the animation.\n        \
         \"cloth\": MeshSequence(path: {file:?}, fps: 30),"
    )
}

/// An OBJ with the faces of a point cache lies beside it under the same name.
fn faces_of(mesh: &Path) -> Option<PathBuf> {
    let cache = has_extension(Some(mesh), &["pc2", "mdd"]);
    Some(mesh.with_extension("obj")).filter(|path| cache && path.is_file())
}

/// The files of a new project, the graph first: names and contents.
fn project(name: &str, template: Template, own: &OwnFiles) -> Vec<(String, Content)> {
    let mut title: String = name.replace(['_', '-'], " ");
    if let Some(first) = title.chars().next() {
        title.replace_range(..first.len_utf8(), &first.to_uppercase().to_string());
    }
    let image = own.image.as_deref().map_or_else(|| "tiles.png".to_owned(), |path| copied("assets", path));
    let with_takes = !own.recordings.is_empty();
    let own_recordings =
        own.recordings.iter().map(|path| (copied("recordings", path), Content::Copy(path.clone())));
    let recordings = if with_takes { own_recordings.collect() } else { recordings(template) };
    let names: Vec<String> = recordings.iter().map(|(name, _)| format!("{name:?}")).collect();
    let text = match template {
        Template::Wind => include_str!("new/wind.ron"),
        Template::Impact => include_str!("new/impact.ron"),
        Template::Live => include_str!("new/live.ron"),
        Template::Texture if own.contacts.is_some() => include_str!("new/contacts.ron"),
        Template::Texture => include_str!("new/texture.ron"),
        Template::Cloth if with_takes => include_str!("new/cloth_recordings.ron"),
        Template::Cloth => include_str!("new/cloth.ron"),
        Template::Material => include_str!("new/material.ron"),
        Template::Grains if own.contacts.is_some() => include_str!("new/grains_contacts.ron"),
        Template::Grains => include_str!("new/grains.ron"),
        Template::Numbers => include_str!("new/numbers.ron"),
    };
    let mesh = match template {
        Template::Material => shape_node(own.mesh.as_deref()),
        _ => mesh_node(own.mesh.as_deref(), with_takes),
    };
    let contacts = own.contacts.as_deref().map_or_else(String::new, |path| copied("assets", path));
    let values = [
        ("MESH", mesh),
        ("RECORDINGS", format!("[{}]", names.join(", "))),
        ("CONTACTS", format!("{contacts:?}")),
        ("IMAGE", format!("{image:?}")),
        ("TITLE", format!("{title:?}")),
        ("FILE", format!("{:?}", format!("{name}.wav"))),
        ("NAME", name.to_owned()),
    ];
    let text = filled(text, &values);
    // Own names may be longer or shorter than those that the template was laid out with.
    let text = crate::lang::fmt::format(&text).unwrap_or(text);
    let mut files = vec![(format!("{name}.ron"), Content::Text(text))];
    let bar = || {
        (
            "bar.modes.csv".to_owned(),
            Content::Text(include_str!("../../graphs/assets/impact/bar.modes.csv").into()),
        )
    };
    let text = |name: &str, text: &str| (name.to_owned(), Content::Text(text.into()));
    match template {
        Template::Wind => {}
        Template::Impact | Template::Live => {
            files.extend([text("impacts.csv", include_str!("new/impacts.csv")), bar()]);
        }
        Template::Texture => {
            files.push(bar());
            if own.image.is_none() {
                files.push((image, Content::Bytes(include_bytes!("../../graphs/assets/images/tiles.png"))));
            }
        }
        Template::Cloth if with_takes => {
            files.push(text("lib/target.ron", include_str!("../../graphs/lib/target.ron")));
        }
        Template::Material => {
            let steel = include_str!("../../graphs/lib/materials/steel_wrench.material.ron");
            files.extend([
                text("impacts.csv", include_str!("new/strikes.csv")),
                text("steel.material.ron", steel),
            ]);
            if own.mesh.is_none() {
                files.push(text("bar.mesh", include_str!("../../graphs/assets/meshes/bar.mesh")));
            }
        }
        Template::Grains if own.contacts.is_none() => {
            files.push(text("taps.csv", include_str!("new/taps.csv")));
        }
        Template::Cloth | Template::Grains | Template::Numbers => {}
    }
    let assets =
        [own.mesh.clone(), own.mesh.as_deref().and_then(faces_of), own.image.clone(), own.contacts.clone()];
    files.extend(assets.into_iter().flatten().map(|path| (copied("assets", &path), Content::Copy(path))));
    files.extend(recordings);
    let values = [("NAME", name.to_owned()), ("CHANGE", change(template).to_owned())];
    let read_me = filled(include_str!("new/README.md"), &values);
    files.push(("README.md".into(), Content::Text(read_me)));
    files.push((".gitignore".into(), Content::Text("/out\n.foley/\n".into())));
    files
}

/// A setting to try first.
fn change(template: Template) -> &'static str {
    match template {
        Template::Wind => "cutoff=2000",
        Template::Impact | Template::Live => "pitch=0.5",
        Template::Texture | Template::Material | Template::Grains => "level=0.3",
        Template::Numbers => "seconds=60",
        Template::Cloth => "radius=0.01",
    }
}

/// The texts of the default project: names and contents.
#[must_use]
pub fn template(name: &str) -> Vec<(String, String)> {
    let text = |(name, content)| match content {
        Content::Text(text) => Some((name, text)),
        _ => None,
    };
    project(name, Template::Wind, &OwnFiles::default()).into_iter().filter_map(text).collect()
}

/// Reason for which the files of the user are refused: one is missing, or would replace another; `None` if all are right.
fn refused(own: &OwnFiles, template: Template, files: &[(String, Content)]) -> Option<String> {
    if let [option, ..] = own.unused(template)[..] {
        let name = template.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        return Some(format!("the template `{name}` has no use for {option}"));
    }
    for (k, (name, content)) in files.iter().enumerate() {
        let Content::Copy(path) = content else { continue };
        if !path.is_file() {
            return Some(format!("{} is not a file", path.display()));
        }
        if files[..k].iter().any(|(other, _)| other == name) {
            return Some(format!("two files would become {name}: give them different names"));
        }
    }
    None
}

/// Makes a small project that runs, of files of the user if any are given.
///
/// # Errors
/// When the folder or a file cannot be made.
pub fn new(args: &NewArgs) -> anyhow::Result<Exit> {
    let dir = &args.dir;
    let shown = dir.display();
    if fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_some()) || dir.is_file() {
        print_message(format_args!("{shown} exists already and is not empty"));
        return Ok(Exit::Wrong);
    }
    let own = &args.own;
    // The first template that uses all files.
    let order = [Template::Wind, Template::Cloth, Template::Texture, Template::Grains];
    let by_files = order.into_iter().find(|template| own.unused(*template).is_empty());
    let Some(template) = args.template.or(by_files) else {
        print_message(
            "no template uses all of these files: leave some out, and link them in the graph, or choose with --template",
        );
        return Ok(Exit::Wrong);
    };
    // The folder may be `.`, and may not exist yet.
    let absolute = std::path::absolute(dir).ok();
    let name =
        absolute.as_deref().and_then(Path::file_name).and_then(|name| name.to_str().map(str::to_owned));
    let name = name.unwrap_or_else(|| "sound".into());
    let files = project(&name, template, own);
    if let Some(wrong) = refused(own, template, &files) {
        print_message(wrong);
        return Ok(Exit::Wrong);
    }
    let existed = dir.is_dir();
    if let Err(error) = write(dir, &files) {
        // The folder was empty, or was not there.
        let _ = fs::remove_dir_all(dir);
        if existed {
            let _ = fs::create_dir(dir);
        }
        return Err(error);
    }
    let found = Session::from_file(dir.join(format!("{name}.ron"))).check();
    if found.any_error() {
        show(&found.diagnostics, &found.sources);
        print_message("these files do not make a project; nothing was made");
        let _ = fs::remove_dir_all(dir);
        if existed {
            let _ = fs::create_dir(dir);
        }
        return Ok(Exit::Wrong);
    }
    note_lines(found.notes.iter()).iter().try_for_each(|line| writeln!(stdout(), "{line}"))?;
    if template == Template::Cloth && has_extension(own.mesh.as_deref(), &["pc2"]) {
        writeln!(
            stdout(),
            "note: a PC2 file does not store its frame rate: `fps: 30` is a guess, set it in {name}.ron"
        )?;
    }
    let verb = if template == Template::Live { "live" } else { "run" };
    writeln!(stdout(), "made {shown}; now: cd {shown} && foley {verb} {name}.ron")?;
    Ok(Exit::Done)
}

/// Writes the files of a project.
fn write(dir: &Path, files: &[(String, Content)]) -> anyhow::Result<()> {
    for (file, content) in files {
        let path = dir.join(file);
        let place = || path.display().to_string();
        fs::create_dir_all(path.parent().unwrap_or(dir)).with_context(place)?;
        match content {
            Content::Text(text) => fs::write(&path, text),
            Content::Bytes(bytes) => fs::write(&path, bytes),
            Content::Copy(from) => fs::copy(from, &path).map(drop),
        }
        .with_context(place)?;
    }
    Ok(())
}
