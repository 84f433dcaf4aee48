//! A reader who follows the book: saves its graphs, runs its commands and compares what they print.
//!
//! A comment on the line before a block says what to do with it:
//!
//! | comment | block |
//! |---|---|
//! | `<!-- DIR/NAME.ron -->` | a whole file is saved there; a piece of a graph is laid over the graph that is there |
//! | `<!-- undo DIR/NAME.ron -->` | none: the last piece is taken off that graph |
//! | `<!-- over DIR/NAME.ron NODES -->` | a piece and these nodes are laid over a graph and run, and the graph stays as it is |
//! | `<!-- with NODES -->` | the nodes of a piece are probed together with these |
//! | `<!-- from PATH -->` | part of a file that the commands before wrote |
//! | `<!-- long -->` | run only by the ignored test |
//! | `<!-- not run: REASON -->` | not run |
//!
//! The synopsis of a command is not run. Under the same heading, a block of text without a command after a block of commands is part of what they print.

use crate::common::{graphs, write_wav};
use foley_nodes::io::AudioReader;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// One block of code.
pub struct Block {
    /// `PAGE:LINE`, for messages.
    pub at: String,
    /// Directive of the comment before it.
    pub mark: Mark,
    pub language: String,
    pub text: String,
}

impl Block {
    /// A directive without a text.
    fn of_mark(mark: Mark, page: &str, line: usize) -> Self {
        let at = format!("{page}:{}", line + 1);
        Self { at, mark, language: String::new(), text: String::new() }
    }
}

/// Directive of a comment for a block.
#[derive(Clone, PartialEq)]
pub enum Mark {
    None,
    File(String),
    Undo(String),
    Over(String, String),
    With(String),
    From(String),
    Long,
    NotRun,
}

impl Mark {
    fn of(comment: &str) -> Self {
        let comment = comment.trim();
        match comment.split_once(char::is_whitespace) {
            Some(("undo", graph)) => Self::Undo(graph.trim().to_owned()),
            Some(("over", rest)) => {
                let (graph, nodes) = rest.trim().split_once(char::is_whitespace).unwrap_or((rest.trim(), ""));
                Self::Over(graph.to_owned(), nodes.trim().to_owned())
            }
            Some(("from", path)) => Self::From(path.trim().to_owned()),
            Some(("with", nodes)) => Self::With(nodes.trim().to_owned()),
            Some(("not", _)) => Self::NotRun,
            None if comment == "long" => Self::Long,
            None if comment.ends_with(".ron") => Self::File(comment.to_owned()),
            _ => panic!("an unknown comment before a block: {comment}"),
        }
    }
}

/// The blocks of a page.
pub fn blocks(name: &str, page: &str) -> Vec<Block> {
    let mut found = Vec::new();
    let mut mark = Mark::None;
    let mut lines = page.lines().enumerate();
    while let Some((line, text)) = lines.next() {
        if text.starts_with('#') {
            // What is printed under another heading is not that of the commands before it.
            found.push(Block::of_mark(Mark::NotRun, name, line));
        } else if let Some(comment) = text.strip_prefix("<!--") {
            let mut comment = format!("{comment}\n");
            while !comment.contains("-->") {
                let (_, more) = lines.next().expect("a comment ends");
                comment.push_str(&format!("{more}\n"));
            }
            mark = Mark::of(comment.split("-->").next().unwrap());
            if matches!(mark, Mark::Undo(_)) {
                found.push(Block::of_mark(std::mem::replace(&mut mark, Mark::None), name, line));
            }
        } else if let Some(language) = text.strip_prefix("```") {
            let inside = lines.by_ref().map(|(_, l)| l).take_while(|l| *l != "```");
            let text = inside.map(|l| format!("{l}\n")).collect();
            let block = Block::of_mark(std::mem::replace(&mut mark, Mark::None), name, line);
            found.push(Block { language: language.to_owned(), text, ..block });
        } else {
            mark = Mark::None;
        }
    }
    found
}

/// The commands of a block of text: lines that begin with a program that a reader runs, without the remark in a
/// second column. `watch` and `live` do not end: their graphs are checked.
pub fn commands(text: &str) -> Vec<String> {
    let joined = text.split("\\\n").map(str::trim_start).collect::<Vec<_>>().join(" ");
    let lines = joined.lines().map(|line| line.split("    ").next().unwrap().trim_end());
    let ours = lines.filter(|line| {
        ["foley ", "cp ", "mv ", "cat ", "cd ", "(echo "].iter().any(|start| line.starts_with(start))
    });
    ours.map(|line| match line.split_whitespace().find(|word| word.ends_with(".ron")) {
        Some(graph) if line.contains("foley watch ") || line.contains("foley live ") => {
            format!("foley check {graph}")
        }
        _ => line.to_owned(),
    })
    .collect()
}

/// A folder in which a reader works.
pub struct Reader {
    folder: tempfile::TempDir,
    /// Graphs with pieces over them, and the names that the graphs below have.
    layers: Vec<(PathBuf, PathBuf)>,
}

impl Reader {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        copy(&graphs(), &root.join("graphs"));
        // `../assets` of a copy of a graph in another folder.
        copy(&graphs().join("assets"), &root.join("assets"));
        own_files(root);
        Self { folder, layers: Vec::new() }
    }

    /// Saves a file, or lays a piece over the graph that is there.
    pub fn save(&mut self, block: &Block, path: &str) -> Result<(), String> {
        let target = self.folder.path().join(path);
        if block.language == "text" || block.text.starts_with("#![schema") {
            fs::create_dir_all(target.parent().unwrap()).unwrap();
            return fs::write(target, &block.text).map_err(|e| format!("{path}: {e}"));
        }
        let base = target.with_extension(format!("{}.ron", self.layers.len()));
        fs::rename(&target, &base).map_err(|e| format!("{path}: {e}"))?;
        let name = base.file_name().unwrap().to_string_lossy();
        fs::write(&target, whole(&format!("extends: \"{name}\",\n"), "", &block.text)).unwrap();
        self.layers.push((target, base));
        Ok(())
    }

    /// Compares a block with a file.
    fn compare(&self, block: &Block, path: &str) -> Result<(), String> {
        let text = fs::read_to_string(self.folder.path().join(path)).map_err(|e| format!("{path}: {e}"))?;
        missing(&block.text, &text).map_or(Ok(()), |line| Err(format!("not in {path}: {line}")))
    }

    /// Takes the last piece off a graph.
    pub fn undo(&self, path: &str) -> Result<(), String> {
        let target = self.folder.path().join(path);
        let base = self.layers.iter().rev().find(|(over, _)| *over == target).ok_or("nothing to undo")?;
        fs::rename(&base.1, target).map_err(|e| e.to_string())
    }

    /// Runs a piece over a graph or together with other nodes.
    pub fn run_piece(&self, block: &Block) -> Result<String, String> {
        let mut probes = Vec::new();
        let (path, text) = match &block.mark {
            Mark::Over(graph, nodes) => {
                let (folder, name) = graph.rsplit_once('/').unwrap_or((".", graph));
                (format!("{folder}/piece.ron"), whole(&format!("extends: \"{name}\",\n"), nodes, &block.text))
            }
            Mark::With(nodes) => {
                let ids = block
                    .text
                    .lines()
                    .filter(|line| !line.contains("WavOut("))
                    .filter_map(|line| line.strip_prefix('"')?.split('"').next());
                probes.extend(ids.map(|id| format!("foley probe piece.ron {id} > probed.txt\n")));
                ("piece.ron".to_owned(), whole("", nodes, &block.text))
            }
            _ => return Err("no comment says how to run this piece".to_owned()),
        };
        fs::write(self.folder.path().join(&path), text).unwrap();
        self.shell(&format!("foley run {path} --quiet --out piece --until 10\n{}", probes.concat()))
    }

    /// Reads a file by a node.
    fn probe(&self, node: &str, path: &str) -> Result<String, String> {
        let text = whole("", &format!("\"it\": {node}(path: \"{path}\"),"), "\"air\": Noise(rate: 48000),\n");
        fs::write(self.folder.path().join("probe.ron"), text).unwrap();
        self.shell("foley probe probe.ron it")
    }

    /// Runs commands and returns their output.
    pub fn shell(&self, commands: &str) -> Result<String, String> {
        let binary = Path::new(env!("CARGO_BIN_EXE_foley")).parent().unwrap();
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders = [binary.to_path_buf()].into_iter().chain(std::env::split_paths(&path));
        let output = Command::new("sh")
            .args(["-e", "-c", &format!("exec 2>&1\n{commands}")])
            .current_dir(self.folder.path())
            .env("PATH", std::env::join_paths(folders).unwrap())
            .env("NO_COLOR", "1")
            .output()
            .unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        if output.status.success() { Ok(printed) } else { Err(format!("\n{commands}\n{printed}")) }
    }
}

/// The node that reads a file.
fn reads(path: &str) -> Option<&'static str> {
    let nodes = [(".material.ron", "MaterialFile"), (".score.ron", "ScoreFile")];
    nodes.iter().find(|(end, _)| path.ends_with(end)).map(|(_, node)| *node)
}

/// A graph of a piece, which begins with an id if it is one of `nodes`.
fn whole(fields: &str, nodes: &str, piece: &str) -> String {
    let schema = "#![schema = \"foley:graph/1\"]\n";
    if piece.trim_start().starts_with('"') {
        format!("{schema}Graph({fields}nodes: {{\n{nodes}\n{piece}}})")
    } else if nodes.is_empty() {
        format!("{schema}Graph({fields}{piece})")
    } else {
        format!(
            "{schema}Graph({fields}{}",
            piece.replacen("nodes: {", &format!("nodes: {{\n{nodes}"), 1) + ")"
        )
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            if entry.file_name() != ".foley" {
                copy(&entry.path(), &target);
            }
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Files that the book calls the reader's own: recordings, a log, an animation and materials under other names.
fn own_files(root: &Path) {
    let assets = root.join("assets");
    let sounds = [
        ("wood_hit_a1.flac", "knock.wav"),
        ("blanket_movement_1.flac", "rustle_1.wav"),
        ("blanket_movement_2.flac", "rustle_2.wav"),
        ("birds.ogg", "voice.wav"),
        ("birds.ogg", "scene/rain.wav"),
        ("wood_hit_a1.flac", "scene/knocks/stone_1.wav"),
        ("rock_hit_1.flac", "scene/knocks/stone_2.wav"),
        ("wood_hit_a1.flac", "recording.flac"),
        ("blanket_movement_1.flac", "out/sheet.wav"),
    ];
    for (from, to) in sounds {
        sound(&assets.join("recordings").join(from), &root.join(to));
    }
    write_wav(&root.join("roller.wav"), 2, 48_000, roller());
    let files = [
        ("contacts/ball_bounce_roll.contacts.csv", "scene/contacts.csv"),
        ("cloth/sheet.correspondences.ron", "graphs/cloth/my.correspondences.ron"),
        ("images/sk_brick.png", "floor.png"),
        ("images/sk_brick.png", "wood.png"),
        ("contacts/ball_bounce_roll.contacts.csv", "dice.csv"),
    ];
    for (from, to) in files {
        let to = root.join(to);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(assets.join(from), to).unwrap();
    }
    let parts = [
        (
            "hall.ron",
            r#"params: { "delay": 0.11 }, nodes: {
    "air": Noise(rate: 44100, duration: Some(0.2)),
    "room": Delay(audio: "air", seconds: "$delay"),
}"#,
        ),
        (
            "voice.ron",
            r#"params: { "frequency": 220.0, "level": 0.1 }, nodes: {
    "tone": Tone(frequency: "$frequency", level: "$level", duration: Some(0.2), rate: 48000),
}"#,
        ),
    ];
    for (name, fields) in parts {
        fs::write(root.join(name), whole("", "", fields)).unwrap();
    }
    // The graph of `foley new wind`, which several pages run.
    fs::write(root.join("wind.ron"), &foley::cli::template("wind")[0].1).unwrap();
    fs::write(root.join("graphs/grains/taps.csv"), "time_s,gain,index,ratio\n0.4,0.6,0,1.5\n").unwrap();
    fs::create_dir_all(root.join("materials")).unwrap();
    for name in ["a", "b", "c", "d"] {
        let from = root.join("graphs/lib/materials/wood_block.material.ron");
        fs::copy(from, root.join(format!("materials/{name}.material.ron"))).unwrap();
    }
}

/// A roller at five speeds, two seconds each: noise that grows with the speed, and the speed.
fn roller() -> impl Iterator<Item = i16> {
    let mut random = 1_u32;
    (0..5 * 96_000).flat_map(move |k| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let speed = 4000 * (k / 96_000 + 1);
        let noise = (f64::from(random >> 16) / 32_768.0 - 1.0) * f64::from(speed);
        [noise as i16, speed as i16]
    })
}

/// Writes a recording as WAV.
fn sound(from: &Path, to: &Path) {
    let mut reader = AudioReader::open(Box::new(fs::File::open(from).unwrap())).unwrap();
    let rate = reader.info().rate;
    let samples = reader.read_mono().unwrap();
    fs::create_dir_all(to.parent().unwrap()).unwrap();
    write_wav(to, 1, rate, samples.into_iter().map(|x| (x * 32_767.0) as i16));
}

/// The first line of an excerpt that is not in the output. Numbers agree within 1 %.
pub fn missing<'a>(excerpt: &'a str, printed: &str) -> Option<&'a str> {
    let lines: Vec<&str> = printed.lines().collect();
    excerpt.lines().find(|line| {
        !line.trim().is_empty()
            && line.trim() != "..."
            && !lines.iter().any(|found| alike(line.trim(), found.trim()))
    })
}

fn alike(wanted: &str, found: &str) -> bool {
    let words = |text: &str| -> Vec<String> {
        let cuts = |c: char| c.is_whitespace() || "[](),:%".contains(c);
        text.split(cuts).filter(|word| !word.is_empty()).map(str::to_owned).collect()
    };
    let (wanted, found) = (words(wanted), words(found));
    // `...` stands for any words in between.
    let parts: Vec<&[String]> = wanted.split(|word| word == "...").collect();
    let mut at = 0;
    for (k, part) in parts.iter().enumerate() {
        let Some(offset) = (0..=found.len().saturating_sub(at + part.len())).find(|o| {
            found.len() >= at + o + part.len() && part.iter().zip(&found[at + o..]).all(|(a, b)| same(a, b))
        }) else {
            return false;
        };
        if k == 0 && offset > 0 {
            return false;
        }
        at += offset + part.len();
    }
    parts.len() > 1 || at == found.len()
}

fn same(a: &str, b: &str) -> bool {
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs() <= 0.01 * a.abs().max(b.abs()).max(0.01),
        _ => a == b,
    }
}

/// Follows a page from its begin to its end, and lists the differences from the page.
pub fn follow(name: &str, page: &str, long: bool) -> Vec<String> {
    let mut reader = Reader::new();
    let (mut printed, mut folder) = (String::new(), String::new());
    let mut wrong = Vec::new();
    for block in blocks(name, page) {
        let own = if block.language == "text" { commands(&block.text) } else { Vec::new() };
        let result = match &block.mark {
            Mark::NotRun => Ok(String::new()),
            Mark::Long if !long => Ok(String::new()),
            _ if block.text.contains(" GRAPH") || block.text.contains(" [--") => Ok(String::new()),
            Mark::Undo(path) => reader.undo(path).map(|()| printed.clone()),
            Mark::From(path) => reader.compare(&block, path).map(|()| printed.clone()),
            Mark::File(path) => {
                let run = block.language == "ron" && !page.contains(&format!("foley run {path}"));
                reader.save(&block, path).and_then(|()| match reads(path) {
                    Some(node) => reader.probe(node, path),
                    None if run => reader.shell(&format!("foley run {path} --quiet --out piece")),
                    None => Ok(String::new()),
                })
            }
            _ if block.language == "ron" => reader.run_piece(&block),
            _ if block.language != "text" => Ok(printed.clone()),
            _ if !own.is_empty() => {
                let entered: Vec<_> = own.iter().filter(|line| line.starts_with("cd ")).cloned().collect();
                let result = reader.shell(&format!("{folder}{}", own.join("\n")));
                entered.iter().for_each(|line| folder.push_str(&format!("{line}\n")));
                result
            }
            _ if printed.is_empty() => Ok(String::new()),
            _ => match missing(&block.text, &printed) {
                Some(line) => Err(format!("not printed: {line}\n{printed}")),
                None => Ok(printed.clone()),
            },
        };
        printed = result.unwrap_or_else(|error| {
            wrong.push(format!("{}: {error}", block.at));
            String::new()
        });
    }
    wrong
}

#[test]
fn what_is_not_printed_is_found() {
    let printed =
        "wrote out/a.wav: 1.000 s, 48000 Hz, peak 0.5012\n  centroid    3757 Hz\nfrequencies: [1, 2, 3]\n";
    let is_missing = |excerpt| missing(excerpt, printed).is_some();
    assert!(!is_missing("wrote out/a.wav: 1.000 s, 48000 Hz, peak 0.5030\n\n  centroid 3757 Hz"));
    assert!(!is_missing("frequencies: [1, ... 3]") && !is_missing("wrote out/a.wav ..."));
    assert!(is_missing("wrote out/a.wav: 1.000 s, 48000 Hz, peak 0.6"));
    assert!(is_missing("wrote out/b.wav: 1.000 s, 48000 Hz, peak 0.5012"));
    assert!(is_missing("centroid 3757") && is_missing("centroid 3757 Hz 1"));
    assert!(is_missing("frequencies: [1, ... 4]") && is_missing("frequencies: [2, ... 3]"));
}

#[test]
fn commands_are_those_that_a_reader_types() {
    let text = "foley run a.ron \\\n    --until 1\nfoley nodes       all node types\nwrote b.wav\nfoley watch c.ron --live\n";
    assert_eq!(commands(text), ["foley run a.ron  --until 1", "foley nodes", "foley check c.ron"]);
    let page =
        "<!-- over a.ron\n\"x\": Y, -->\n```ron\n\"z\": Z,\n```\n<!-- long -->\n```text\nfoley nodes\n```\n";
    let found = blocks("page", page);
    assert!(
        found[0].mark == Mark::Over("a.ron".into(), "\"x\": Y,".into()) && found[0].text == "\"z\": Z,\n"
    );
    assert!(found[1].mark == Mark::Long && found[1].language == "text");
}
