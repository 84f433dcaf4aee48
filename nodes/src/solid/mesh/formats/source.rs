//! The words of a text file, or the numbers of a binary section, with their positions.

use super::super::error::TetMeshError;

/// Order of the bytes of a binary section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Endian {
    Little,
    Big,
}

/// Cursor over a file.
pub(super) struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Line of the last word, from 1.
    line: usize,
    /// Lines passed so far.
    passed: usize,
    comment: &'static [u8],
    /// Set while the numbers are binary.
    pub(super) binary: Option<Endian>,
}

/// A word for a message: its beginning, in quotes.
pub(super) fn shown(word: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(word).chars().take(40).collect();
    format!("{text:?}")
}

impl<'a> Source<'a> {
    /// A text whose comments go from a character of `comment` to the end of the line.
    pub(super) fn new(bytes: &'a [u8], comment: &'static [u8]) -> Self {
        Self { bytes, at: 0, line: 1, passed: 1, comment, binary: None }
    }

    /// An error at the position of the last word.
    pub(super) fn error(&self, what: impl Into<String>) -> TetMeshError {
        let position =
            if self.binary.is_some() { format!("byte {}", self.at) } else { format!("line {}", self.line) };
        TetMeshError::Text { position, what: what.into() }
    }

    fn skip_blank(&mut self) {
        while let Some(&b) = self.bytes.get(self.at) {
            if self.comment.contains(&b) {
                self.at += self.bytes[self.at..]
                    .iter()
                    .position(|b| *b == b'\n')
                    .unwrap_or(self.bytes.len() - self.at);
            } else if b.is_ascii_whitespace() {
                self.passed += usize::from(b == b'\n');
                self.at += 1;
            } else {
                break;
            }
        }
    }

    /// The next word.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blank();
        self.line = self.passed;
        let rest = &self.bytes[self.at..];
        let end = rest
            .iter()
            .position(|b| b.is_ascii_whitespace() || self.comment.contains(b))
            .unwrap_or(rest.len());
        self.at += end;
        (end > 0).then(|| &rest[..end])
    }

    /// The next word, without passing it.
    pub(super) fn peek(&mut self) -> Option<&'a [u8]> {
        let (at, line, passed) = (self.at, self.line, self.passed);
        let word = self.word();
        (self.at, self.line, self.passed) = (at, line, passed);
        word
    }

    /// The words up to the end of the line of the last one.
    pub(super) fn rest_of_line(&mut self) -> Vec<&'a [u8]> {
        let line = self.passed;
        let mut words = Vec::new();
        loop {
            let before = (self.at, self.line, self.passed);
            match self.word() {
                Some(word) if self.line == line => words.push(word),
                _ => {
                    (self.at, self.line, self.passed) = before;
                    return words;
                }
            }
        }
    }

    /// Skips everything up to and including a word; returns false if the word does not follow.
    pub(super) fn pass(&mut self, end: &[u8]) -> bool {
        let rest = &self.bytes[self.at..];
        let Some(found) = rest.windows(end.len()).position(|w| w == end) else { return false };
        self.passed += rest[..found].iter().filter(|b| **b == b'\n').count();
        self.line = self.passed;
        self.at += found + end.len();
        true
    }

    /// Skips the end of the line, after which a binary section begins.
    pub(super) fn end_line(&mut self) {
        if self.bytes.get(self.at) == Some(&b'\r') {
            self.at += 1;
        }
        if self.bytes.get(self.at) == Some(&b'\n') {
            self.at += 1;
            self.passed += 1;
        }
    }

    /// The next `N` bytes of a binary section, the least significant first.
    fn raw<const N: usize>(&mut self, endian: Endian, what: &str) -> Result<[u8; N], TetMeshError> {
        let Some(bytes) = self.bytes.get(self.at..self.at + N) else {
            return Err(self.error(format!("the file ends where {what} is needed")));
        };
        self.at += N;
        let mut raw = [0; N];
        raw.copy_from_slice(bytes);
        if endian == Endian::Big {
            raw.reverse();
        }
        Ok(raw)
    }

    fn parsed<T: std::str::FromStr>(&mut self, what: &str, kind: &str) -> Result<T, TetMeshError> {
        let Some(word) = self.word() else {
            return Err(self.error(format!("the file ends where {what} is needed")));
        };
        let value = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        value.ok_or_else(|| self.error(format!("found {} where {what}, {kind}, is needed", shown(word))))
    }

    /// A 32-bit whole number.
    pub(super) fn int(&mut self, what: &str) -> Result<i64, TetMeshError> {
        match self.binary {
            Some(endian) => Ok(i32::from_le_bytes(self.raw(endian, what)?).into()),
            None => self.parsed(what, "a whole number"),
        }
    }

    /// A 64-bit whole number from 0 on.
    pub(super) fn size(&mut self, what: &str) -> Result<u64, TetMeshError> {
        match self.binary {
            Some(endian) => Ok(u64::from_le_bytes(self.raw(endian, what)?)),
            None => self.parsed(what, "a whole number from 0 on"),
        }
    }

    /// A number.
    pub(super) fn real(&mut self, what: &str) -> Result<f64, TetMeshError> {
        match self.binary {
            Some(endian) => Ok(f64::from_le_bytes(self.raw(endian, what)?)),
            None => self.parsed(what, "a number"),
        }
    }

    /// Three coordinates.
    pub(super) fn position(&mut self) -> Result<[f64; 3], TetMeshError> {
        Ok([self.real("x")?, self.real("y")?, self.real("z")?])
    }
}
