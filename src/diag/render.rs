//! Diagnostics as text for people and as JSON for programs.

use super::{Diagnostic, Fix, Severity, Source, SourceLocation, Sources};
use crate::lang::edit::TextEdit;
use crate::lang::{Parse, parse};
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;

/// Maximum number of diagnostics in text output.
const MAX_SHOWN: usize = 100;
/// Maximum number of further locations of a diagnostic in text output.
const MAX_LABELS: usize = 24;
/// Maximum length of a message, in characters.
const LONGEST_TITLE: usize = 2000;

/// Maximum bytes of a line that is shown; of a longer line only the position is reported.
const LONGEST_LINE: usize = 4000;

/// Readable text: message, the lines in question, help; at most a hundred diagnostics, errors before warnings.
#[must_use]
pub fn render(diagnostics: &[Diagnostic], sources: &Sources, colour: bool) -> String {
    let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
    let mut shown: Vec<&Diagnostic> = diagnostics.iter().collect();
    if shown.len() > MAX_SHOWN {
        // No warning takes the place of an error.
        shown.sort_by_key(|d| d.severity == Severity::Warning);
        shown.truncate(MAX_SHOWN);
    }
    let left = diagnostics.len() - shown.len();
    let mut texts: Vec<String> = shown.into_iter().map(|d| renderer.render(&groups(d, sources))).collect();
    if left > 0 {
        texts.push(format!("... and {left} more"));
    }
    let mut all = texts.join("\n\n");
    if !all.is_empty() {
        all.push('\n');
    }
    // The renderer leaves some of those in the lines of the text.
    if colour { all } else { plain(&all).into_owned() }
}

/// A text without control characters, so that a name from a file or from a message cannot command the terminal: each becomes
/// its picture, such as `␛`. Tabs and ends of lines stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    let commands = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(commands) {
        return Cow::Borrowed(text);
    }
    let picture = |c: char| match c {
        c if !commands(c) => c,
        '\0'..='\x1f' => char::from_u32(0x2400 + u32::from(c)).unwrap_or(char::REPLACEMENT_CHARACTER),
        '\x7f' => '\u{2421}',
        _ => char::REPLACEMENT_CHARACTER,
    };
    Cow::Owned(text.chars().map(picture).collect())
}

/// The lines of a diagnostic, so that the rest of a long file is not read: their bytes, and the first number.
fn lines(text: &str, spans: &[Range<usize>]) -> (Range<usize>, usize) {
    let first = spans.iter().map(|s| s.start).min().unwrap_or(0);
    let last = spans.iter().map(|s| s.end).max().unwrap_or(0);
    let start = text[..first].rfind('\n').map_or(0, |at| at + 1);
    // The line after the last one too: a span may end behind a line break.
    let end = text[last..].find('\n').map_or(text.len(), |at| last + at + 1);
    let number = 1 + text.as_bytes()[..start].iter().filter(|b| **b == b'\n').count();
    (start..end, number)
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
    let title = plain(&shortened(title)).into_owned();
    let mut group = Group::with_title(level.primary_title(title).id(d.code));
    if let Some(location) = &d.location {
        for file in files_of(d, location) {
            let Some(source) = sources.get(file) else { continue };
            let labels: Vec<_> =
                d.labels.iter().filter(|l| l.location.file == file).take(MAX_LABELS).collect();
            let own = (location.file == file).then(|| clip(location, &source.text));
            let others = labels.iter().map(|l| clip(&l.location, &source.text));
            let spans: Vec<Range<usize>> = own.clone().into_iter().chain(others).collect();
            let (range, number) = lines(&source.text, &spans);
            if source.text[range.clone()].lines().any(|line| line.len() > LONGEST_LINE) {
                group = group.elements(spans.iter().map(|span| origin(source, span.start)));
                continue;
            }
            let within = |span: Range<usize>| span.start - range.start..span.end - range.start;
            let mut snippet = Snippet::source(&source.text[range.clone()])
                .line_start(number)
                .path(plain(&source.name))
                .fold(true);
            if let Some(own) = own {
                let primary = AnnotationKind::Primary.span(within(own));
                snippet = snippet.annotation(if d.note.is_empty() {
                    primary
                } else {
                    primary.label(plain(&d.note))
                });
            }
            for label in labels {
                let span = within(clip(&label.location, &source.text));
                snippet = snippet.annotation(AnnotationKind::Context.span(span).label(plain(&label.text)));
            }
            group = group.element(snippet);
        }
    }
    if let Some(help) = &d.help {
        group = group.element(Level::HELP.message(plain(help)));
    }
    vec![group]
}

/// The location alone, for a line that is too long to be shown.
fn origin(source: &Source, at: usize) -> Origin<'_> {
    let before = &source.text[..at];
    let line = before.rfind('\n').map_or(before, |end| &before[end + 1..]);
    let number = 1 + before.bytes().filter(|b| *b == b'\n').count();
    Origin::path(plain(&source.name)).line(number).char_column(1 + line.chars().count())
}

/// A text without its middle if it is very long, such as a loop of thousands of nodes.
fn shortened(text: String) -> String {
    let length = text.chars().count();
    if length <= LONGEST_TITLE {
        return text;
    }
    let start: String = text.chars().take(LONGEST_TITLE / 2).collect();
    let end: String = text.chars().skip(length - LONGEST_TITLE / 2).collect();
    format!("{start} ... {end}")
}

fn files_of(d: &Diagnostic, location: &SourceLocation) -> Vec<usize> {
    let mut files = vec![location.file];
    for label in &d.labels {
        if !files.contains(&label.location.file) {
            files.push(label.location.file);
        }
    }
    files
}

/// The span, clamped to the text and to character boundaries.
fn clip(location: &SourceLocation, text: &str) -> Range<usize> {
    let floor = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let start = floor(location.span.start);
    start..floor(location.span.end).max(start)
}

/// An array of `{code, severity, message, file, line, column, end_line, end_column, node, help, fixes}`.
#[must_use]
pub fn json(diagnostics: &[Diagnostic], sources: &Sources) -> Value {
    let mut parsed = HashMap::new();
    let mut fixes = |d: &Diagnostic| -> Vec<Value> {
        let one = |fix: &Fix| {
            let source = sources.get(fix.file()?)?;
            let parse = parsed.entry(fix.file()).or_insert_with(|| parse(&source.text));
            fix_json(fix, &source.name, parse)
        };
        d.fixes.iter().filter_map(one).collect()
    };
    let mut one = |d: &Diagnostic| {
        let at = d.location.as_ref().map(|p| {
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
            "fixes": fixes(d),
        })
    };
    Value::Array(diagnostics.iter().map(&mut one).collect())
}

/// A correction as JSON: its title and the edits of the file, with byte offsets.
fn fix_json(fix: &Fix, file: &str, parse: &Parse) -> Option<Value> {
    let edit = |e: &TextEdit| json!({"start": e.span.start, "end": e.span.end, "text": e.new_text});
    let edits: Vec<Value> = fix.edits(parse)?.iter().map(edit).collect();
    Some(json!({"title": fix.title, "file": file, "edits": edits}))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_of_texts_and_names_are_shown_as_pictures() {
        let mut sources = Sources::default();
        sources.add("\x1b]0;name\x07.ron", "a \x1b[2J text \u{9b}2J");
        let at = || SourceLocation { file: 0, span: 2..7 };
        let found = Diagnostic::error("F001", "\x1b[31mwrong", at())
            .label(at(), "\x1b[1m")
            .help("\u{9b}1m\x07")
            .note("\x1b");
        let reported = render(&[found], &sources, false);
        assert!(reported.contains("␛]0;name␇.ron"), "{reported}");
        assert!(!reported.contains(|c: char| c.is_control() && c != '\n'), "{reported:?}");
    }

    #[test]
    fn lines_far_down_are_shown_by_their_numbers_alone() {
        let mut sources = Sources::default();
        let text: String = (1..=5000).map(|k| format!("line {k}\n")).collect();
        let at = |k: usize| text.find(&format!("line {k}\n")).unwrap();
        let location = |k: usize| SourceLocation { file: 0, span: at(k)..at(k) + 4 };
        let found = Diagnostic::error("F001", "wrong", location(4000)).label(location(3990), "see here");
        sources.add("a.ron", text.clone());
        let reported = render(&[found], &sources, false);
        assert!(reported.contains("--> a.ron:4000:1") && reported.contains("4000 | line 4000"), "{reported}");
        assert!(reported.contains("3990 | line 3990") && reported.lines().count() < 12, "{reported}");
        let end =
            Diagnostic::error("F001", "cut off", SourceLocation { file: 0, span: text.len()..text.len() });
        assert!(render(&[end], &sources, false).contains("cut off"));
    }

    #[test]
    fn only_the_position_of_a_very_long_line_is_reported() {
        let mut sources = Sources::default();
        sources.add("a.ron", format!("first\nä{}", "x".repeat(200_000)));
        let at = |k: usize| SourceLocation { file: 0, span: 6 + k..7 + k };
        let found = Diagnostic::error("F001", "wrong", at(150_000)).label(at(2), "see here").help("mend it");
        let reported = render(&[found], &sources, false);
        assert!(reported.contains("--> a.ron:2:150000") && reported.contains("a.ron:2:2"), "{reported}");
        assert!(reported.contains("mend it") && reported.len() < 300, "{reported}");
    }

    #[test]
    fn of_very_many_the_errors_are_shown_first_and_the_rest_is_counted() {
        let mut sources = Sources::default();
        sources.add("a.ron", "text");
        let at = || SourceLocation { file: 0, span: 0..4 };
        let mut all: Vec<_> = (0..300).map(|_| Diagnostic::warning("F026", "odd", at())).collect();
        all.push(Diagnostic::error("F025", format!("a loop: {}", "node -> ".repeat(4000)), at()));
        let reported = render(&all, &sources, false);
        assert!(
            reported.starts_with("error[F025]: a loop: node") && reported.contains(" ... "),
            "{reported}"
        );
        assert!(reported.ends_with("\n\n... and 201 more\n") && reported.matches("odd").count() == 99);
        assert!(reported.len() < 20_000, "{}", reported.len());
        assert_eq!(render(&all[..100], &sources, false).matches("odd").count(), 100);
    }
}
