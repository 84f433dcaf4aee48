//! `foley table`.

use super::Exit;
use super::args::{Column, TableArgs};
use super::console::{print_message, stdout};
use super::run::{prepare, run_in_memory, show};
use crate::graph::Graph;
use crate::run::Report;
use foley_nodes::registry::Registry;
use foley_nodes::table::{Cell, ResultTable};
use serde_json::{Map, Value};
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

/// The part of the id of a node before the name in a column: empty for a node of the graph itself, `a.b` for one of its sub-graphs.
fn part<'a>(id: &'a str, node: &str) -> Option<&'a str> {
    let before = id.strip_suffix(node)?;
    if before.is_empty() { Some(before) } else { before.strip_suffix('.') }
}

/// The entry of a column for a node: a parameter, or a figure of its report.
fn entry(graph: &Graph, report: Option<&Report>, n: usize, field: &str) -> Option<Cell> {
    let written = graph.nodes[n].params.write().into_iter().find(|(name, _)| *name == field);
    if let Some((_, datum)) = written {
        let text = datum.to_string();
        // Numbers stay numbers in JSON and CSV.
        return Some(text.parse::<f64>().map_or(Cell::Text(text), Cell::from));
    }
    let node = report?.nodes.get(n)?;
    if field == "time" {
        return Some(node.time.as_secs_f64().into());
    }
    Some(match node.summary.get(field)? {
        Value::Null => Cell::Empty,
        Value::Number(x) => x.as_f64().into(),
        Value::String(text) => text.as_str().into(),
        other => other.to_string().into(),
    })
}

/// Names of the columns that a node has, for the message about an unknown one.
fn known(graph: &Graph, report: Option<&Report>, n: usize) -> String {
    let params = graph.nodes[n].params.write().into_iter().map(|(name, _)| name.to_owned());
    let reported = report.and_then(|report| report.nodes.get(n));
    let summary = reported.into_iter().flat_map(|node| node.summary.keys().cloned());
    let time = reported.map(|_| "time".to_owned());
    let names: Vec<String> = params.chain(time).chain(summary).collect();
    names.join(", ")
}

/// Parts of a graph, each with an entry for each column.
type Rows = Vec<(String, Vec<Cell>)>;

/// Rows of a graph: one for each of its parts that has a node of a column.
fn rows(graph: &Graph, report: Option<&Report>, columns: &[Column]) -> Result<Rows, String> {
    let mut rows = Rows::new();
    for &n in &graph.order {
        let id = graph.nodes[n].id.as_str();
        for (k, column) in columns.iter().enumerate() {
            let Some(part) = part(id, &column.node) else { continue };
            let Some(found) = entry(graph, report, n, &column.field) else {
                let more = if report.is_none() { "; `--run` adds the figures of a run" } else { "" };
                let Column { field, .. } = column;
                let kind = graph.nodes[n].ty.name;
                return Err(format!(
                    "`{id}` ({kind}) has no `{field}`; it has {}{more}",
                    known(graph, report, n)
                ));
            };
            let at = rows.iter().position(|(name, _)| name == part).unwrap_or_else(|| {
                rows.push((part.to_owned(), vec![Cell::Empty; columns.len()]));
                rows.len() - 1
            });
            rows[at].1[k] = found;
        }
    }
    Ok(rows)
}

/// Rows of a graph file, which is run on request; its errors are printed.
fn of_file(args: &TableArgs, path: &Path, registry: &Arc<Registry>) -> Result<Rows, Exit> {
    let session = args.session(path, registry);
    let found = if args.run {
        let ready = prepare(&session).ok_or(Exit::Wrong)?;
        let report = run_in_memory(&ready, args.json || args.csv)?;
        rows(&ready.graph, Some(&report), &args.columns)
    } else {
        let (loaded, _) = session.load();
        show(&loaded.diagnostics, &loaded.sources);
        rows(&loaded.graph.ok_or(Exit::Wrong)?, None, &args.columns)
    };
    found.map_err(|message| {
        print_message(format_args!("{}: {message}", path.display()));
        Exit::Wrong
    })
}

/// Tabulates parameters of nodes, and with `--run` figures of their reports, over graphs.
///
/// # Errors
/// When standard output is closed.
pub fn table(args: &TableArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let names: Vec<String> = args.columns.iter().map(Column::to_string).collect();
    let mut table = ResultTable::new(&["graph", "part"]);
    table.columns.extend(names.iter().cloned());
    for path in &args.graphs.graphs {
        let rows = match of_file(args, path, registry) {
            Ok(rows) => rows,
            Err(exit) => return Ok(exit),
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for (part, values) in rows {
            table.push([Cell::from(&*name), part.into()].into_iter().chain(values));
        }
    }
    let is_missing = |k: &usize| table.rows.iter().all(|row| row.get(k + 2) == Some(&Cell::Empty));
    if let Some(k) = (0..names.len()).find(is_missing) {
        let node = &args.columns[k].node;
        print_message(format_args!(
            "--column {}: no graph has a node `{node}`; `foley graph` lists the nodes",
            names[k]
        ));
        return Ok(Exit::Wrong);
    }
    print(&table, args)?;
    Ok(Exit::Done)
}

/// An entry as text, without zeros at the end of a number.
fn short(cell: &Cell) -> String {
    let text = cell.text();
    match cell {
        Cell::Number(_) if text.contains('.') && !text.contains('e') => {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => text,
    }
}

fn print(table: &ResultTable, args: &TableArgs) -> std::io::Result<()> {
    let mut out = stdout();
    if args.csv {
        return write!(out, "{}", table.csv());
    }
    if args.json {
        let object = |row: &Vec<Cell>| {
            let value = |cell: &Cell| match cell {
                Cell::Number(x) => (*x).into(),
                Cell::Text(text) => text.as_str().into(),
                Cell::Empty => Value::Null,
            };
            let fields = table.columns.iter().zip(row).map(|(name, cell)| (name.clone(), value(cell)));
            Value::Object(fields.collect::<Map<_, _>>())
        };
        return writeln!(out, "{:#}", table.rows.iter().map(object).collect::<Value>());
    }
    writeln!(out, "| {} |", table.columns.join(" | "))?;
    writeln!(out, "|{}", "---|".repeat(table.columns.len()))?;
    for row in &table.rows {
        let cells: Vec<String> = row.iter().map(short).collect();
        writeln!(out, "| {} |", cells.join(" | "))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::part;

    #[test]
    fn a_column_names_the_end_of_an_id() {
        assert_eq!(part("contacts", "contacts"), Some(""));
        assert_eq!(part("cotton.target.contacts", "contacts"), Some("cotton.target"));
        assert_eq!(part("cotton.target.contacts", "target.contacts"), Some("cotton"));
        assert_eq!(part("more_contacts", "contacts"), None);
        assert_eq!(part("contacts", "speed"), None);
    }
}
