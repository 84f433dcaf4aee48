//! Text to tokens. Every byte of the text is in exactly one token, whatever the text is.

use unicode_ident::{is_xid_continue, is_xid_start};

use super::error::{ErrorKind, SyntaxError};
use super::number;
use super::quoted::{self, Encoding};
use super::syntax::SyntaxKind;

/// One token: its kind and its bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token {
    pub kind: SyntaxKind,
    pub start: usize,
    pub end: usize,
}

/// The tokens of a text and the errors inside them.
pub(super) struct Lexed {
    pub tokens: Vec<Token>,
    pub errors: Vec<SyntaxError>,
}

/// Splits a text into tokens.
///
/// A string may run over several lines, so one lost quote turns the rest of a text inside out. When the
/// last string has no end, the text is read again with strings that end at the line's end; if that
/// leaves exactly one string open, this is the one that lost its quote.
pub(super) fn lex(text: &str) -> Lexed {
    let whole = Lexer::run(text, false);
    if whole.open_strings == 0 {
        return whole.into();
    }
    let by_line = Lexer::run(text, true);
    if by_line.open_strings == 1 { by_line.into() } else { whole.into() }
}

/// The byte order mark that some editors write.
const BYTE_ORDER_MARK: char = '\u{feff}';

struct Lexer<'t> {
    text: &'t str,
    at: usize,
    strings_end_with_line: bool,
    /// The end of the line of the last query, so that long lines are searched once.
    line_end: usize,
    open_strings: usize,
    tokens: Vec<Token>,
    errors: Vec<SyntaxError>,
}

impl From<Lexer<'_>> for Lexed {
    fn from(lexer: Lexer<'_>) -> Self {
        Lexed { tokens: lexer.tokens, errors: lexer.errors }
    }
}

pub(super) fn is_whitespace(c: char) -> bool {
    matches!(c, '\t'..='\r' | ' ' | '\u{85}' | '\u{200E}' | '\u{200F}' | '\u{2028}' | '\u{2029}')
}

fn is_raw_ident_char(c: char) -> bool {
    matches!(c, '.' | '+' | '-') || is_xid_continue(c)
}

fn is_ident_start(c: char) -> bool {
    c == '_' || is_xid_start(c)
}

impl<'t> Lexer<'t> {
    fn run(text: &'t str, strings_end_with_line: bool) -> Self {
        let tokens = Vec::with_capacity(text.len() / 3);
        let mut lexer = Lexer {
            text,
            at: 0,
            strings_end_with_line,
            line_end: 0,
            open_strings: 0,
            tokens,
            errors: Vec::new(),
        };
        while let Some(c) = lexer.rest().chars().next() {
            let (kind, len) = lexer.token(c);
            lexer.push(kind, len);
        }
        lexer
    }

    fn rest(&self) -> &'t str {
        &self.text[self.at..]
    }

    fn push(&mut self, kind: SyntaxKind, len: usize) {
        let end = self.at + len;
        match self.tokens.last_mut() {
            // A run of unknown characters is one token and one error.
            Some(last) if kind == SyntaxKind::Unknown && last.kind == kind => last.end = end,
            _ => {
                if kind == SyntaxKind::Unknown {
                    self.unknown();
                }
                self.tokens.push(Token { kind, start: self.at, end });
            }
        }
        self.at = end;
    }

    fn unknown(&mut self) {
        let c = self.rest().chars().next().unwrap_or_default();
        let expected = match c {
            ';' => Some("`,` between elements"),
            '/' => Some("`//` or `/*` to start a comment"),
            '`' | '\u{201C}' | '\u{201D}' => Some("`\"` around a string"),
            _ => None,
        };
        self.error(0, c.len_utf8(), ErrorKind::UnknownCharacter, format!("found {c:?}"), expected);
    }

    /// Reports an error about the bytes `from..to` after the current position.
    fn error(&mut self, from: usize, to: usize, code: ErrorKind, message: String, expected: Option<&str>) {
        let span = self.at + from..self.at + to;
        self.errors.push(SyntaxError { span, message, expected: expected.map(str::to_owned), code });
    }

    fn while_len(&self, of: fn(char) -> bool) -> usize {
        self.rest().find(|c| !of(c)).unwrap_or(self.rest().len())
    }

    fn token(&mut self, c: char) -> (SyntaxKind, usize) {
        use SyntaxKind::*;
        let rest = self.rest();
        match c {
            // Alone it is one error, and the text behind it is read as if it were not there.
            BYTE_ORDER_MARK if self.at == 0 => {
                let message = "the text begins with a byte order mark".to_owned();
                let expected = Some("UTF-8 without one, as editors can save it");
                self.error(0, c.len_utf8(), ErrorKind::UnknownCharacter, message, expected);
                (Whitespace, c.len_utf8())
            }
            c if is_whitespace(c) => (Whitespace, self.while_len(is_whitespace)),
            '/' if rest.starts_with("//") => (LineComment, rest.find('\n').unwrap_or(rest.len())),
            '/' if rest.starts_with("/*") => (BlockComment, self.block_comment()),
            '(' => (LParen, 1),
            ')' => (RParen, 1),
            '[' => (LBracket, 1),
            ']' => (RBracket, 1),
            '{' => (LBrace, 1),
            '}' => (RBrace, 1),
            ',' => (Comma, 1),
            ':' => (Colon, 1),
            '=' => (Eq, 1),
            '#' => (Hash, 1),
            '!' => (Bang, 1),
            '.' if rest.starts_with("..=") => (DotDotEq, 3),
            '.' if rest.starts_with("..") => (DotDot, 2),
            '0'..='9' | '+' | '-' | '.' => (Number, self.number()),
            '"' => (Str, self.string(1, Encoding::Text)),
            '\'' => (Char, self.character(1, Encoding::Char)),
            'b' if rest.starts_with("b\"") => (ByteStr, self.string(2, Encoding::Bytes)),
            'b' if rest.starts_with("b'") => (Byte, self.character(2, Encoding::Byte)),
            'b' if rest.starts_with("br\"") || rest.starts_with("br#") => (RawByteStr, self.raw_string(2)),
            'r' if rest.starts_with("r\"") || rest.starts_with("r#\"") || rest.starts_with("r##") => {
                (RawStr, self.raw_string(1))
            }
            'r' if rest.starts_with("r#") => self.raw_ident(),
            c if is_ident_start(c) => (Ident, self.ident()),
            c => (Unknown, c.len_utf8()),
        }
    }

    fn ident(&self) -> usize {
        let first = self.rest().chars().next().map_or(0, char::len_utf8);
        let tail = &self.rest()[first..];
        first + tail.find(|c| !is_xid_continue(c)).unwrap_or(tail.len())
    }

    fn raw_ident(&mut self) -> (SyntaxKind, usize) {
        let name = &self.rest()[2..];
        let len = name.find(|c| !is_raw_ident_char(c)).unwrap_or(name.len());
        if len == 0 {
            self.error(
                0,
                2,
                ErrorKind::Unexpected,
                "`r#` is incomplete".to_owned(),
                Some("a name or `\"` after it"),
            );
        }
        (SyntaxKind::RawIdent, 2 + len)
    }

    fn block_comment(&mut self) -> usize {
        let bytes = self.rest().as_bytes();
        let (mut at, mut level) = (2, 1);
        while level > 0 {
            match (bytes.get(at), bytes.get(at + 1)) {
                (Some(b'/'), Some(b'*')) => (at, level) = (at + 2, level + 1),
                (Some(b'*'), Some(b'/')) => (at, level) = (at + 2, level - 1),
                (Some(_), _) => at += 1,
                (None, _) => {
                    let message = "this comment is never closed".to_owned();
                    self.error(0, 2, ErrorKind::UnterminatedComment, message, Some("`*/`"));
                    return bytes.len();
                }
            }
        }
        at
    }

    fn number(&mut self) -> usize {
        let (len, number) = number::scan(self.rest());
        if let Err(message) = number {
            self.error(0, len, ErrorKind::BadNumber, message, Some("a number"));
        }
        len
    }

    /// The part of the rest that a string may fill.
    fn string_room(&mut self) -> &'t str {
        let rest = self.rest();
        if !self.strings_end_with_line {
            return rest;
        }
        if self.line_end <= self.at {
            self.line_end = self.at + rest.find('\n').unwrap_or(rest.len());
        }
        self.text[self.at..self.line_end].trim_end_matches('\r')
    }

    fn open_string(&mut self, quote: usize, room: &str, expected: &str) -> usize {
        self.open_strings += 1;
        let message = "this string is never closed".to_owned();
        self.error(0, quote, ErrorKind::UnterminatedString, message, Some(expected));
        // On a line of its own, what would follow the string most probably does.
        let inside = if self.strings_end_with_line {
            room.trim_end_matches([',', ')', ']', '}', ' ', '\t'])
        } else {
            room
        };
        inside.len().max(quote)
    }

    fn string(&mut self, quote: usize, encoding: Encoding) -> usize {
        let room = self.string_room();
        let bytes = room.as_bytes();
        let mut end = quote;
        loop {
            match bytes.get(end) {
                Some(b'"') => break,
                // The second byte may be the first of a longer character: none of its bytes is a quote.
                Some(b'\\') if end + 1 < bytes.len() => end += 2,
                Some(_) => end += 1,
                None => return self.open_string(quote, room, "`\"` at its end"),
            }
        }
        quoted::decode(&room[quote..end], encoding, |bad| {
            let span = self.at + quote + bad.span.start..self.at + quote + bad.span.end;
            let message = format!("`{}`: {}", &self.text[span.clone()], bad.why);
            let expected = Some(r#"one of \" \\ \' \n \r \t \0 \x.. \u{...}"#.to_owned());
            self.errors.push(SyntaxError { span, message, expected, code: ErrorKind::BadEscape });
        });
        end + 1
    }

    fn raw_string(&mut self, prefix: usize) -> usize {
        let room = self.string_room();
        let hashes = room[prefix..].bytes().take_while(|&b| b == b'#').count();
        let quote = prefix + hashes;
        if !room[quote..].starts_with('"') {
            let message = format!("`{}` starts no raw string", &room[..quote]);
            self.error(0, quote, ErrorKind::Unexpected, message, Some("`\"` after the `#`"));
            return quote;
        }
        let ending = format!("\"{}", &room[prefix..quote]);
        match room[quote + 1..].find(&ending) {
            Some(len) => quote + 1 + len + ending.len(),
            None => self.open_string(quote + 1, room, &format!("`{ending}` at its end")),
        }
    }

    fn character(&mut self, quote: usize, encoding: Encoding) -> usize {
        let body = &self.rest()[quote..];
        let (len, result) = match body.chars().next() {
            Some('\\') => quoted::escape(body, encoding, &mut Vec::new()),
            Some(c) if encoding == Encoding::Byte && !c.is_ascii() => {
                (c.len_utf8(), Err("a byte literal holds one ASCII character"))
            }
            Some(c) => (c.len_utf8(), Ok(())),
            None => (0, Err("the text ends after a quote")),
        };
        let closed = body[len..].starts_with('\'');
        if closed && result.is_ok() {
            return quote + len + 1;
        }
        // Someone may have put a whole string in single quotes.
        let end = match body.find(['\'', '\n']) {
            _ if closed => quote + len + 1,
            Some(end) if body[end..].starts_with('\'') => quote + end + 1,
            _ => quote,
        };
        let (code, why) = match result {
            Err(why) if closed => (ErrorKind::BadEscape, why),
            _ => (ErrorKind::BadCharacter, "a literal in single quotes holds exactly one character"),
        };
        self.error(0, end, code, why.to_owned(), Some("one character, or `\"` around a string"));
        end
    }
}
