//! The numbers of RON: how long one is in the text, and its value.
//!
//! `ron` reads a number in two tries: digits that look like an integer are read as one, and as a float
//! when that fails (`1e5` and `1f32` consist of hexadecimal digits only). Both attempts are made here, since
//! the set of accepted numbers follows from them.

use unicode_ident::is_xid_continue;

/// The value of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    Int(i128),
    Float(f64),
}

const NAMED: [(&str, f64); 2] = [("inf", f64::INFINITY), ("NaN", f64::NAN)];
const INT_SUFFIXES: [(&str, i128, i128); 8] = [
    ("i8", i8::MIN as i128, i8::MAX as i128),
    ("i16", i16::MIN as i128, i16::MAX as i128),
    ("i32", i32::MIN as i128, i32::MAX as i128),
    ("i64", i64::MIN as i128, i64::MAX as i128),
    ("u8", 0, u8::MAX as i128),
    ("u16", 0, u16::MAX as i128),
    ("u32", 0, u32::MAX as i128),
    ("u64", 0, u64::MAX as i128),
];

/// The value of `inf`, `NaN` and their suffixed forms.
pub(super) fn named(text: &str) -> Option<f64> {
    let stem = text.strip_suffix("f32").or_else(|| text.strip_suffix("f64")).unwrap_or(text);
    NAMED.iter().find(|(name, _)| *name == stem).map(|&(_, value)| value)
}

/// Reads the number at the start of `text`, which begins with a digit, a sign or a point, but not `..`.
/// Returns its length in bytes, also of a malformed one, so that the rest can be read on.
pub(super) fn scan(text: &str) -> (usize, Result<Number, String>) {
    let read = signed_name(text).map_or_else(|| digits(text), Ok);
    let end = *read.as_ref().map_or(&0, |(len, _)| len);
    // No number may be glued to a letter, a digit, a sign or a single point.
    let rest = &text[end..];
    let glued = glued_len(rest);
    match read {
        Ok((len, number)) if glued == 0 => (len, Ok(number)),
        Ok((len, _)) => {
            let whole = len + glued;
            let why = digits_error(text).unwrap_or_else(|| {
                format!("`{}` follows the number {} directly", &rest[..glued], &text[..len])
            });
            (whole, Err(why))
        }
        Err(why) => (glued.max(1), Err(why)),
    }
}

/// The length of the text that a reader would see as part of the same word.
fn glued_len(text: &str) -> usize {
    let word = text.find(|c| !(is_xid_continue(c) || matches!(c, '.' | '+' | '-'))).unwrap_or(text.len());
    text[..word].find("..").unwrap_or(word)
}

fn signed_name(text: &str) -> Option<(usize, Number)> {
    let (sign, rest) = match text.as_bytes().first()? {
        b'-' => (-1.0, &text[1..]),
        b'+' => (1.0, &text[1..]),
        _ => return None,
    };
    let len = rest.find(|c| !is_xid_continue(c)).unwrap_or(rest.len());
    named(&rest[..len]).map(|value| (1 + len, Number::Float(sign * value)))
}

fn is_int_char(c: char) -> bool {
    c.is_ascii_hexdigit() || c == '_'
}

fn run(text: &str, of: fn(char) -> bool) -> usize {
    text.find(|c| !of(c)).unwrap_or(text.len())
}

fn float_run(text: &str) -> usize {
    let len = run(text, |c| c.is_ascii_digit() || matches!(c, 'e' | 'E' | '.' | '+' | '-' | '_'));
    text[..len].find("..").unwrap_or(len)
}

fn unsigned(text: &str) -> &str {
    text.strip_prefix(['+', '-']).unwrap_or(text)
}

fn digits(text: &str) -> Result<(usize, Number), String> {
    let body = unsigned(text);
    if float_run(body) > run(body, is_int_char) {
        return float(text);
    }
    integer(text).or_else(|why| float(text).map_err(|_| why))
}

/// Reason why the digits are no integer, if they were read as a float only up to the offending character.
fn digits_error(text: &str) -> Option<String> {
    let body = unsigned(text);
    if float_run(body) > run(body, is_int_char) { None } else { integer(text).err() }
}

fn integer(text: &str) -> Result<(usize, Number), String> {
    let negative = text.starts_with('-');
    let body = unsigned(text);
    let (base, name, prefix) = match body.get(..2) {
        Some("0b") => (2, "binary", 2),
        Some("0o") => (8, "octal", 2),
        Some("0x") => (16, "hexadecimal", 2),
        _ => (10, "decimal", 0),
    };
    let body = &body[prefix..];
    let len = run(body, is_int_char);
    let (digits, tail) = body.split_at(len);
    if digits.is_empty() {
        return Err(format!("`{}` has no digits", &text[..text.len() - body.len()]));
    }
    if digits.starts_with('_') {
        return Err("a number cannot begin with `_`".to_owned());
    }
    let word = &tail[..run(tail, is_xid_continue)];
    let suffix = INT_SUFFIXES.iter().find(|(name, ..)| *name == word);
    let (min, max, suffix_len) = match suffix {
        Some(&(name, min, max)) => (min, max, name.len()),
        None => (i64::MIN.into(), if negative { 0 } else { u64::MAX.into() }, 0),
    };
    let mut value: i128 = 0;
    for c in digits.chars().filter(|&c| c != '_') {
        let digit = c.to_digit(16).filter(|&d| d < base);
        let digit = digit.ok_or_else(|| format!("`{c}` is not a {name} digit"))?;
        let signed = if negative { -i128::from(digit) } else { i128::from(digit) };
        value = value * i128::from(base) + signed;
        if !(min..=max).contains(&value) {
            return Err(match suffix {
                Some((name, ..)) => format!("the number does not fit `{name}`, which holds {min} to {max}"),
                None => {
                    format!("the number is out of range: an integer is between {} and {}", i64::MIN, u64::MAX)
                }
            });
        }
    }
    Ok((text.len() - tail.len() + suffix_len, Number::Int(value)))
}

fn float(text: &str) -> Result<(usize, Number), String> {
    let len = float_run(text);
    let mut digits = String::with_capacity(len);
    let mut underscore_fits = false;
    for c in text[..len].chars() {
        match c {
            '_' if underscore_fits => continue,
            '_' => return Err("`_` is allowed only after a digit or an exponent's `e`".to_owned()),
            '0'..='9' | 'e' | 'E' => underscore_fits = true,
            '.' => underscore_fits = false,
            _ => {}
        }
        digits.push(c);
    }
    let malformed = |_| format!("`{}` is not a number", &text[..len]);
    let tail = &text[len..];
    match &tail[..run(tail, is_xid_continue)] {
        "f32" => Ok((len + 3, Number::Float(digits.parse::<f32>().map_err(malformed)?.into()))),
        "f64" => Ok((len + 3, Number::Float(digits.parse().map_err(malformed)?))),
        _ => Ok((len, Number::Float(digits.parse().map_err(malformed)?))),
    }
}
