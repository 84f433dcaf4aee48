//! `foley nodes`.

use super::Exit;
use super::args::NodesArgs;
use super::console::stdout;
use crate::docs::{param_words, plain, port_words};
use crate::graph::{nearest, omitted};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{ParamKind, ParamSpec};
use foley_nodes::core::ports::{Arity, PortSpec};
use foley_nodes::registry::Registry;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;

/// Lists node types, all or those that match a word, or describes one.
///
/// # Errors
/// When standard output goes away.
pub fn nodes(args: &NodesArgs, registry: &Registry) -> anyhow::Result<Exit> {
    let all: Vec<&NodeType> = registry.types().iter().map(|ty| &**ty).collect();
    let Some(name) = &args.name else {
        print(&all, registry, args.json)?;
        return Ok(Exit::Done);
    };
    if let Some(ty) = registry.get(name) {
        match args.json {
            true => writeln!(stdout(), "{:#}", describe(ty))?,
            false => write!(stdout(), "{}", page(ty))?,
        }
        return Ok(Exit::Done);
    }
    if let Some(feature) = registry.omitted(name) {
        let [message, help] = omitted(name, feature);
        super::console::print_message(format_args!("{message}; {help}"));
        return Ok(Exit::Wrong);
    }
    let word = name.to_lowercase();
    let holds = |ty: &&NodeType| {
        [ty.name, ty.family, ty.summary()].iter().any(|text| text.to_lowercase().contains(&word))
    };
    let matching: Vec<&NodeType> = all.into_iter().filter(holds).collect();
    if word.is_empty() || matching.is_empty() {
        let near = nearest(name, registry.types().iter().map(|t| t.name));
        let hint = near.map(|n| format!("; did you mean {n}?")).unwrap_or_default();
        super::console::print_message(format_args!(
            "there is no node type {name}{hint}, and none whose family or summary has this word (`foley nodes` lists all)"
        ));
        return Ok(Exit::Wrong);
    }
    print(&matching, registry, args.json)?;
    Ok(Exit::Done)
}

fn print(types: &[&NodeType], registry: &Registry, json: bool) -> std::io::Result<()> {
    match json {
        true => writeln!(stdout(), "{:#}", Value::Array(types.iter().map(|ty| describe(ty)).collect())),
        false => write!(stdout(), "{}", list(types, registry)),
    }
}

fn list(types: &[&NodeType], registry: &Registry) -> String {
    let mut out = String::new();
    for family in registry.families() {
        let mut own = types.iter().filter(|ty| ty.family == family).peekable();
        if own.peek().is_some() {
            let _ = writeln!(out, "{family}");
        }
        for ty in own {
            let _ = writeln!(out, "  {:<24} {}", ty.name, ty.summary());
        }
    }
    out
}

fn indented(text: &str, by: &str) -> String {
    text.lines().map(|l| if l.is_empty() { "\n".into() } else { format!("{by}{l}\n") }).collect()
}

fn page(ty: &NodeType) -> String {
    let mut out =
        format!("{} ({}, version {}, runs as {})\n", ty.name, ty.family, ty.version, ty.class.word());
    let _ = writeln!(out, "{}\n", ty.source.path());
    out.push_str(&indented(&plain(ty.doc), ""));
    for (title, ports) in [("Inputs", ty.inputs), ("Outputs", ty.outputs)] {
        if !ports.is_empty() {
            let _ = writeln!(out, "\n{title}:");
        }
        for port in ports {
            let _ = writeln!(out, "  {}: {}", port.name, port_words(port));
            out.push_str(&indented(&plain(port.doc), "      "));
        }
    }
    let specs = (ty.params)();
    if !specs.is_empty() {
        out.push_str("\nParameters:\n");
    }
    for spec in &specs {
        let _ = writeln!(out, "  {}: {}", spec.name, param_words(spec));
        out.push_str(&indented(&plain(spec.doc), "      "));
        if let ParamKind::Choice(choices) = spec.kind.innermost() {
            for (name, doc) in *choices {
                let _ = writeln!(out, "      {name}: {}", plain(doc).replace('\n', " "));
            }
        }
    }
    out
}

/// A node type as JSON.
#[must_use]
pub fn describe(ty: &NodeType) -> Value {
    let port = |p: &PortSpec| {
        json!({
            "name": p.name, "doc": plain(p.doc), "kind": p.kind.word(), "type": p.kind.name(),
            "arity": match p.arity { Arity::One => "one", Arity::Optional => "optional", Arity::Many => "many" },
            "late": p.delayed,
        })
    };
    let param = |p: &ParamSpec| {
        json!({
            "name": p.name, "doc": plain(p.doc), "takes": p.kind.to_string(), "unit": p.unit,
            "min": p.bounds.map(|b| b.min), "max": p.bounds.map(|b| b.max),
            "default": p.default.as_ref().map(ToString::to_string),
            "choices": match p.kind.innermost() {
                ParamKind::Choice(names) => names.iter().map(|(n, d)| json!({"name": n, "doc": plain(d)})).collect(),
                _ => Vec::new(),
            },
            "live": ty.inputs.iter().any(|i| i.name == p.name),
        })
    };
    json!({
        "name": ty.name, "family": ty.family, "version": ty.version, "class": ty.class.word(),
        "source": ty.source.path(), "summary": ty.summary(), "doc": plain(ty.doc),
        "inputs": ty.inputs.iter().map(port).collect::<Vec<_>>(),
        "outputs": ty.outputs.iter().map(port).collect::<Vec<_>>(),
        "params": (ty.params)().iter().map(param).collect::<Vec<_>>(),
    })
}
