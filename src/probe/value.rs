//! Values as JSON of a readable size.

use super::text::{Listing, figure};
use foley_nodes::core::item::AnyValue;
use serde::Serialize;
use serde_json::Value;
use std::fmt::Write as _;
use std::io::{self, Write};

/// Largest JSON that is read, bytes.
const MAX_BYTES: usize = 64 << 20;
/// Largest number of lines that are shown.
const MAX_LINES: usize = 80;
/// Largest text of a string that is shown, in characters.
const MAX_TEXT: usize = 120;

/// A value.
#[derive(Clone, Debug, Serialize)]
pub struct ValueFigures {
    /// Name of its type.
    pub value: &'static str,
    /// Hash of its content, hexadecimal.
    pub hash: String,
    /// Bytes of its JSON, if it is not larger than 64 MiB.
    pub bytes: Option<usize>,
    /// Its JSON; `None` if that is larger.
    pub json: Option<Value>,
}

/// Memory of a limited size.
struct Limited(Vec<u8>);

impl Write for Limited {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.0.len() + bytes.len() > MAX_BYTES {
            return Err(io::Error::other("too large"));
        }
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl ValueFigures {
    /// The JSON of a value, if it is not too large.
    #[must_use]
    pub fn of(value: &AnyValue) -> Self {
        let kind = value.kind();
        let mut text = Limited(Vec::new());
        let written = (kind.json)(value, &mut text).is_ok();
        let hash = value.hash()[..8].iter().map(|byte| format!("{byte:02x}")).collect();
        Self {
            value: kind.name,
            hash,
            bytes: written.then_some(text.0.len()),
            json: serde_json::from_slice(&text.0).ok().filter(|_| written),
        }
    }

    /// Lines for people; `first` items of each list are shown.
    #[must_use]
    pub fn text(&self, output: &str, first: usize) -> String {
        let mut out = Listing::new(&format!("{output}: a {}", self.value));
        match (&self.json, self.bytes) {
            (Some(json), Some(bytes)) => {
                out.line("size", format!("{bytes} bytes as JSON"));
                out.raw(&abridged(json, first));
            }
            _ => out.line("size", format!("more than {} MiB as JSON", MAX_BYTES >> 20)),
        }
        out.finish()
    }
}

/// JSON with the first items of each list and the number of the others, one field a line.
#[must_use]
pub fn abridged(value: &Value, first: usize) -> String {
    let mut text = String::new();
    write(&mut text, "", value, 1, first);
    let lines = text.lines().count();
    if lines <= MAX_LINES {
        return text;
    }
    let mut cut: String = text.lines().take(MAX_LINES).map(|line| format!("{line}\n")).collect();
    let _ = writeln!(cut, "  ... {} more lines; --json prints all", lines - MAX_LINES);
    cut
}

/// True for lists and structs.
fn is_nested(value: &Value) -> bool {
    matches!(value, Value::Array(_) | Value::Object(_))
}

fn scalar(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => figure(number.as_f64().unwrap_or(0.0)),
        Value::String(text) if text.chars().count() > MAX_TEXT => {
            let start: String = text.chars().take(MAX_TEXT).collect();
            format!("{start:?} ... {} characters", text.chars().count())
        }
        other => other.to_string(),
    }
}

fn write(out: &mut String, name: &str, value: &Value, depth: usize, first: usize) {
    let indent = "  ".repeat(depth);
    let label = if name.is_empty() { String::new() } else { format!("{name}: ") };
    let more =
        |count: usize| if count > first { format!(", ... {} more", count - first) } else { String::new() };
    match value {
        Value::Object(fields) => {
            if !name.is_empty() {
                let _ = writeln!(out, "{indent}{name}:");
            }
            let depth = if name.is_empty() { depth } else { depth + 1 };
            fields.iter().for_each(|(key, value)| write(out, key, value, depth, first));
        }
        Value::Array(items) if items.iter().any(is_nested) => {
            let _ = writeln!(out, "{indent}{label}{} items", items.len());
            for (k, item) in items.iter().take(first).enumerate() {
                match item {
                    Value::Array(row) if !row.iter().any(is_nested) => {
                        let cells: Vec<String> = row.iter().take(first.max(8)).map(scalar).collect();
                        let rest = row.len() - cells.len();
                        let rest = if rest > 0 { format!(", ... {rest} more") } else { String::new() };
                        let _ = writeln!(out, "{indent}  [{}{rest}]", cells.join(", "));
                    }
                    item => write(out, &format!("[{k}]"), item, depth + 1, first),
                }
            }
            if items.len() > first {
                let _ = writeln!(out, "{indent}  ... {} more", items.len() - first);
            }
        }
        Value::Array(items) => {
            let cells: Vec<String> = items.iter().take(first).map(scalar).collect();
            let _ = writeln!(out, "{indent}{label}[{}{}]", cells.join(", "), more(items.len()));
        }
        value => {
            let _ = writeln!(out, "{indent}{label}{}", scalar(value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn lists_are_cut_and_counted() {
        let rows: Vec<Value> = (0..100).map(|k| json!([k, 0.5])).collect();
        let value =
            json!({"name": "bar", "modes": rows, "gains": [1.0, 0.123456, 3.0, 4.0], "inner": {"a": null}});
        let text = abridged(&value, 3);
        for line in [
            "  name: \"bar\"",
            "  modes: 100 items",
            "    [0, 0.5]",
            "    ... 97 more",
            "  gains: [1, 0.1235, 3, ... 1 more]",
            "    a: null",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
        let long = json!((0..1000).map(|k| json!({"k": k})).collect::<Vec<_>>());
        assert!(abridged(&long, 500).lines().count() == MAX_LINES + 1);
        assert_eq!(abridged(&json!(0.25), 3), "  0.25\n");
    }

    #[test]
    fn a_value_has_its_json() {
        let found = ValueFigures::of(&AnyValue::new(0.5_f64));
        assert_eq!((found.value, found.json.clone()), ("number", Some(json!(0.5))));
        assert!(found.text("a.value", 3).starts_with("a.value: a number\n"));
    }
}
