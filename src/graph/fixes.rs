//! Corrections of mistakes in a graph.

use super::Graph;
use super::suggest::nearest;
use crate::diag::{Change, Fix, SourceLocation, Sources};
use crate::lang::edit::quote;
use foley_nodes::core::params::{Bounds, ParamKind, ParamSpec};
use foley_nodes::core::ports::{Arity, PortKind};
use foley_nodes::core::time::Rate;
use foley_nodes::registry::Registry;

/// Maximum number of alternatives that are offered.
const MAX_CHOICES: usize = 8;

/// Replaces a name by the nearest of those that exist.
pub(super) fn rename<'a>(
    found: &str,
    names: impl IntoIterator<Item = &'a str>,
    at: &SourceLocation,
    written: impl Fn(&str) -> String,
) -> Option<Fix> {
    nearest(found, names).map(|name| write(&written(name), at))
}

/// Replaces a part of the text.
pub(super) fn write(text: &str, at: &SourceLocation) -> Fix {
    Fix::replace(format!("write `{text}`"), at.clone(), text)
}

/// The choices of a parameter: the nearest one, or all of a few.
pub(super) fn choices(found: &str, choices: &[(&str, &str)], at: &SourceLocation) -> Vec<Fix> {
    match nearest(found, choices.iter().map(|(name, _)| *name)) {
        Some(name) => vec![write(name, at)],
        None => choices.iter().take(MAX_CHOICES).map(|(name, _)| write(name, at)).collect(),
    }
}

/// The nearest number in a range.
pub(super) fn clamp(found: f64, bounds: Bounds, at: &SourceLocation) -> Fix {
    write(&found.clamp(bounds.min, bounds.max).to_string(), at)
}

/// Adds a field to a node; `node` is the location of its type and fields.
pub(super) fn set_field(node: &SourceLocation, field: &str, value: &str) -> Fix {
    Fix {
        title: format!("add `{field}: {value}`"),
        changes: vec![Change::SetField {
            node: node.clone(),
            field: field.to_owned(),
            value: value.to_owned(),
        }],
    }
}

/// A value to begin with, for a parameter without a default.
#[must_use]
pub fn placeholder(spec: &ParamSpec) -> String {
    fn of(kind: &ParamKind, bounds: Option<Bounds>) -> String {
        match kind {
            ParamKind::Bool => "false".into(),
            ParamKind::Int | ParamKind::Float => {
                let number = bounds.map_or(0.0, |bounds| 0_f64.clamp(bounds.min, bounds.max));
                if *kind == ParamKind::Int { format!("{number}") } else { format!("{number:?}") }
            }
            ParamKind::Text | ParamKind::Asset | ParamKind::Folder | ParamKind::Output => "\"\"".into(),
            ParamKind::Rate => "48000".into(),
            ParamKind::Choice(names) => names.first().map_or(String::new(), |(name, _)| (*name).to_owned()),
            ParamKind::List(kind, count) => {
                format!("[{}]", vec![of(kind, bounds); count.unwrap_or(0)].join(", "))
            }
            ParamKind::Maybe(_) => "None".into(),
        }
    }
    of(&spec.kind, spec.bounds)
}

/// A node to be put between an output and an input.
pub(super) struct Converter {
    /// Name of its type.
    pub name: &'static str,
    /// The input that takes the output.
    pub input: &'static str,
    /// The output that feeds the input, if its type has several.
    pub output: Option<&'static str>,
    /// True if it needs nothing but its input.
    pub is_complete: bool,
}

impl Converter {
    /// The first node type that converts one kind to another and requires only this one input.
    pub fn find(from: &PortKind, to: &PortKind, registry: &Registry) -> Option<Self> {
        registry.types().iter().find_map(|ty| {
            let mut needed = ty.inputs.iter().filter(|p| p.arity != Arity::Optional);
            let input = needed.next().filter(|p| from.feeds(&p.kind))?;
            let output = ty.outputs.iter().find(|o| o.kind.feeds(to)).filter(|_| needed.next().is_none())?;
            let output = (ty.outputs.len() > 1).then_some(output.name);
            let is_complete = (ty.params)().iter().all(|spec| spec.default.is_some());
            Some(Self { name: ty.name, input: input.name, output, is_complete })
        })
    }

    /// Inserts the converter before the node whose key is at `node`, between it and `link`, which has the text `source`.
    /// `fields` are further fields, such as `, rate: 48000`.
    pub fn insert(
        &self,
        (source, link): (&str, &SourceLocation),
        node: &SourceLocation,
        fields: &str,
        is_taken: impl Fn(&str) -> bool,
    ) -> Option<Fix> {
        if link.file != node.file {
            return None;
        }
        let base: String = source.chars().map(|c| if c == '.' { '_' } else { c }).collect();
        let id = free_id(&format!("{base}_{}", self.name.to_lowercase()), is_taken);
        let entry = format!("\"{id}\": {}({}: {}{fields})", self.name, self.input, quote(source));
        let output = self.output.map_or_else(|| id.clone(), |port| format!("{id}.{port}"));
        Some(Fix {
            title: format!("put {} in between", self.name),
            changes: vec![
                Change::InsertEntry { before: node.clone(), entry },
                Change::Replace(link.clone(), quote(&output)),
            ],
        })
    }
}

/// An id like `base` that no node has.
pub fn free_id(base: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..).map(|k| format!("{base}_{k}"));
    std::iter::once(base.to_owned()).chain(numbered).find(|id| !is_taken(id)).unwrap_or_default()
}

/// Puts a `Mix` before an input that takes one link and was given the list at `list`.
pub(super) fn mix(
    list: &SourceLocation,
    node: &SourceLocation,
    sources: &Sources,
    registry: &Registry,
) -> Option<Fix> {
    registry.get("Mix").filter(|_| list.file == node.file)?;
    let text = &sources.get(list.file)?.text;
    let (items, key) = (text.get(list.span.clone())?, text.get(node.span.clone())?.trim_matches('"'));
    let id = free_id(&format!("{key}_mix"), |id| text.contains(&quote(id)));
    Some(Fix {
        title: "put Mix in between".to_owned(),
        changes: vec![
            Change::InsertEntry { before: node.clone(), entry: format!("\"{id}\": Mix(inputs: {items})") },
            Change::Replace(list.clone(), quote(&id)),
        ],
    })
}

/// Puts a `Resample` before a link of a node, so that its stream of audio has another rate.
pub fn resample(graph: &Graph, node: usize, field: &str, rate: Rate) -> Option<Fix> {
    let node = &graph.nodes[node];
    let link = node.fields.get(field)?;
    let text = graph.sources.get(link.file)?.text.get(link.span.clone())?;
    let source = text.strip_prefix('"')?.strip_suffix('"')?;
    let scope = node.id.rfind('.').map_or("", |end| &node.id[..=end]);
    let is_taken = |id: &str| graph.find(&format!("{scope}{id}")).is_some();
    let rate = rate.to_string().replace(" Hz", "");
    let rate = if rate.contains('/') { quote(&rate) } else { rate };
    let fields = format!(", rate: {rate}");
    let resample = Converter { name: "Resample", input: "audio", output: None, is_complete: true };
    resample.insert((source, link), &node.location, &fields, is_taken)
}
