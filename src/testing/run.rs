//! Runs the cases of a test file in memory.

use super::checks::{CODE, Check, Kind};
use super::file::{Case, Expected, TestFile};
use super::recording::{Recorder, Recording, read_audio};
use super::verdict::{Verdict, judge, same_samples};
use crate::diag::{Diagnostic, SourceLocation, Sources};
use crate::graph::{Graph, LoadOptions, output_path, suggestion, written};
use crate::lang::Span;
use crate::run::{ObserverTap, find_output};
use crate::session::{Errors, Session};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Window of the second run of [`Kind::Repeats`], s: no multiple of the default window.
const OTHER_WINDOW: f64 = 0.0071;

/// Settings of all cases.
#[derive(Clone, Debug)]
pub struct Runner {
    /// Options with which graphs are loaded.
    pub options: LoadOptions,
    /// Threads that compute; all cores if `None`.
    pub threads: Option<usize>,
}

/// Reason for which a case could not be run: mistakes in the graph or the test file, or faults of nodes.
#[derive(Clone, Debug)]
pub struct CaseError {
    /// The mistakes.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts that they point into.
    pub sources: Sources,
}

impl From<Errors> for CaseError {
    fn from(errors: Errors) -> Self {
        Self { diagnostics: errors.diagnostics, sources: errors.sources }
    }
}

/// Content that a check stores.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stored {
    /// A digest in the test file: the location of its check, and the digest.
    Digest(Span, String),
    /// A file.
    File(PathBuf, Vec<u8>),
}

/// The result of one check.
#[derive(Clone, Debug)]
pub struct CheckResult {
    /// The output.
    pub output: String,
    /// The check, with its time.
    pub check: String,
    /// Its location in the test file.
    pub span: Span,
    /// The result.
    pub verdict: Verdict,
    /// Content that `--write` would store, if it differs from the stored content.
    pub stored: Option<Stored>,
}

/// Source of the content of an output.
#[derive(Clone, Debug)]
enum Source {
    /// A file of the graph: the node that writes it, and its path.
    File(String, PathBuf),
    /// An output of a node.
    Output,
}

/// One run: its differences from the case as it is written.
#[derive(Clone, Copy, Debug, Default)]
struct Variant {
    seed: Option<u64>,
    other_window: bool,
}

/// Finds the file or output that a name refers to.
fn source(graph: &Graph, expected: &Expected, file: usize) -> Result<Source, Diagnostic> {
    let wanted = output_path(&expected.output).ok();
    let files = graph
        .nodes
        .iter()
        .flat_map(|node| written(&node.ty, &*node.params).map(move |(_, path)| (node, path)));
    let files: Vec<(&str, PathBuf)> =
        files.filter_map(|(node, path)| Some((node.id.as_str(), output_path(&path).ok()?))).collect();
    if let Some((node, path)) = files.iter().find(|(_, path)| wanted.as_ref() == Some(path)) {
        return Ok(Source::File((*node).to_owned(), path.clone()));
    }
    match find_output(graph, &expected.output) {
        Ok(_) => Ok(Source::Output),
        Err(found) => {
            let outputs =
                graph.nodes.iter().flat_map(|n| n.ty.outputs.iter().map(|p| format!("{}.{}", n.id, p.name)));
            let names: Vec<String> =
                files.iter().map(|(_, path)| path.display().to_string()).chain(outputs).collect();
            let all = suggestion(&expected.output, "files and outputs", names.iter().map(String::as_str));
            // The advice about outputs is better where no name of a file is near, and where the node is there.
            let known = graph.find(expected.output.split('.').next().unwrap_or_default()).is_some();
            let meant = |help: &str| help.starts_with("did you mean");
            let help = found.help.filter(|help| known || meant(help) && !meant(&all)).unwrap_or(all);
            let message = format!("the graph has no file or output `{}`", expected.output);
            Err(Diagnostic::error(CODE, message, SourceLocation { file, span: expected.span.clone() })
                .help(help))
        }
    }
}

impl Runner {
    fn session(&self, file: &TestFile, case: &Case, variant: Variant) -> Session {
        let folder = file.graph.parent().map(Path::to_owned).unwrap_or_default();
        let options = LoadOptions { override_folder: folder, ..self.options.clone() };
        let session = Session::from_file(&file.graph).with_load_options(options).with_quiet(true);
        let threads = if variant.other_window { Some(1) } else { self.threads };
        let mut session =
            session.with_seed(variant.seed.or(case.seed)).with_until(case.until).with_threads(threads);
        if variant.other_window {
            session = session.with_window(OTHER_WINDOW);
        }
        case.sets.iter().for_each(|set| session.set(&set.target, &set.value));
        session
    }

    /// Runs a case, and returns the content of each output.
    fn record(
        &self,
        file: &TestFile,
        case: &Case,
        sources: &BTreeMap<&str, Source>,
        variant: Variant,
    ) -> Result<BTreeMap<String, Recording>, CaseError> {
        let ends = sources.values().filter_map(|source| match source {
            Source::File(node, _) => Some(node.clone()),
            Source::Output => None,
        });
        let mut session = self.session(file, case, variant).with_only(ends.collect::<Vec<_>>());
        let mut taps = BTreeMap::new();
        for (output, _) in sources.iter().filter(|(_, source)| matches!(source, Source::Output)) {
            let tap = Arc::new(ObserverTap::new(Recorder::new()));
            session.tap(*output, &tap);
            taps.insert(*output, tap);
        }
        let (report, memory) = session.render_to_memory()?;
        let recording = |(output, source): (&&str, &Source)| {
            let recording = match source {
                Source::Output => taps.get(output).map(|tap| tap.read(Recorder::recording)),
                Source::File(node, path) => memory.get(&path.to_string_lossy()).map(|bytes| {
                    let summary = report.nodes.iter().find(|n| n.id == *node).map(|n| &n.summary);
                    let clipped = summary.and_then(|facts| facts.get("clipped")?.as_u64()).unwrap_or(0);
                    Recording::of_file(path, bytes, clipped)
                }),
            };
            (
                (*output).to_owned(),
                recording.unwrap_or_else(|| Recording::Nothing("no file was written".to_owned())),
            )
        };
        Ok(sources.iter().map(recording).collect())
    }
}

/// Runs the checks of a case for which `wanted` is true; `file_number` is the test file in `sources`.
///
/// # Errors
/// If the graph or the test file is wrong, or a node fails.
pub fn run(
    runner: &Runner,
    (file, sources, file_number): (&TestFile, &Sources, usize),
    case: &Case,
    wanted: &dyn Fn(&Expected, &Check) -> bool,
) -> Result<Vec<CheckResult>, CaseError> {
    let checks: Vec<(&Expected, &Check)> = (case.outputs.iter())
        .flat_map(|output| output.checks.iter().map(move |check| (output, check)))
        .filter(|(output, check)| wanted(output, check))
        .collect();
    if checks.is_empty() {
        return Ok(Vec::new());
    }
    let (loaded, _) = runner.session(file, case, Variant::default()).load();
    let Some(graph) = loaded.graph else {
        return Err(CaseError { diagnostics: loaded.diagnostics, sources: loaded.sources });
    };
    let (mut outputs, mut errors) = (BTreeMap::new(), Vec::new());
    for (expected, _) in &checks {
        match source(&graph, expected, file_number) {
            Ok(source) => drop(outputs.insert(expected.output.as_str(), source)),
            Err(error) if errors.contains(&error) => {}
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(CaseError { diagnostics: errors, sources: sources.clone() });
    }
    let recorded = runner.record(file, case, &outputs, Variant::default())?;
    let repeated = match checks.iter().any(|(_, check)| check.kind == Kind::Repeats) {
        true => {
            Some(runner.record(file, case, &outputs, Variant { other_window: true, ..Variant::default() })?)
        }
        false => None,
    };
    let mut seeded = BTreeMap::new();
    for seed in checks.iter().flat_map(|(_, check)| check.numbers("seeds").unwrap_or_default()) {
        let seed = *seed as u64;
        if let Entry::Vacant(place) = seeded.entry(seed) {
            let variant = Variant { seed: Some(seed), ..Variant::default() };
            place.insert(runner.record(file, case, &outputs, variant)?);
        }
    }
    let folder = file.path.parent().map(Path::to_owned).unwrap_or_default();
    let result = |(expected, check): (&Expected, &Check)| {
        let own = &recorded[&expected.output];
        let (verdict, stored) = match check.kind {
            Kind::SameAs => {
                (same_as_file(own, &folder.join(check.text("file").unwrap_or_default()), check), None)
            }
            Kind::Stored => stored(own, &folder, check),
            Kind::Repeats => {
                let again = repeated.as_ref().and_then(|all| all.get(&expected.output));
                (equal(own, again, "another window", None), None)
            }
            Kind::SameForSeeds => {
                let others = check.numbers("seeds").unwrap_or_default().iter().map(|seed| *seed as u64);
                let verdicts = others.map(|seed| {
                    let other = seeded.get(&seed).and_then(|all| all.get(&expected.output));
                    equal(own, other, &format!("seed {seed}"), check.number("below"))
                });
                let verdicts: Vec<Verdict> = verdicts.collect();
                let failed = verdicts.iter().find(|verdict| !verdict.passed).or(verdicts.first());
                (failed.cloned().unwrap_or_else(|| Verdict::new(false, "no seeds", "a list of seeds")), None)
            }
            _ => (judge(check, own), None),
        };
        CheckResult {
            output: expected.output.clone(),
            check: check.label(),
            span: check.span.clone(),
            verdict,
            stored,
        }
    };
    Ok(checks.into_iter().map(result).collect())
}

/// Compares two runs: bit for bit, or samples up to a level in dB.
fn equal(own: &Recording, other: Option<&Recording>, run: &str, below: Option<f64>) -> Verdict {
    let expected = format!("the same with {run}");
    match other {
        Some(other) if own.digest() == other.digest() => Verdict::new(true, "the same", expected),
        Some(Recording::Sound(other) | Recording::Numbers(other)) => match own {
            Recording::Sound(own) | Recording::Numbers(own) => {
                let same = same_samples(own, other, below);
                Verdict::new(same.passed && below.is_some(), same.found, expected)
            }
            _ => Verdict::new(false, "another kind of output", expected),
        },
        _ => Verdict::new(false, "something else", expected),
    }
}

/// Compares with a file: audio by its samples, others by their bytes.
fn same_as_file(own: &Recording, path: &Path, check: &Check) -> Verdict {
    let shown = path.display();
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(e) => {
            return Verdict::new(
                false,
                format!("cannot read {shown}: {e}"),
                format!("the samples of {shown}"),
            );
        }
    };
    match own {
        Recording::Sound(samples) => match read_audio(bytes) {
            Ok(wanted) => same_samples(samples, &wanted, check.number("below")),
            Err(e) => {
                Verdict::new(false, format!("cannot read {shown}: {e}"), format!("the samples of {shown}"))
            }
        },
        Recording::Bytes(own) => {
            let found = if *own == bytes { "the same bytes" } else { "other bytes" };
            Verdict::new(*own == bytes, found, format!("the bytes of {shown}"))
        }
        other => Verdict::new(false, other.describe(), "audio or a file"),
    }
}

/// Compares with the stored content, and returns the content to store in its place.
fn stored(own: &Recording, folder: &Path, check: &Check) -> (Verdict, Option<Stored>) {
    let missing = || Verdict::new(false, "nothing stored", "a stored result: run it with --write");
    if let Some(name) = check.text("file") {
        let path = folder.join(name);
        let content = match own {
            Recording::Sound(samples) => samples.wav(),
            Recording::Bytes(bytes) => Ok(bytes.clone()),
            other => Err(format!("{} cannot be stored as a file: leave out `file`", other.describe())),
        };
        return match content {
            Err(e) => (Verdict::new(false, e, "audio or a file"), None),
            Ok(content) => {
                let verdict = if path.exists() { same_as_file(own, &path, check) } else { missing() };
                let stored = (!verdict.passed).then_some(Stored::File(path, content));
                (verdict, stored)
            }
        };
    }
    let digest = own.digest();
    match check.text("digest") {
        Some(wanted) if wanted == digest => (Verdict::new(true, "the same", "the same"), None),
        wanted => {
            let verdict = wanted.map_or_else(missing, |wanted| {
                Verdict::new(false, format!("digest {digest}"), format!("digest {wanted}"))
            });
            (verdict, Some(Stored::Digest(check.span.clone(), digest)))
        }
    }
}
