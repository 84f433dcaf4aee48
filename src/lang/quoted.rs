//! Quoted text: escapes of strings, byte strings, characters and bytes.

use super::error::Span;

/// The allowed escapes, and their meaning.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// `"..."`: `\x` escapes may spell out the UTF-8 bytes of one character.
    Text,
    /// `'.'`: a `\x` escape is one character below 128.
    Char,
    /// `b"..."`: `\x` is any byte.
    Bytes,
    /// `b'.'`: `\x` is any byte, and `\u` is not allowed.
    Byte,
}

/// An invalid escape: its position in the text, and the reason.
pub(super) struct BadEscape {
    pub span: Span,
    pub why: &'static str,
}

/// Decodes the text between the quotes of a string. Bad escapes are reported and left out.
pub(super) fn decode(body: &str, encoding: Encoding, mut bad: impl FnMut(BadEscape)) -> Vec<u8> {
    let mut out = Vec::with_capacity(body.len());
    let mut at = 0;
    while let Some(next) = body[at..].find('\\') {
        out.extend_from_slice(&body.as_bytes()[at..at + next]);
        at += next;
        let rest = &body[at..];
        let (len, result) = match continuation(&rest[1..]) {
            Some(len) => (1 + len, Ok(())),
            None => escape(rest, encoding, &mut out),
        };
        if let Err(why) = result {
            bad(BadEscape { span: at..at + len, why });
        }
        at += len;
    }
    out.extend_from_slice(&body.as_bytes()[at..]);
    out
}

/// A backslash before a line end swallows it and the white space after it.
fn continuation(after: &str) -> Option<usize> {
    let line = after.strip_prefix("\r\n").or_else(|| after.strip_prefix('\n'))?;
    Some(after.len() - line.trim_start_matches([' ', '\t', '\n', '\r']).len())
}

/// Reads one escape, backslash included, and appends its character. Returns its length.
pub(super) fn escape(text: &str, encoding: Encoding, out: &mut Vec<u8>) -> (usize, Result<(), &'static str>) {
    let Some(c) = text[1..].chars().next() else {
        return (1, Err("the literal ends after a backslash"));
    };
    let simple = match c {
        '\'' | '"' | '\\' => c as u8,
        'n' => b'\n',
        'r' => b'\r',
        't' => b'\t',
        '0' => b'\0',
        'x' => return byte_escape(text, encoding, out),
        'u' => return unicode_escape(text, encoding, out),
        _ => return (1 + c.len_utf8(), Err("this is not an escape of RON")),
    };
    out.push(simple);
    (2, Ok(()))
}

fn hex_byte(text: &str) -> Option<u8> {
    let digits = text.strip_prefix("\\x")?.as_bytes().get(..2)?;
    let digit = |b: u8| char::from(b).to_digit(16);
    Some((digit(digits[0])? * 16 + digit(digits[1])?) as u8)
}

fn byte_escape(text: &str, encoding: Encoding, out: &mut Vec<u8>) -> (usize, Result<(), &'static str>) {
    let Some(first) = hex_byte(text) else {
        return (2, Err("`\\x` needs two hexadecimal digits"));
    };
    if first < 0x80 || matches!(encoding, Encoding::Bytes | Encoding::Byte) {
        out.push(first);
        return (4, Ok(()));
    }
    if encoding == Encoding::Char {
        return (4, Err("a `\\x` escape in a character goes up to `\\x7F`; use `\\u{...}`"));
    }
    let mut bytes = vec![first];
    while bytes.len() < 4 {
        let Some(next) = text.get(bytes.len() * 4..).and_then(hex_byte) else { break };
        bytes.push(next);
        if std::str::from_utf8(&bytes).is_ok() {
            out.extend_from_slice(&bytes);
            return (bytes.len() * 4, Ok(()));
        }
    }
    (bytes.len() * 4, Err("these `\\x` escapes are not the UTF-8 bytes of a character"))
}

fn unicode_escape(text: &str, encoding: Encoding, out: &mut Vec<u8>) -> (usize, Result<(), &'static str>) {
    let Some(rest) = text[2..].strip_prefix('{') else {
        return (2, Err("`\\u` needs its digits in braces, as in `\\u{1F600}`"));
    };
    let len = rest.bytes().take_while(u8::is_ascii_hexdigit).count();
    if !rest[len..].starts_with('}') {
        return (3 + len, Err("`\\u{` needs hexadecimal digits and then `}`"));
    }
    let whole = 3 + len + 1;
    if !(1..=6).contains(&len) {
        return (whole, Err("`\\u{...}` needs one to six digits"));
    }
    if encoding == Encoding::Byte {
        return (whole, Err("a byte cannot be a Unicode escape"));
    }
    match u32::from_str_radix(&rest[..len], 16).ok().and_then(char::from_u32) {
        Some(c) => {
            out.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
            (whole, Ok(()))
        }
        None => (whole, Err("there is no Unicode character with this number")),
    }
}

/// Writes a string as a RON string literal.
#[must_use]
pub fn quote(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => out.push_str(&format!("\\u{{{:x}}}", u32::from(c))),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
