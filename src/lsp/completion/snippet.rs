//! Snippets: text with places to type over.

use crate::graph::placeholder;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::ParamSpec;
use foley_nodes::core::ports::Arity;

/// A node with its required fields.
pub(super) fn node_snippet(ty: &NodeType) -> String {
    let specs = (ty.params)();
    let has_value = |name: &str| specs.iter().any(|spec| spec.name == name && spec.default.is_some());
    let mut fields = Vec::new();
    for port in ty.inputs.iter().filter(|port| port.arity != Arity::Optional && !has_value(port.name)) {
        let stop = fields.len() + 1;
        fields.push(match port.arity {
            Arity::Many => format!("{}: [\"${stop}\"]", port.name),
            Arity::One | Arity::Optional => format!("{}: \"${stop}\"", port.name),
        });
    }
    for spec in specs.iter().filter(|s| s.default.is_none() && ty.inputs.iter().all(|p| p.name != s.name)) {
        let stop = fields.len() + 1;
        fields.push(format!(
            "{}: {}",
            spec.name,
            value_snippet(spec).replacen("$1", &format!("${stop}"), 1).replacen(
                "${1",
                &format!("${{{stop}"),
                1
            )
        ));
    }
    format!("{}({})", ty.name, fields.join(", "))
}

/// The value of a parameter as a snippet: its default or a first value, to be typed over.
pub(super) fn value_snippet(spec: &ParamSpec) -> String {
    let value = spec.default.as_ref().map_or_else(|| placeholder(spec), ToString::to_string);
    match value.as_str() {
        "\"\"" => "\"$1\"".to_owned(),
        value => format!("${{1:{}}}", value.replace('\\', "\\\\").replace('$', "\\$").replace('}', "\\}")),
    }
}

/// A snippet as plain text.
pub(super) fn without_stops(snippet: &str) -> String {
    let (mut out, mut rest) = (String::new(), snippet);
    while let Some(at) = rest.find(['$', '\\']) {
        out.push_str(&rest[..at]);
        let tail = &rest[at + 1..];
        if rest[at..].starts_with('\\') {
            out.extend(tail.chars().next());
            rest = tail.get(1..).unwrap_or("");
        } else if let Some(inner) = tail.strip_prefix('{') {
            let end = inner.find('}').unwrap_or(inner.len());
            out.push_str(inner[..end].split_once(':').map_or("", |(_, value)| value));
            rest = inner.get(end + 1..).unwrap_or("");
        } else {
            rest = tail.trim_start_matches(|c: char| c.is_ascii_digit());
        }
    }
    out + rest
}
