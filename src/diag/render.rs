//! Diagnostics as text for people and as JSON for programs.

use super::{Diagnostic, Place, Severity, Sources};
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use serde_json::{Value, json};

/// Text for people: message, the lines in question, help.
#[must_use]
pub fn render(diagnostics: &[Diagnostic], sources: &Sources, colour: bool) -> String {
    let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
    let texts = diagnostics.iter().map(|d| renderer.render(&groups(d, sources)));
    let mut all: String = texts.collect::<Vec<_>>().join("\n\n");
    if !all.is_empty() {
        all.push('\n');
    }
    all
}

fn groups<'a>(d: &'a Diagnostic, sources: &'a Sources) -> Vec<Group<'a>> {
    let level = match d.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = match &d.node {
        Some(node) if !d.message.contains(&format!("`{node}`")) => format!("node `{node}`: {}", d.message),
        _ => d.message.clone(),
    };
    let mut group = Group::with_title(level.primary_title(title).id(d.code));
    if let Some(place) = &d.place {
        for file in files_of(d, place) {
            let Some(source) = sources.get(file) else { continue };
            let mut snippet = Snippet::source(&*source.text).path(&*source.name).fold(true);
            if place.file == file {
                let primary = AnnotationKind::Primary.span(clip(place, &source.text));
                snippet =
                    snippet.annotation(if d.note.is_empty() { primary } else { primary.label(&*d.note) });
            }
            for label in d.labels.iter().filter(|l| l.place.file == file) {
                let span = clip(&label.place, &source.text);
                snippet = snippet.annotation(AnnotationKind::Context.span(span).label(&*label.text));
            }
            group = group.element(snippet);
        }
    }
    if let Some(help) = &d.help {
        group = group.element(Level::HELP.message(&**help));
    }
    vec![group]
}

fn files_of(d: &Diagnostic, place: &Place) -> Vec<usize> {
    let mut files = vec![place.file];
    for label in &d.labels {
        if !files.contains(&label.place.file) {
            files.push(label.place.file);
        }
    }
    files
}

/// The span, kept inside the text and on character boundaries.
fn clip(place: &Place, text: &str) -> std::ops::Range<usize> {
    let floor = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let start = floor(place.span.start);
    start..floor(place.span.end).max(start)
}

/// An array of `{code, severity, message, file, line, column, end_line, end_column, node, help}`.
#[must_use]
pub fn json(diagnostics: &[Diagnostic], sources: &Sources) -> Value {
    let one = |d: &Diagnostic| {
        let at = d.place.as_ref().map(|p| {
            let file = sources.get(p.file).map(|s| s.name.clone());
            (file, sources.line_column(p.file, p.span.start), sources.line_column(p.file, p.span.end))
        });
        json!({
            "code": d.code,
            "severity": if d.severity == Severity::Error { "error" } else { "warning" },
            "message": d.message,
            "file": at.as_ref().and_then(|(f, _, _)| f.clone()),
            "line": at.as_ref().map(|(_, s, _)| s.0),
            "column": at.as_ref().map(|(_, s, _)| s.1),
            "end_line": at.as_ref().map(|(_, _, e)| e.0),
            "end_column": at.as_ref().map(|(_, _, e)| e.1),
            "node": d.node,
            "help": d.help,
        })
    };
    Value::Array(diagnostics.iter().map(one).collect())
}
