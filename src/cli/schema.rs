//! `foley schema`.

use super::Exit;
use super::console::stdout;
use crate::docs::plain;
use crate::graph::SCHEMA;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{Datum, ParamKind, ParamSpec};
use foley_nodes::core::ports::{Arity, PortSpec};
use foley_nodes::registry::Registry;
use serde_json::{Map, Value, json};
use std::io::Write as _;

/// Prints the schema.
///
/// # Errors
/// None at present.
pub fn print(registry: &Registry) -> anyhow::Result<Exit> {
    writeln!(stdout(), "{:#}", schema(registry))?;
    Ok(Exit::Done)
}

/// The format of graphs in the words of JSON Schema 2020-12.
///
/// RON has what JSON has not: a node `Gain(gain: 0.5)` is described by the definition `Gain` as an object with the
/// field `gain`, and a bare name such as `White` as the text `"White"`.
#[must_use]
pub fn schema(registry: &Registry) -> Value {
    let nodes: Map<String, Value> =
        registry.types().iter().map(|ty| (ty.name.to_owned(), node(ty))).collect();
    let names: Vec<Value> =
        registry.types().iter().map(|ty| json!({"$ref": format!("#/$defs/{}", ty.name)})).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": SCHEMA,
        "title": "Graph",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "title": {"type": "string", "description": "Title of the graph."},
            "seed": {"type": "integer", "minimum": 0, "default": 0, "description": "Seed of all randomness in the graph."},
            "extends": {"type": "string", "x-path": "input", "description": "The path of a graph that this one adds to and changes."},
            "params": {"type": "object", "description": "Values to which \"$name\" refers; --set changes them."},
            "use": {
                "type": "object",
                "description": "Sub-graphs by name; their nodes get ids such as \"name.node\".",
                "propertyNames": {"pattern": ID},
                "additionalProperties": {"anyOf": [
                    {"type": "string"},
                    {
                        "title": "Sub",
                        "type": "object",
                        "properties": {"path": {"type": "string"}, "params": {"type": "object"}},
                        "required": ["path"],
                    },
                    {
                        "title": "Array",
                        "type": "object",
                        "properties": {
                            "path": {"type": "string"},
                            "params": {"type": "object"},
                            "items": {"type": "array", "items": {"type": "object"}},
                        },
                        "required": ["path", "items"],
                    },
                ]},
            },
            "nodes": {
                "type": "object",
                "propertyNames": {"pattern": ID},
                "additionalProperties": {"anyOf": names},
            },
        },
        "$defs": nodes,
    })
}

const ID: &str = r"^[\p{L}_][\p{L}\p{N}_-]*$";
const REFERENCE: &str = r"^\$[^$]";

fn node(ty: &NodeType) -> Value {
    let specs = (ty.params)();
    let mut fields = Map::new();
    let mut required = Vec::new();
    for spec in &specs {
        fields.insert(spec.name.into(), param(spec));
        if spec.default.is_none() {
            required.push(spec.name);
        }
    }
    for port in ty.inputs {
        let link = input(port);
        // An input with a parameter of the same name takes a link or a value.
        match fields.remove(port.name) {
            Some(value) => drop(fields.insert(port.name.into(), json!({"anyOf": [link, value]}))),
            None => {
                fields.insert(port.name.into(), link);
                if port.arity != Arity::Optional {
                    required.push(port.name);
                }
            }
        }
    }
    let output = |p: &PortSpec| json!({"name": p.name, "kind": p.kind.word(), "type": p.kind.name(), "description": plain(p.doc)});
    json!({
        "title": ty.name,
        "description": plain(ty.doc),
        "type": "object",
        "additionalProperties": false,
        "properties": fields,
        "required": required,
        "x-family": ty.family,
        "x-version": ty.version,
        "x-outputs": ty.outputs.iter().map(output).collect::<Vec<_>>(),
    })
}

fn input(port: &PortSpec) -> Value {
    let link = json!({"type": "string", "description": "A link: \"node\" or \"node.port\"."});
    let mut value = match port.arity {
        Arity::One => link,
        Arity::Optional => json!({"anyOf": [link, {"const": "None"}]}),
        Arity::Many => json!({"type": "array", "items": link}),
    };
    value["description"] = plain(port.doc).into();
    value["x-kind"] = port.kind.word().into();
    value["x-type"] = port.kind.name().into();
    value
}

fn param(spec: &ParamSpec) -> Value {
    let mut value = json!({"anyOf": [takes(&spec.kind, spec), {"type": "string", "pattern": REFERENCE}]});
    value["description"] = plain(spec.doc).into();
    if let Some(unit) = spec.unit.filter(|u| !u.is_empty()) {
        value["x-unit"] = unit.into();
    }
    if let Some(default) = &spec.default {
        value["default"] = datum(default);
    }
    value
}

fn takes(kind: &ParamKind, spec: &ParamSpec) -> Value {
    let number = |word: &str| {
        let mut value = json!({"type": word});
        if let Some(bounds) = spec.bounds {
            value["minimum"] = bounds.min.into();
            value["maximum"] = bounds.max.into();
        }
        value
    };
    match kind {
        ParamKind::Bool => json!({"type": "boolean"}),
        ParamKind::Int => number("integer"),
        ParamKind::Float => number("number"),
        ParamKind::Text => json!({"type": "string"}),
        ParamKind::Asset => json!({"type": "string", "x-path": "input"}),
        ParamKind::Folder => json!({"type": "string", "x-path": "input folder"}),
        ParamKind::Output => json!({"type": "string", "x-path": "output"}),
        ParamKind::Rate => json!({"type": ["number", "string"], "x-unit": "Hz"}),
        ParamKind::Choice(names) => json!({"enum": names.iter().map(|(n, _)| *n).collect::<Vec<_>>()}),
        ParamKind::List(kind, None) => json!({"type": "array", "items": takes(kind, spec)}),
        ParamKind::List(kind, Some(n)) => {
            json!({"type": "array", "items": takes(kind, spec), "minItems": n, "maxItems": n})
        }
        ParamKind::Maybe(kind) => json!({"anyOf": [takes(kind, spec), {"const": "None"}]}),
    }
}

fn datum(value: &Datum) -> Value {
    match value {
        Datum::Unit => Value::Null,
        Datum::Bool(b) => (*b).into(),
        Datum::Int(i) => (*i).into(),
        Datum::Float(x) => (*x).into(),
        Datum::Text(t) | Datum::Name(t) | Datum::Other(t) => t.as_str().into(),
        Datum::List(items) => items.iter().map(datum).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_type_and_field_is_in_the_schema() {
        let registry = Registry::standard();
        let all = schema(&registry);
        for ty in registry.types() {
            let fields = &all["$defs"][ty.name]["properties"];
            let specs = (ty.params)();
            for name in ty.inputs.iter().map(|p| p.name).chain(specs.iter().map(|s| s.name)) {
                let doc =
                    fields[name]["description"].as_str().or(fields[name]["anyOf"][0]["description"].as_str());
                assert!(doc.is_some_and(|d| !d.is_empty()), "{}.{name}", ty.name);
            }
        }
    }
}
