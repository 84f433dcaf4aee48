//! Figures of the book: the commands beside their numbers, and the contents of their drawings.

use super::foley;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The commands of the rows of a table that begin with a figure's number, in order, as their words after `foley run`. One that begins
/// with `--set` is the first of its row with another number, and writes its own file.
pub fn commands(book: &str, row: &str) -> Vec<Vec<String>> {
    book.lines().filter(|line| line.starts_with(&format!("| {row}, "))).flat_map(commands_of_row).collect()
}

fn commands_of_row(row: &str) -> Vec<Vec<String>> {
    let parts: Vec<&str> = row.split('`').skip(1).step_by(2).collect();
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let first = words(parts[0]);
    assert_eq!(first[..2], ["foley", "run"], "{row}");
    let rest = parts[1..].iter().map(|part| [first[2..].to_vec(), words(part)].concat());
    std::iter::once(first[2..].to_vec()).chain(rest).collect()
}

/// The drawing of the `foley graph` command in the row of a figure.
pub fn graph(book: &str, row: &str) -> String {
    let row = book.lines().find(|line| line.starts_with(&format!("| {row}, "))).unwrap();
    let words: Vec<&str> = row.split('`').nth(1).unwrap().split_whitespace().collect();
    assert_eq!((&words[..2], words[3]), (&["foley", "graph"][..], "--svg"), "{row}");
    let folder: TempDir = tempfile::tempdir().unwrap();
    let file = folder.path().join(words[4]);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["graph", words[2], "--svg"]).arg(&file);
    let ran = command.output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    fs::read_to_string(file).unwrap()
}

/// The documents of the panels within a drawing, from left to right.
pub fn panels(svg: &str) -> Vec<&str> {
    svg.split("<svg x=").skip(1).map(|rest| rest.split("</svg>").next().unwrap()).collect()
}

/// The output of a command of the book, in the order of its taps.
pub fn run(command: &[String]) -> Vec<String> {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let mut words: Vec<String> = vec!["run".into()];
    let mut files = Vec::new();
    for (k, word) in command.iter().enumerate() {
        match word.split_once('=').filter(|_| k > 0 && command[k - 1] == "--tap") {
            Some((port, file)) => {
                let file = Path::new(folder.path()).join(file);
                words.push(format!("{port}={}", file.display()));
                files.push(file);
            }
            None => words.push(word.clone()),
        }
    }
    foley(folder.path(), &words.iter().map(String::as_str).collect::<Vec<_>>());
    files.iter().map(|file| fs::read_to_string(file).unwrap()).collect()
}

/// The values of an attribute, in order, of elements that hold some text.
pub fn values<'a>(svg: &'a str, element: &str, holds: &str, attribute: &str) -> Vec<&'a str> {
    let open = format!("<{element} ");
    let own = svg.split(&open).skip(1).map(|rest| rest.split('>').next().unwrap_or_default());
    let own = own.filter(|element| element.contains(holds));
    own.map(|element| element.split(&format!("{attribute}=\"")).nth(1).unwrap().split('"').next().unwrap())
        .collect()
}

pub fn numbers(svg: &str, element: &str, holds: &str, attribute: &str) -> Vec<f64> {
    values(svg, element, holds, attribute).iter().map(|text| text.parse().unwrap()).collect()
}

/// Heights of the points of every line: up is more.
pub fn heights(svg: &str) -> Vec<Vec<f64>> {
    let height = |point: &str| -point.split_once(',').unwrap().1.parse::<f64>().unwrap();
    values(svg, "polyline", "", "points").iter().map(|line| line.split(' ').map(height).collect()).collect()
}

pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Texts in the drawing with a suffix, without that suffix.
pub fn labels<'a>(svg: &'a str, end: &str) -> Vec<&'a str> {
    let texts = svg.split("</text>").filter_map(|part| Some(part.rsplit_once('>')?.1));
    texts.filter_map(|text| text.strip_suffix(end)).collect()
}
