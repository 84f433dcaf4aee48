//! The position of a cursor in a text that may be half-typed: the brackets around it and the kind of element that is valid there. The brackets are
//! those of the tokens before the cursor, so nothing that follows can hide it.

use super::error::Span;
use super::lexer::{Token, lex};
use super::syntax::SyntaxKind::{self, *};

/// A key of a map or the name of a field, without quotes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// Its location, quotes included.
    pub span: Span,
    /// Its text.
    pub text: String,
}

/// A bracket that is open at the cursor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Kind of the bracket.
    pub opener: SyntaxKind,
    /// Start of the value: of the name before the bracket, or of the bracket.
    pub start: usize,
    /// The name before the bracket.
    pub name: Option<Key>,
    /// The key or field that it is the value of.
    pub key: Option<Key>,
    /// Number of complete items before the cursor.
    pub index: usize,
    /// Keys and names of fields before the cursor.
    pub given: Vec<String>,
    /// The key or field whose value the cursor is in.
    current: Option<Key>,
}

/// Kind of element that is valid at a cursor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Slot {
    /// An element, a key or the name of a field begins here.
    Item,
    /// The value of this key or field.
    Value(Key),
    /// Something ends before the cursor, and a comma has to follow.
    After,
}

/// The position of a cursor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cursor {
    /// The open brackets, the outermost first.
    pub frames: Vec<Frame>,
    /// Kind of element that is valid here.
    pub slot: Slot,
    /// The word, number or text that the cursor is in or at the end of.
    pub word: Option<Word>,
    /// Keys and names of fields that follow in the innermost bracket.
    pub following: Vec<String>,
}

/// A token that is being typed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Word {
    /// Its kind.
    pub kind: SyntaxKind,
    /// Its location; of a text without the closing quote, up to the cursor.
    pub span: Span,
    /// Its text up to the cursor, without an opening quote.
    pub typed: String,
}

impl Cursor {
    /// The position of a byte offset in a text; `None` inside a comment.
    ///
    /// # Complexity
    /// Linear in the text.
    #[must_use]
    pub fn at(text: &str, offset: usize) -> Option<Self> {
        let offset = offset.min(text.len());
        // A text of several lines that has lost its closing quote ends with its line, as it was meant.
        let line_end = text[offset..].find('\n').map_or(text.len(), |at| offset + at);
        let tokens = lex(&text[..line_end]).tokens;
        let mut scan = Scan { text, frames: vec![Frame::document()], last: None };
        let mut word = None;
        for token in tokens {
            if token.start >= offset {
                break;
            }
            let inside = offset < token.end || offset == token.end && is_open(text, token);
            if token.kind.is_comment() && (inside || token.kind == LineComment && offset == token.end) {
                return None;
            }
            if inside || offset == token.end && is_word(token.kind) {
                word = word_at(text, token, offset);
                if word.is_some() {
                    break;
                }
            }
            if !token.kind.is_trivia() {
                scan.take(token);
            }
        }
        let slot = scan.slot(offset);
        let rest = word.as_ref().map_or(offset, |word| word.span.end);
        let following = keys(&text[rest..]);
        Some(Self { slot, word, frames: scan.frames, following })
    }
}

impl Frame {
    fn document() -> Self {
        Self { opener: Document, start: 0, name: None, key: None, index: 0, given: Vec::new(), current: None }
    }

    /// Returns true for the bracket of `Some(...)`.
    #[must_use]
    pub fn is_some(&self) -> bool {
        self.name.as_ref().is_some_and(|name| name.text == "Some")
    }

    /// Text of the name before the bracket.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.name.as_ref().map(|name| &*name.text)
    }

    /// Text of the key or field that it is the value of.
    #[must_use]
    pub fn key(&self) -> Option<&str> {
        self.key.as_ref().map(|key| &*key.text)
    }
}

/// Keys and names of fields in a text up to the bracket that closes it.
fn keys(text: &str) -> Vec<String> {
    let tokens = lex(text).tokens;
    let significant: Vec<Token> = tokens.into_iter().filter(|token| !token.kind.is_trivia()).collect();
    let (mut depth, mut found) = (0_usize, Vec::new());
    for (k, token) in significant.iter().enumerate() {
        match token.kind {
            LParen | LBracket | LBrace => depth += 1,
            RParen | RBracket | RBrace if depth == 0 => break,
            RParen | RBracket | RBrace => depth -= 1,
            Colon if depth == 0 && k > 0 => {
                let key = significant[k - 1];
                found.push(text[key.start..key.end].trim_matches('"').to_owned());
            }
            _ => {}
        }
    }
    found
}

/// Returns true for a string without its closing quote.
fn is_open(text: &str, token: Token) -> bool {
    let text = &text[token.start..token.end];
    match token.kind {
        Str => text.len() < 2 || !text.ends_with('"') || ends_in_escape(text),
        _ => false,
    }
}

/// Returns true if the last quote is escaped.
fn ends_in_escape(text: &str) -> bool {
    let before = &text[..text.len() - 1];
    before.bytes().rev().take_while(|b| *b == b'\\').count() % 2 == 1
}

fn is_word(kind: SyntaxKind) -> bool {
    matches!(kind, Ident | RawIdent | Number)
}

fn word_at(text: &str, token: Token, offset: usize) -> Option<Word> {
    let typed = &text[token.start..offset];
    let (typed, end) = match token.kind {
        Str if is_open(text, token) => (&typed[1..], offset),
        Str => (&typed[1..], token.end),
        kind if is_word(kind) => (typed, token.end),
        _ => return None,
    };
    Some(Word { kind: token.kind, span: token.start..end, typed: typed.to_owned() })
}

struct Scan<'t> {
    text: &'t str,
    /// The whole document, then the open brackets.
    frames: Vec<Frame>,
    /// The last token that is no white space or comment.
    last: Option<Token>,
}

impl Scan<'_> {
    fn key(&self, token: Token) -> Key {
        let text = &self.text[token.start..token.end];
        let text = text.strip_prefix('"').map_or(text, |text| text.strip_suffix('"').unwrap_or(text));
        Key { span: token.start..token.end, text: text.to_owned() }
    }

    fn take(&mut self, token: Token) {
        let last = self.last.replace(token);
        let Some(top) = self.frames.last() else { return };
        match token.kind {
            LParen | LBracket | LBrace => {
                let name =
                    last.filter(|last| matches!(last.kind, Ident | RawIdent) && last.end <= token.start);
                let name = name.map(|name| self.key(name));
                let start = name.as_ref().map_or(token.start, |name| name.span.start);
                let frame =
                    Frame { opener: token.kind, start, name, key: top.current.clone(), ..Frame::document() };
                self.frames.push(frame);
            }
            RParen | RBracket | RBrace => {
                let closes = |frame: &Frame| frame.opener.closer() == Some(token.kind);
                if let Some(at) = self.frames.iter().rposition(closes) {
                    self.frames.truncate(at);
                }
            }
            Comma => {
                if let Some(top) = self.frames.last_mut() {
                    top.index += 1;
                    top.current = None;
                }
            }
            Colon | Eq => {
                let Some(key) = last.filter(|last| matches!(last.kind, Ident | RawIdent | Str)) else {
                    return;
                };
                let key_of_map = key.kind == Str;
                let key = self.key(key);
                // A quoted key stands in a map: the brackets in it have not been closed yet.
                let map = self.frames.iter().rposition(|frame| frame.opener == LBrace);
                if let Some(at) = map.filter(|_| key_of_map) {
                    self.frames.truncate(at + 1);
                }
                if let Some(top) = self.frames.last_mut() {
                    top.given.push(key.text.clone());
                    top.current = Some(key);
                }
            }
            _ => {}
        }
    }

    fn slot(&self, offset: usize) -> Slot {
        let Some(last) = self.last else { return Slot::Item };
        let current = self.frames.last().and_then(|frame| frame.current.clone());
        match (last.kind, current) {
            (Colon | Eq, Some(key)) => Slot::Value(key),
            (Comma | LParen | LBracket | LBrace, _) => Slot::Item,
            // A comma is missing at the end of the line.
            _ if self.text[last.end..offset].contains('\n') => Slot::Item,
            _ => Slot::After,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The frames as text, the slot and the typed word, at the `|` of a text.
    fn at(text: &str) -> String {
        let offset = text.find('|').unwrap();
        let text = text.replacen('|', "", 1);
        let Some(cursor) = Cursor::at(&text, offset) else { return "comment".to_owned() };
        let frame = |f: &Frame| format!("{}/{}#{}", f.key().unwrap_or(""), f.name().unwrap_or(""), f.index);
        let frames: Vec<String> = cursor.frames[1..].iter().map(frame).collect();
        let slot = match &cursor.slot {
            Slot::Item => "item".to_owned(),
            Slot::Value(key) => format!("value of {}", key.text),
            Slot::After => "after".to_owned(),
        };
        let word = cursor.word.map(|word| format!(" {:?} {}", word.kind, word.typed)).unwrap_or_default();
        format!("{} {slot}{word}", frames.join(" "))
    }

    #[test]
    fn fields_that_follow_are_known() {
        let text = "Graph(nodes: {\"a\": Gain(, audio: \"x\", gain: [(b: 1)]), \"c\": Mix()";
        let cursor = Cursor::at(text, text.find(", audio").unwrap()).unwrap();
        assert_eq!(cursor.following, ["audio", "gain"]);
    }

    #[test]
    fn half_typed_texts_have_their_places() {
        for (text, expected) in [
            ("|", " item"),
            ("Graph(no|", "/Graph#0 item Ident no"),
            ("Graph(nodes: {\"a\": Ga|", "/Graph#0 nodes/#0 value of a Ident Ga"),
            ("Graph(nodes: {\"a\": |})", "/Graph#0 nodes/#0 value of a"),
            ("Graph(nodes: {\"a\": Gain(|)})", "/Graph#0 nodes/#0 a/Gain#0 item"),
            ("Graph(nodes: {\"a\": Gain(audio: \"x\", g|)})", "/Graph#0 nodes/#0 a/Gain#1 item Ident g"),
            (
                "Graph(nodes: {\"a\": Gain(audio: \"no|\n  gain: 1",
                "/Graph#0 nodes/#0 a/Gain#0 value of audio Str no",
            ),
            (
                "Graph(nodes: {\"a\": Mix(inputs: [\"b\", \"|\"]",
                "/Graph#0 nodes/#0 a/Mix#0 inputs/#1 item Str ",
            ),
            ("Graph(nodes: {\"a\": Gain(audio: \"x\"|", "/Graph#0 nodes/#0 a/Gain#0 after"),
            // Neither the bracket nor the comma of the node above is there yet.
            ("Graph(nodes: {\n\"a\": Gain(audio: \"x\"\n\"b\": G|", "/Graph#0 nodes/#0 value of b Ident G"),
            (
                "Graph(nodes: {\"a\": Noise(duration: Some(1|))",
                "/Graph#0 nodes/#0 a/Noise#0 duration/Some#0 item Number 1",
            ),
            ("Graph(// no|te\nnodes: {", "comment"),
            ("Graph(/* | */ nodes: {", "comment"),
            ("Graph(nodes: { // a\n  |", "/Graph#0 nodes/#0 item"),
            ("#![schema = \"fo|\"]", "/#0 value of schema Str fo"),
        ] {
            assert_eq!(at(text), expected, "{text}");
        }
    }
}
