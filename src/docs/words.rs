//! Ports, parameters and documentation comments in words.

use foley_nodes::core::params::ParamSpec;
use foley_nodes::core::ports::{Arity, PortSpec};
use std::fmt::Write as _;

/// Describes the type of a port.
#[must_use]
pub fn port_words(spec: &PortSpec) -> String {
    let many = match spec.arity {
        Arity::One => "",
        Arity::Optional => ", may be left open",
        Arity::Many => ", a list of links",
    };
    let late = if spec.delayed { ", may close a loop" } else { "" };
    format!("{} of {}{many}{late}", spec.kind.word(), spec.kind.name())
}

/// Describes the values of a parameter.
#[must_use]
pub fn param_words(spec: &ParamSpec) -> String {
    let mut words = spec.kind.to_string();
    if let Some(unit) = spec.unit.filter(|u| !u.is_empty()) {
        let _ = write!(words, " in {unit}");
    }
    if let Some(bounds) = spec.bounds {
        let _ = write!(words, ", from {bounds}");
    }
    match &spec.default {
        Some(default) => {
            let _ = write!(words, ", default {default}");
        }
        None => words.push_str(", required"),
    }
    words
}

/// A documentation comment as plain text.
#[must_use]
pub fn plain(doc: &str) -> String {
    doc.lines().map(|l| l.strip_prefix(' ').unwrap_or(l)).collect::<Vec<_>>().join("\n").trim().to_owned()
}
