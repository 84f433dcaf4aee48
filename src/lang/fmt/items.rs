//! The items of a container with the comments and blank lines that belong to them.

use super::*;

/// A comment before an item.
pub(super) struct Lead {
    pub text: String,
    pub blank_before: bool,
    pub ends_line: bool,
}

/// An item: an entry, a field, an element, an attribute, or the document's value.
pub(super) struct Item {
    pub node: SyntaxNode,
    pub leads: Vec<Lead>,
    pub trailing: Vec<String>,
    pub blank_before: bool,
    pub newline_before: bool,
}

/// Items between two brackets.
#[derive(Default)]
pub(super) struct Inside {
    /// Comments behind the opening bracket on its line.
    pub after_opener: Vec<String>,
    pub items: Vec<Item>,
    /// Comments after the last item.
    pub dangling: Vec<Lead>,
}

impl Inside {
    pub(super) fn is_empty(&self) -> bool {
        self.items.is_empty() && self.dangling.is_empty() && self.after_opener.is_empty()
    }
}

fn comment_text(token: &SyntaxToken) -> String {
    token.text().trim_end().to_owned()
}

/// The content of a container, or of the document.
pub(super) fn gather(node: &SyntaxNode) -> Inside {
    let mut reader = Reader::default();
    let mut inside = node.kind() == Document;
    for child in node.children_with_tokens() {
        if inside {
            reader.read(child);
        } else {
            inside = child.kind().closer().is_some();
        }
    }
    reader.finish()
}

#[derive(Default)]
struct Reader {
    inside: Inside,
    leads: Vec<Lead>,
    /// Line feeds since the last thing that was not white space.
    newlines: usize,
    /// True if a line feed has come since the last item.
    broken: bool,
}

impl Reader {
    fn read(&mut self, child: rowan::SyntaxElement<crate::lang::syntax::RonLanguage>) {
        match child {
            rowan::NodeOrToken::Token(token) => match token.kind() {
                Whitespace => self.whitespace(&token),
                kind if kind.is_comment() => self.comment(&token),
                Comma => self.newlines = 0,
                _ => {}
            },
            // A struct or tuple without its brackets, in `Some(...)`.
            rowan::NodeOrToken::Node(node)
                if matches!(node.kind(), Struct | Tuple) && !has_brackets(&node) =>
            {
                node.children_with_tokens().for_each(|child| self.read(child));
            }
            rowan::NodeOrToken::Node(node) => self.item(node),
        }
    }

    fn whitespace(&mut self, token: &SyntaxToken) {
        let newlines = token.text().matches('\n').count();
        self.newlines += newlines;
        self.broken |= newlines > 0;
        if newlines > 0
            && let Some(lead) = self.leads.last_mut()
        {
            lead.ends_line = true;
        }
    }

    fn comment(&mut self, token: &SyntaxToken) {
        let text = comment_text(token);
        let line_goes_on = token.kind() == BlockComment && !ends_its_line(token);
        let trails = self.newlines == 0 && self.leads.is_empty() && !line_goes_on;
        match self.inside.items.last_mut() {
            // Nothing can follow a line comment on its line, though a comma on the next line may try.
            Some(item) if trails && !item.trailing.last().is_some_and(|last| last.starts_with("//")) => {
                item.trailing.push(text);
            }
            None if trails && token.parent().is_some_and(|parent| parent.kind() != Document) => {
                self.inside.after_opener.push(text);
            }
            _ => self.leads.push(Lead {
                text,
                blank_before: self.newlines > 1,
                ends_line: token.kind() == LineComment,
            }),
        }
        self.newlines = 0;
    }

    fn item(&mut self, node: SyntaxNode) {
        let mut leads = std::mem::take(&mut self.leads);
        let mut blank_before = self.newlines > 1;
        let outside = leads.len();
        hoist(&node, &mut leads);
        if let (0, Some(first)) = (outside, leads.first_mut()) {
            first.blank_before = std::mem::take(&mut blank_before);
        }
        let item = Item { node, leads, trailing: Vec::new(), blank_before, newline_before: self.broken };
        self.inside.items.push(item);
        (self.newlines, self.broken) = (0, false);
    }

    fn finish(mut self) -> Inside {
        self.inside.dangling = self.leads;
        self.inside
    }
}

/// Returns true if only comments and white space follow a comment on its line.
fn ends_its_line(comment: &SyntaxToken) -> bool {
    let mut next = comment.next_token();
    while let Some(token) = next {
        match token.kind() {
            Whitespace if token.text().contains('\n') => return true,
            LineComment => return true,
            kind if kind.is_closer() => return true,
            Whitespace | BlockComment | Comma => next = token.next_token(),
            _ => return false,
        }
    }
    true
}

/// Moves the comments that cannot stand inside a line before the item, from everywhere outside of brackets.
fn hoist(node: &SyntaxNode, leads: &mut Vec<Lead>) {
    for child in node.children_with_tokens() {
        match child {
            rowan::NodeOrToken::Node(child) => hoist(&child, leads),
            rowan::NodeOrToken::Token(token)
                if token.kind().closer().is_some() && node.kind() != Attribute =>
            {
                return;
            }
            rowan::NodeOrToken::Token(token) if token.kind().is_comment() && hoists(&token) => {
                leads.push(Lead { text: comment_text(&token), blank_before: false, ends_line: true });
            }
            rowan::NodeOrToken::Token(_) => {}
        }
    }
}

/// For each item the columns from its start to its value's, or 0 where one space is enough.
pub(super) fn alignment(items: &[Item], indent: usize, line: usize) -> Vec<usize> {
    let rows: Vec<Option<Row>> = items.iter().map(row).collect();
    let mut pads = vec![0; items.len()];
    let mut start = 0;
    while start < items.len() {
        let mut end = start + 1;
        while end < items.len() && rows[start].is_some() && rows[end].is_some() && !has_gap(&items[end]) {
            end += 1;
        }
        let group: Vec<&Row> = rows[start..end].iter().flatten().collect();
        if let [first, _, ..] = group[..] {
            let pad = group.iter().map(|row| row.key + 2).max().unwrap_or(0);
            let aligned = first.offset.is_some() && group.iter().all(|row| row.offset == first.offset);
            if aligned && group.iter().all(|row| indent + pad + row.value < line) {
                pads[start..end].fill(pad);
            }
        }
        start = end;
    }
    pads
}

fn has_gap(item: &Item) -> bool {
    item.blank_before || item.leads.iter().any(|lead| lead.blank_before)
}

/// The widths of a map entry that will stand on one line without comments in it.
struct Row {
    key: usize,
    value: usize,
    /// Offset of the value from its key in the text, if they are on the same line.
    offset: Option<usize>,
}

fn row(item: &Item) -> Option<Row> {
    let node = &item.node;
    let comments = || {
        node.children_with_tokens().filter_map(|child| child.into_token().filter(|t| t.kind().is_comment()))
    };
    let inline_lead = item.leads.iter().any(|lead| !lead.ends_line);
    if node.kind() != Entry || inline_lead || comments().any(|comment| !hoists(&comment)) {
        return None;
    }
    let mut parts = node.children();
    let (key, value) = (parts.next()?, parts.next()?);
    let before = node.text().slice(..value.text_range().start() - node.text_range().start()).to_string();
    Some(Row {
        key: width(&flat(&key)?),
        value: width(&flat(&value)?),
        offset: (!before.contains('\n')).then(|| width(&before)),
    })
}
