//! Node types and fields of older versions, and their replacements.

use crate::lang::ast::{Entry, Field};
use crate::lang::edit::{EditError, TextEdit, apply, remove_item};
use crate::lang::{LineIndex, Parse, SyntaxError, Value, parse};

use super::SCHEMA;

/// A change of a field of a node type.
struct FieldChange {
    /// The node type, as it was called when it had the field.
    ty: &'static str,
    field: &'static str,
    /// The present name, and the replacement of the end of its value; `None` if there is no such field.
    now: Option<(&'static str, (&'static str, &'static str))>,
    /// Advice about its replacement.
    advice: &'static str,
}

/// Node types that have another name now.
const TYPES: [(&str, &str); 1] = [("ExtractionTable", "TableOut")];

const FIELDS: [FieldChange; 7] = [
    FieldChange {
        ty: "ExtractionTable",
        field: "report",
        now: Some(("table", (".report", ".table"))),
        advice: "`TableOut` writes any table",
    },
    FieldChange {
        ty: "ExtractionTable",
        field: "pairs",
        now: None,
        advice: "write the pairs by a second TableOut, from the output `pairs`",
    },
    FieldChange {
        ty: "Mfcc",
        field: "balance",
        now: None,
        advice: "put InterauralCues(audio: \"units\", target: \"target\") after the UnitConcatenator",
    },
    FieldChange {
        ty: "UnitConcatenator",
        field: "balance",
        now: None,
        advice: "put InterauralCues(audio: \"units\", target: \"target\") after it",
    },
    FieldChange {
        ty: "GrainDictionary",
        field: "compact",
        now: None,
        advice: "`bits` sets the bits of a sample",
    },
    FieldChange {
        ty: "ModalFromRecording",
        field: "passes",
        now: None,
        advice: "modes are found in bands and refined together",
    },
    FieldChange {
        ty: "ModalFromRecording",
        field: "range",
        now: None,
        advice: "modes are found in bands and refined together",
    },
];

/// Present name of a node type of older versions.
#[must_use]
pub fn renamed_type(name: &str) -> Option<&'static str> {
    TYPES.iter().find(|(old, _)| *old == name).map(|(_, new)| *new)
}

/// Advice about the replacement of a field of older versions.
#[must_use]
pub fn former_field(ty: &str, field: &str) -> Option<&'static str> {
    FIELDS.iter().find(|change| change.ty == ty && change.field == field).map(|change| change.advice)
}

/// An upgraded text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Upgraded {
    /// The text, with all comments.
    pub text: String,
    /// The line of the old text and the description of each change.
    pub changes: Vec<(usize, String)>,
}

/// Changes the text of a graph of an older version to the present node types and fields. Fields without a replacement are removed, and the
/// changes name the replacements.
///
/// # Errors
/// If the text cannot be parsed.
pub fn upgrade(text: &str) -> Result<Upgraded, Vec<SyntaxError>> {
    let parse = parse(text);
    if !parse.is_ok() {
        return Err(parse.errors().to_vec());
    }
    let (document, lines) = (parse.document(), LineIndex::new(text));
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut edits: Vec<TextEdit> = Vec::new();
    if document.attribute("schema").is_none() {
        found.push((0, format!("the file begins with #![schema = {SCHEMA:?}]")));
        edits.push(TextEdit { span: 0..0, new_text: format!("#![schema = {SCHEMA:?}]\n") });
    }
    let nodes = document.value.as_ref().and_then(|graph| graph.field("nodes")?.as_map());
    for Entry { key, value, .. } in nodes.unwrap_or_default() {
        let Some((Some(name), fields)) = value.as_struct() else { continue };
        let id = key.as_str().unwrap_or_default();
        if let Some(new) = renamed_type(&name.value) {
            found.push((name.span.start, format!("`{id}`: {} is {new} now", name.value)));
            edits.push(TextEdit { span: name.span(), new_text: new.to_owned() });
        }
        for field in fields {
            let changed = |c: &&FieldChange| c.ty == name.value && c.field == field.name.value;
            let Some(change) = FIELDS.iter().find(changed) else { continue };
            let Ok(new) = field_edits(&parse, field, change) else { continue };
            edits.extend(new);
            let what = match change.now {
                Some((new, _)) => format!("`{id}`: `{}` is `{new}` now: {}", change.field, change.advice),
                None => format!("`{id}`: `{}` is removed: {}", change.field, change.advice),
            };
            found.push((field.span.start, what));
        }
    }
    let text = apply(text, &edits).unwrap_or_else(|_| text.to_owned());
    let changes = found.into_iter().map(|(at, what)| (lines.line_column(at).line, what)).collect();
    Ok(Upgraded { text, changes })
}

fn field_edits(parse: &Parse, field: &Field, change: &FieldChange) -> Result<Vec<TextEdit>, EditError> {
    let Some((new, (old_end, new_end))) = change.now else { return remove_item(parse, field.span.clone()) };
    let mut edits = vec![TextEdit { span: field.name.span(), new_text: new.to_owned() }];
    let Value { span, .. } = &field.value;
    if field.value.as_str().is_some_and(|text| text.ends_with(old_end)) {
        let end = span.end - 1;
        edits.push(TextEdit { span: end - old_end.len()..end, new_text: new_end.to_owned() });
    }
    Ok(edits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::registry::Registry;

    #[test]
    fn older_names_are_changed_and_comments_stay() {
        let old = "// A table.\nGraph(nodes: {\n  \"m\": Mfcc(audio: \"a\", balance: \"b\"), // features\n  \"t\": ExtractionTable(report: \"knocks.report\", path: \"t.csv\"),\n})\n";
        let upgraded = upgrade(old).unwrap();
        assert_eq!(
            upgraded.text,
            "#![schema = \"foley:graph/1\"]\n// A table.\nGraph(nodes: {\n  \"m\": Mfcc(audio: \"a\"), // features\n  \"t\": TableOut(table: \"knocks.table\", path: \"t.csv\"),\n})\n"
        );
        let lines: Vec<usize> = upgraded.changes.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [1, 3, 4, 4]);
        assert_eq!(upgrade(&upgraded.text).unwrap(), Upgraded { text: upgraded.text, changes: Vec::new() });
        assert!(upgrade("Graph(").is_err());
    }

    #[test]
    fn the_names_of_today_are_left_alone() {
        let registry = Registry::standard();
        for (old, new) in TYPES {
            assert!(registry.get(old).is_none() && registry.get(new).is_some(), "{old} {new}");
        }
        for change in &FIELDS {
            let name = renamed_type(change.ty).unwrap_or(change.ty);
            let ty = registry.get(name).unwrap();
            let has = |field: &str| {
                ty.inputs.iter().any(|port| port.name == field)
                    || (ty.params)().iter().any(|spec| spec.name == field)
            };
            assert!(!has(change.field), "{}.{}", change.ty, change.field);
            assert!(change.now.is_none_or(|(new, _)| has(new)), "{}.{}", change.ty, change.field);
        }
    }
}
