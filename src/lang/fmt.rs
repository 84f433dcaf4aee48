//! The layout of a graph's text.
//!
//! Four spaces for each level. A container that stood on one line and fits 100 columns stays on one line;
//! otherwise each entry or field gets its own line, and the elements of lists and tuples retain the lines
//! they were on. All comments stay, and at most one blank line between two items; lines end as the first one does,
//! in LF or CRLF. The values of
//! consecutive one-line map entries stay aligned if all of them were.

use super::error::SyntaxError;
use super::parser::parse;
use super::syntax::SyntaxKind::{self, *};
use super::syntax::{SyntaxNode, SyntaxToken};
use flat::{flat, hoists, width};
use items::{Inside, Item, Lead, gather};

mod flat;
mod items;

const LINE: usize = 100;
const INDENT: usize = 4;

/// Lays out a text. The result has the same values and comments, and is a fixed point of this function.
///
/// # Errors
/// All syntax errors, if there are any; such a text is not touched.
///
/// # Complexity
/// Linear in the text's length times the depth of its nesting.
pub fn format(text: &str) -> Result<String, Vec<SyntaxError>> {
    let parse = parse(text);
    if !parse.is_ok() {
        return Err(parse.errors);
    }
    let root = parse.syntax();
    let mut printer = Printer { out: String::with_capacity(text.len()), end: line_end(text, &root) };
    let inside = gather(&root);
    for (nth, item) in inside.items.iter().enumerate() {
        printer.leads(item, nth == 0, 0);
        printer.value(&item.node, 0, 0);
        printer.trailing(&item.trailing);
        printer.end_line();
    }
    printer.own_lines(&inside.dangling, inside.items.is_empty(), 0);
    Ok(printer.out)
}

/// Line ending of a text: that of the first line that ends outside of strings and block comments.
fn line_end(text: &str, root: &SyntaxNode) -> &'static str {
    let tokens = root.descendants_with_tokens().filter_map(|element| element.into_token());
    let mut spaces = tokens.filter(|token| token.kind() == Whitespace);
    let at = |token: SyntaxToken| Some(usize::from(token.text_range().start()) + token.text().find('\n')?);
    // The return belongs to the comment where one ends the line.
    let returned = spaces.find_map(at).is_some_and(|at| text[..at].ends_with('\r'));
    if returned { "\r\n" } else { "\n" }
}

struct Printer {
    out: String,
    /// Line ending of the text.
    end: &'static str,
}

impl Printer {
    fn end_line(&mut self) {
        self.out.push_str(self.end);
    }

    fn column(&self) -> usize {
        width(&self.out[self.out.rfind('\n').map_or(0, |at| at + 1)..])
    }

    fn fits(&self, text: &str, after: usize) -> bool {
        self.column() + width(text) + after <= LINE
    }

    fn indent(&mut self, indent: usize) {
        if self.out.is_empty() || self.out.ends_with('\n') {
            self.out.extend(std::iter::repeat_n(' ', indent * INDENT));
        }
    }

    fn blank(&mut self, wanted: bool, first: bool) {
        if wanted && !first {
            self.end_line();
        }
    }

    /// Prints comments that stand before an item, and the blank lines among them.
    fn leads(&mut self, item: &Item, first: bool, indent: usize) {
        for (nth, lead) in item.leads.iter().enumerate() {
            self.blank(lead.blank_before, first && nth == 0);
            self.indent(indent);
            self.out.push_str(&lead.text);
            self.out.push_str(if lead.ends_line { self.end } else { " " });
        }
        self.blank(item.blank_before && self.out.ends_with('\n'), first && item.leads.is_empty());
        self.indent(indent);
    }

    /// Prints comments that no item follows.
    fn own_lines(&mut self, comments: &[Lead], first: bool, indent: usize) {
        for (nth, comment) in comments.iter().enumerate() {
            self.blank(comment.blank_before, first && nth == 0);
            self.indent(indent);
            self.out.push_str(&comment.text);
            self.end_line();
        }
    }

    fn trailing(&mut self, comments: &[String]) {
        for comment in comments {
            self.out.push(' ');
            self.out.push_str(comment);
        }
    }

    /// Prints a value, or another item, after which `after` columns must be free.
    fn value(&mut self, node: &SyntaxNode, indent: usize, after: usize) {
        if matches!(node.kind(), Entry | Field) {
            return self.loose(node, indent, after, 0);
        }
        match flat(node) {
            Some(text) if self.fits(&text, after) || !has_brackets(node) => self.out.push_str(&text),
            _ if has_brackets(node) => self.block(node, indent),
            _ => self.loose(node, indent, after, 0),
        }
    }

    /// Prints the parts of something without brackets of its own; the value of an entry begins no
    /// sooner than `pad` columns after the start.
    fn loose(&mut self, node: &SyntaxNode, indent: usize, after: usize, pad: usize) {
        let start = self.column();
        for child in node.children_with_tokens() {
            match child {
                rowan::NodeOrToken::Node(child) => {
                    let is_last = child.text_range().end() == node.text_range().end();
                    self.value(&child, indent, if is_last { after } else { 1 });
                }
                rowan::NodeOrToken::Token(token) => match token.kind() {
                    Whitespace => {}
                    Colon => {
                        self.out.push_str(": ");
                        let missing = (start + pad).saturating_sub(self.column());
                        self.out.extend(std::iter::repeat_n(' ', missing));
                    }
                    kind if kind.is_comment() => self.inline_comment(&token),
                    _ => {
                        self.out.push_str(token.text());
                        if node.kind() == Optional {
                            self.out.push(' ');
                        }
                    }
                },
            }
        }
    }

    fn inline_comment(&mut self, token: &SyntaxToken) {
        if hoists(token) {
            return;
        }
        let spaced = self.out.ends_with([' ', '\n']);
        self.out.push_str(if spaced { "" } else { " " });
        self.out.push_str(token.text());
        // Before a colon no space is needed, and before a bracket none is wanted.
        let skipped =
            |token: &SyntaxToken| token.kind() == Whitespace || token.kind().is_comment() && hoists(token);
        let mut after = token.siblings_with_tokens(rowan::Direction::Next).skip(1);
        let next =
            after.find(|element| !element.as_token().is_some_and(skipped)).map(|element| element.kind());
        self.out.push_str(if matches!(next, Some(Colon | LParen)) { "" } else { " " });
    }

    /// Prints a container over several lines.
    fn block(&mut self, node: &SyntaxNode, indent: usize) {
        let mut opener = None;
        for token in node.children_with_tokens().filter_map(|element| element.into_token()) {
            match token.kind() {
                Whitespace => {}
                kind if kind.is_comment() => self.inline_comment(&token),
                kind => {
                    self.out.push_str(token.text());
                    if kind.closer().is_some() {
                        opener = Some(token);
                        break;
                    }
                }
            }
        }
        let inside = gather(node);
        if inside.is_empty() {
            self.out.push_str(if node.kind() == Tuple && node.first_token() == opener { " " } else { "" });
        } else {
            self.trailing(&inside.after_opener);
            self.end_line();
            match node.kind() {
                Map | Struct => self.lines(&inside, indent + 1),
                // With the brackets of a struct left out, its fields stand in `Some(...)` directly.
                _ if inside.items.iter().any(|item| item.node.kind() == Field) => {
                    self.lines(&inside, indent + 1)
                }
                _ => self.fill(&inside, indent + 1),
            }
            self.own_lines(&inside.dangling, inside.items.is_empty(), indent + 1);
            self.indent(indent);
        }
        self.out.push_str(match opener.as_ref().map(SyntaxToken::kind) {
            Some(LBrace) => "}",
            Some(LBracket) => "]",
            _ => ")",
        });
    }

    /// One item on each line.
    fn lines(&mut self, inside: &Inside, indent: usize) {
        let pads = items::alignment(&inside.items, indent * INDENT, LINE);
        for (nth, (item, pad)) in inside.items.iter().zip(pads).enumerate() {
            self.leads(item, nth == 0, indent);
            self.loose(&item.node, indent, 1, pad);
            self.out.push(',');
            self.trailing(&item.trailing);
            self.end_line();
        }
    }

    /// The elements on the lines that they were on, where they fit.
    fn fill(&mut self, inside: &Inside, indent: usize) {
        let mut fresh = true;
        for (nth, item) in inside.items.iter().enumerate() {
            let text = flat(&item.node);
            let before: usize = item.leads.iter().map(|lead| width(&lead.text) + 1).sum();
            let joins = !fresh
                && !item.newline_before
                && item.leads.iter().all(|lead| !lead.ends_line)
                && text.as_deref().is_some_and(|text| self.fits(text, before + 2));
            if joins {
                self.out.push(' ');
            } else if !fresh {
                self.end_line();
            }
            self.leads(item, nth == 0, indent);
            let start = self.out.len();
            self.value(&item.node, indent, 1);
            fresh = self.out[start..].contains('\n');
            self.out.push(',');
            self.trailing(&item.trailing);
            fresh |= item.trailing.last().is_some_and(|comment| comment.starts_with("//"));
            if fresh {
                self.end_line();
            }
        }
        if !fresh {
            self.end_line();
        }
    }
}

fn has_brackets(node: &SyntaxNode) -> bool {
    matches!(node.kind(), List | Map | Tuple | Struct | Optional)
        && node.children_with_tokens().any(|child| child.kind().closer().is_some())
}

/// Returns true if two kinds stand without a space between them on one line.
fn touch(before: SyntaxKind, after: SyntaxKind) -> bool {
    match (before, after) {
        (LBrace, RBrace) => true,
        (LBrace, _) | (_, RBrace) => false,
        (LParen | LBracket | Hash | Bang, _) | (_, RParen | RBracket | Comma | Colon | Bang) => true,
        (DotDot | DotDotEq, _) | (_, DotDot | DotDotEq) => true,
        (Ident | RawIdent | BlockComment, LParen) => true,
        _ => false,
    }
}
