//! Reads the part of RON that an edited file of records needs, and remembers where every value stands.

use std::fmt;

/// Deepest nesting.
const DEEPEST: usize = 16;

/// Where something stands in a text: line and column from 1, the column in characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column.
    pub column: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// What is wrong with a text, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {message}")]
pub struct TextError {
    /// Where.
    pub place: Place,
    /// What was found and what would be right.
    pub message: String,
}

impl TextError {
    /// An error at a place.
    #[must_use]
    pub fn new(place: Place, message: impl Into<String>) -> Self {
        Self { place, message: message.into() }
    }
}

/// A value with its place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Datum {
    pub place: Place,
    pub kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Number(f64),
    Text(String),
    /// A bare word: `true`, `None`.
    Word(String),
    List(Vec<Datum>),
    /// `Name(a: 1, b: 2)` or `(a: 1)`.
    Record(Vec<Field>),
    /// `Some(1)`: a name around one value.
    Wrapped(String, Box<Datum>),
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    pub name: String,
    pub place: Place,
    pub value: Datum,
}

impl Datum {
    /// The value without `Some` around it; `None` for the word `None`.
    pub fn given(&self) -> Option<&Self> {
        match &self.kind {
            Kind::Word(word) if word == "None" => None,
            Kind::Wrapped(name, inner) if name == "Some" => inner.given(),
            _ => Some(self),
        }
    }

    /// What it is, for messages.
    pub fn shown(&self) -> String {
        match &self.kind {
            Kind::Number(x) => x.to_string(),
            Kind::Text(text) => format!("{:?}", text.chars().take(40).collect::<String>()),
            Kind::Word(word) | Kind::Wrapped(word, _) => word.chars().take(40).collect(),
            Kind::List(_) => "a list".into(),
            Kind::Record(_) => "a record in parentheses".into(),
        }
    }

    /// The error that something else stands here.
    pub fn wrong(&self, what: &str, wanted: &str) -> TextError {
        TextError::new(self.place, format!("{what} is {}; {wanted} is needed", self.shown()))
    }

    pub fn number(&self, what: &str, low: f64, high: f64) -> Result<f64, TextError> {
        match self.kind {
            Kind::Number(x) if (low..=high).contains(&x) => Ok(x),
            _ => Err(self.wrong(what, &format!("a number from {low} to {high}"))),
        }
    }

    pub fn text(&self, what: &str) -> Result<String, TextError> {
        match &self.kind {
            Kind::Text(text) => Ok(text.clone()),
            _ => Err(self.wrong(what, "a text in quotes")),
        }
    }

    pub fn truth(&self, what: &str) -> Result<bool, TextError> {
        match &self.kind {
            Kind::Word(word) if word == "true" => Ok(true),
            Kind::Word(word) if word == "false" => Ok(false),
            _ => Err(self.wrong(what, "true or false")),
        }
    }

    pub fn list(&self, what: &str) -> Result<&[Self], TextError> {
        match &self.kind {
            Kind::List(items) => Ok(items),
            _ => Err(self.wrong(what, "a list in [brackets]")),
        }
    }

    /// The fields, of which only those of `known` may be there, each once.
    pub fn record(&self, what: &str, known: &[&str]) -> Result<&[Field], TextError> {
        let Kind::Record(fields) = &self.kind else {
            return Err(self.wrong(what, "a record such as (name: value)"));
        };
        for (k, field) in fields.iter().enumerate() {
            if !known.contains(&field.name.as_str()) {
                let message =
                    format!("{what} has no field `{}`; fields are {}", field.name, known.join(", "));
                return Err(TextError::new(field.place, message));
            }
            if let Some(first) = fields[..k].iter().find(|f| f.name == field.name) {
                let message = format!("`{}` stands at {} already", field.name, first.place);
                return Err(TextError::new(field.place, message));
            }
        }
        Ok(fields)
    }
}

/// Reads a whole text.
pub(crate) fn read(text: &str) -> Result<Datum, TextError> {
    let mut reader =
        Reader { rest: text.strip_prefix('\u{feff}').unwrap_or(text), place: Place { line: 1, column: 1 } };
    reader.skip()?;
    while reader.rest.starts_with("#![") {
        let end = reader.rest.find(']').ok_or_else(|| reader.error("an attribute has no end"))?;
        reader.advance(end + 1);
        reader.skip()?;
    }
    let datum = reader.value(0)?;
    reader.skip()?;
    if reader.rest.is_empty() { Ok(datum) } else { Err(reader.unexpected("the end of the file")) }
}

struct Reader<'a> {
    rest: &'a str,
    place: Place,
}

impl Reader<'_> {
    fn error(&self, message: &str) -> TextError {
        TextError::new(self.place, message)
    }

    fn unexpected(&self, wanted: &str) -> TextError {
        let found = self.rest.chars().next().map_or("the end of the file".into(), |c| format!("{c:?}"));
        TextError::new(self.place, format!("found {found} where {wanted} should be"))
    }

    fn advance(&mut self, bytes: usize) {
        let (done, rest) = self.rest.split_at(bytes);
        for c in done.chars() {
            if c == '\n' {
                self.place = Place { line: self.place.line + 1, column: 1 };
            } else {
                self.place.column += 1;
            }
        }
        self.rest = rest;
    }

    /// Passes spaces and comments.
    fn skip(&mut self) -> Result<(), TextError> {
        loop {
            let blank = self.rest.len() - self.rest.trim_start().len();
            self.advance(blank);
            if self.rest.starts_with("//") {
                self.advance(self.rest.find('\n').unwrap_or(self.rest.len()));
            } else if self.rest.starts_with("/*") {
                self.block_comment()?;
            } else {
                return Ok(());
            }
        }
    }

    fn block_comment(&mut self) -> Result<(), TextError> {
        let error = self.error("a comment has no end");
        let mut depth = 0_usize;
        loop {
            if self.rest.starts_with("/*") {
                depth += 1;
                self.advance(2);
            } else if self.rest.starts_with("*/") {
                depth -= 1;
                self.advance(2);
            } else {
                let next = self.rest.chars().next().ok_or_else(|| error.clone())?;
                self.advance(next.len_utf8());
            }
            if depth == 0 {
                return Ok(());
            }
        }
    }

    fn take(&mut self, c: char) -> bool {
        let found = self.rest.starts_with(c);
        if found {
            self.advance(c.len_utf8());
        }
        found
    }

    fn value(&mut self, depth: usize) -> Result<Datum, TextError> {
        if depth > DEEPEST {
            return Err(self.error("nested too deeply"));
        }
        let place = self.place;
        let kind = match self.rest.chars().next() {
            Some('[') => self.list(depth)?,
            Some('(') => self.record(depth)?,
            Some('"') => Kind::Text(self.quoted()?),
            Some(c) if c.is_ascii_digit() || matches!(c, '-' | '+' | '.') => self.number()?,
            Some(c) if c.is_alphabetic() || c == '_' => self.named(depth)?,
            _ => return Err(self.unexpected("a value")),
        };
        Ok(Datum { place, kind })
    }

    fn number(&mut self) -> Result<Kind, TextError> {
        let more = |c: char| !(c.is_ascii_alphanumeric() || matches!(c, '-' | '+' | '.' | '_'));
        let text = &self.rest[..self.rest.find(more).unwrap_or(self.rest.len())];
        // RON lets single underscores stand between digits.
        let plain: String = text.chars().filter(|c| *c != '_').collect();
        let digits = plain.chars().all(|c| c.is_ascii_digit() || matches!(c, '-' | '+' | '.' | 'e' | 'E'));
        let value = plain.parse::<f64>().ok().filter(|x| digits && x.is_finite());
        let value = value.ok_or_else(|| {
            TextError::new(
                self.place,
                format!("{:?} is no number", text.chars().take(40).collect::<String>()),
            )
        })?;
        self.advance(text.len());
        Ok(Kind::Number(value))
    }

    fn word(&mut self) -> String {
        let end = self.rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(self.rest.len());
        let word = self.rest[..end].to_owned();
        self.advance(end);
        word
    }

    fn named(&mut self, depth: usize) -> Result<Kind, TextError> {
        let name = self.word();
        self.skip()?;
        if !self.rest.starts_with('(') {
            return Ok(Kind::Word(name));
        }
        if name != "Some" {
            return self.record(depth);
        }
        self.advance(1);
        self.skip()?;
        let inner = self.value(depth + 1)?;
        self.skip()?;
        self.take(',');
        self.skip()?;
        if self.take(')') { Ok(Kind::Wrapped(name, Box::new(inner))) } else { Err(self.unexpected("`)`")) }
    }

    fn list(&mut self, depth: usize) -> Result<Kind, TextError> {
        self.advance(1);
        let mut items = Vec::new();
        loop {
            self.skip()?;
            if self.take(']') {
                return Ok(Kind::List(items));
            }
            items.push(self.value(depth + 1)?);
            self.skip()?;
            if !self.take(',') && !self.rest.starts_with(']') {
                return Err(self.unexpected("`,` or `]`"));
            }
        }
    }

    fn record(&mut self, depth: usize) -> Result<Kind, TextError> {
        self.advance(1);
        let mut fields = Vec::new();
        loop {
            self.skip()?;
            if self.take(')') {
                return Ok(Kind::Record(fields));
            }
            let (place, name) = (self.place, self.word());
            if name.is_empty() {
                return Err(self.unexpected("the name of a field"));
            }
            self.skip()?;
            if !self.take(':') {
                return Err(self.unexpected("`:`"));
            }
            self.skip()?;
            let value = self.value(depth + 1)?;
            fields.push(Field { name, place, value });
            self.skip()?;
            if !self.take(',') && !self.rest.starts_with(')') {
                return Err(self.unexpected("`,` or `)`"));
            }
        }
    }

    fn quoted(&mut self) -> Result<String, TextError> {
        let open = self.error("a text has no closing quote");
        self.advance(1);
        let mut text = String::new();
        loop {
            let c = self.rest.chars().next().ok_or_else(|| open.clone())?;
            match c {
                '"' => {
                    self.advance(1);
                    return Ok(text);
                }
                '\\' => {
                    let escaped = self.rest.chars().nth(1).ok_or_else(|| open.clone())?;
                    let plain = match escaped {
                        'n' => '\n',
                        't' => '\t',
                        '"' | '\\' | '\'' => escaped,
                        _ => {
                            return Err(self.error("only \\n, \\t, \\\" and \\\\ are read after a backslash"));
                        }
                    };
                    text.push(plain);
                    self.advance(1 + escaped.len_utf8());
                }
                _ => {
                    text.push(c);
                    self.advance(c.len_utf8());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_lists_and_comments_are_read_with_their_places() {
        let text = "#![schema = \"x\"]\n// a comment\nSet(\n  pairs: [\n    (at: 1_0.5e0, name: \"\u{fc}b\\\"er\", on: true), /* b /* c */ */\n  ],\n  gap: Some(-2),\n)\n";
        let datum = read(text).unwrap();
        let fields = datum.record("set", &["pairs", "gap"]).unwrap();
        assert_eq!(
            (datum.place, fields[1].place),
            (Place { line: 3, column: 1 }, Place { line: 7, column: 3 })
        );
        let pair = fields[0].value.list("pairs").unwrap()[0].record("pair", &["at", "name", "on"]).unwrap();
        assert_eq!(pair[0].value.number("at", 0.0, 20.0), Ok(10.5));
        assert_eq!(pair[1].value.text("name").unwrap(), "\u{fc}b\"er");
        assert_eq!(pair[2].value.place, Place { line: 5, column: 39 });
        assert_eq!(pair[2].value.truth("on"), Ok(true));
        assert_eq!(fields[1].value.given().unwrap().number("gap", -9.0, 9.0), Ok(-2.0));
    }

    #[test]
    fn errors_say_where_and_what_would_be_right() {
        for (text, place, part) in [
            ("", "1:1", "a value"),
            ("(a: 1", "1:6", "`,` or `)`"),
            ("(a 1)", "1:4", "`:`"),
            ("[1, 2\n 3]", "2:2", "`,` or `]`"),
            ("(a: \"x)", "1:5", "closing quote"),
            ("/* x", "1:1", "comment"),
            ("(a: 1) b", "1:8", "end of the file"),
            ("1e999", "1:1", "no number"),
            ("\"\\x\"", "1:2", "backslash"),
            (&"[".repeat(40), "1:18", "deeply"),
        ] {
            let e = read(text).unwrap_err();
            assert!(e.place.to_string() == place && e.message.contains(part), "{text:?}: {e}");
        }
        let datum = read("(a: 1, a: 2)").unwrap();
        assert!(datum.record("it", &["a"]).unwrap_err().to_string().starts_with("1:8: `a` stands at 1:2"));
        assert!(datum.record("it", &["b", "c"]).unwrap_err().message.contains("fields are b, c"));
    }

    #[test]
    fn any_text_is_survived() {
        let pieces = [
            "(",
            ")",
            "[",
            "]",
            "a",
            ":",
            ",",
            "\"",
            "\\",
            "1.5",
            "//",
            "/*",
            "*/",
            "\n",
            " ",
            "Some",
            "-",
            "\u{1F600}",
            "#![",
        ];
        let mut state = 1_u32;
        for _ in 0..3000 {
            let mut text = String::new();
            for _ in 0..12 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                text.push_str(pieces[(state >> 16) as usize % pieces.len()]);
            }
            let _ = read(&text);
        }
    }
}
