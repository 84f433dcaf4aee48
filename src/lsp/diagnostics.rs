//! Findings for an editor.

use super::analysis::Analysis;
use super::file::TextFile;
use super::formats::Format;
use super::test_files::{is_test, mistakes};
use super::workspace::{Workspace, beside, uri_of};
use crate::diag::{Diagnostic, Severity, SourceLocation};
use crate::lang::Span;
use lsp_types::{
    DiagnosticRelatedInformation, DiagnosticSeverity, DiagnosticTag, Location, NumberOrString, Range, Uri,
};
use std::path::{Path, PathBuf};

/// Maximum number of findings of one file.
const MAX_FINDINGS: usize = 500;

/// All findings of a graph. Findings in a sub-graph are located where the sub-graph is used.
#[must_use]
pub fn diagnostics(
    workspace: &Workspace,
    analysis: &Analysis,
    file: &TextFile,
) -> Vec<lsp_types::Diagnostic> {
    let places = Places { workspace, analysis, file };
    let findings = analysis.diagnostics.iter().map(|found| places.finding(found));
    let notes = analysis.notes.iter().filter_map(|(node, text)| places.note(node, text));
    findings.chain(notes).take(MAX_FINDINGS).collect()
}

/// The syntax errors of a text that is not a graph, or else the errors of the reader of its format.
#[must_use]
pub fn text_errors(file: &TextFile) -> Vec<lsp_types::Diagnostic> {
    let one = |e: &crate::lang::SyntaxError| {
        let expected = e.expected.as_ref().map(|expected| format!("\nexpected {expected}"));
        let message = format!("{}{}", e.message, expected.unwrap_or_default());
        diagnostic(file.range(&e.span), DiagnosticSeverity::ERROR, "F001", message)
    };
    let mut all: Vec<_> = file.parse.errors().iter().take(MAX_FINDINGS).map(one).collect();
    if is_test(file) && all.is_empty() {
        let one = |(span, message): (Span, String)| {
            diagnostic(file.range(&span), DiagnosticSeverity::ERROR, "F086", message)
        };
        all.extend(mistakes(file).into_iter().map(one).take(MAX_FINDINGS));
    }
    if let Some((span, message)) = Format::of(file).filter(|_| all.is_empty()).and_then(|f| f.mistake(file)) {
        all.push(diagnostic(file.range(&span), DiagnosticSeverity::ERROR, "", message));
    }
    all
}

fn diagnostic(
    range: Range,
    severity: DiagnosticSeverity,
    code: &str,
    message: String,
) -> lsp_types::Diagnostic {
    lsp_types::Diagnostic {
        range,
        severity: Some(severity),
        code: (!code.is_empty()).then(|| NumberOrString::String(code.to_owned())),
        source: Some("foley".into()),
        message,
        ..lsp_types::Diagnostic::default()
    }
}

struct Places<'a> {
    workspace: &'a Workspace,
    analysis: &'a Analysis,
    /// The text that was inspected.
    file: &'a TextFile,
}

impl Places<'_> {
    /// The path of a source, `None` for an argument or a message.
    fn path(&self, at: &SourceLocation) -> Option<PathBuf> {
        let name = &self.analysis.sources.get(at.file)?.name;
        Some(PathBuf::from(name)).filter(|path| path.is_absolute() || *path == self.analysis.path)
    }

    fn is_own(&self, at: &SourceLocation) -> bool {
        self.path(at).is_some_and(|path| path == self.analysis.path)
    }

    fn location(&self, at: &SourceLocation) -> Option<Location> {
        let path = self.path(at)?;
        let range = match self.is_own(at) {
            true => self.file.range(&at.span),
            false => self.workspace.file(&path)?.range(&at.span),
        };
        Some(Location { uri: uri(self.workspace, &path)?, range })
    }

    fn finding(&self, found: &Diagnostic) -> lsp_types::Diagnostic {
        let file = self.file;
        let own = found.location.as_ref().filter(|at| self.is_own(at));
        let mut message = found.message.clone();
        if let Some(help) = &found.help {
            message.push_str(&format!("\n{help}"));
        }
        let mut related: Vec<DiagnosticRelatedInformation> = Vec::new();
        let range = match (own, &found.location) {
            (Some(at), _) => file.range(&at.span),
            (None, Some(at)) => {
                let name = self.analysis.sources.get(at.file).map(|source| source.name.clone());
                message = format!("in {}: {message}", name.unwrap_or_default());
                let text = found.message.clone();
                related.extend(
                    self.location(at)
                        .map(|location| DiagnosticRelatedInformation { location, message: text }),
                );
                self.used_at(at, found.node.as_deref())
            }
            (None, None) => file.range(&(0..0)),
        };
        for label in &found.labels {
            let location = self.location(&label.location);
            related.extend(
                location
                    .map(|location| DiagnosticRelatedInformation { location, message: label.text.clone() }),
            );
        }
        // A graph that is made to be used by others is not wrong by itself.
        let severity = match (found.severity, found.code) {
            (Severity::Error, "F032") if own.is_some() && found.labels.is_empty() => DiagnosticSeverity::HINT,
            (Severity::Error, _) => DiagnosticSeverity::ERROR,
            (Severity::Warning, _) => DiagnosticSeverity::WARNING,
        };
        let mut out = diagnostic(range, severity, found.code, message);
        out.related_information = (!related.is_empty()).then_some(related);
        out.tags = matches!(found.code, "F026" | "F029").then(|| vec![DiagnosticTag::UNNECESSARY]);
        out
    }

    /// Range in which the graph uses the sub-graph of a location.
    fn used_at(&self, at: &SourceLocation, node: Option<&str>) -> Range {
        let (file, path) = (self.file, self.path(at));
        let names_it =
            |named: &str| path.as_ref().is_some_and(|path| beside(&self.analysis.path, named) == *path);
        let by_path = file.uses().find(|used| used.path.as_str().is_some_and(names_it));
        let by_node = || file.use_of(node?.split('.').next()?);
        match (by_path.or_else(by_node), file.extends()) {
            (Some(used), _) => file.range(&used.path.span),
            (None, Some(base)) => file.range(&base.span),
            (None, None) => file.range(&(0..0)),
        }
    }

    fn note(&self, node: &str, text: &str) -> Option<lsp_types::Diagnostic> {
        let file = self.file;
        let span = match file.node_entry(node) {
            Some(entry) => entry.key.span(),
            None => file.use_of(node.split('.').next()?)?.entry.key.span(),
        };
        let message = format!("{node}: {text}");
        Some(diagnostic(file.range(&span), DiagnosticSeverity::INFORMATION, "", message))
    }
}

/// The address of a file, as the editor wrote it if it is open.
#[must_use]
pub fn uri(workspace: &Workspace, path: &Path) -> Option<Uri> {
    workspace.open_file(path).map(|open| open.uri.clone()).or_else(|| uri_of(path))
}
