//! `foley table`.

use super::Exit;
use super::args::{Column, TableArgs};
use super::console::{stdout, tell};
use super::progress::Watch;
use super::run::{prepare, show, stop_on_signals};
use crate::graph::Graph;
use crate::run::{DirOutputs, Report};
use foley_nodes::registry::Registry;
use foley_nodes::table::{Cell, ResultTable};
use serde_json::{Map, Value};
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The part of the id of a node before what a column names: nothing for a node of the graph itself, `a.b` for one of its sub-graphs.
fn part<'a>(id: &'a str, node: &str) -> Option<&'a str> {
    let before = id.strip_suffix(node)?;
    if before.is_empty() { Some(before) } else { before.strip_suffix('.') }
}

/// The entry of a column for a node: a parameter, or what a run reports of it.
fn entry(graph: &Graph, report: Option<&Report>, n: usize, field: &str) -> Option<Value> {
    let written = graph.nodes[n].params.write().into_iter().find(|(name, _)| *name == field);
    if let Some((_, datum)) = written {
        let text = datum.to_string();
        // Numbers stay numbers in JSON and CSV.
        return Some(
            serde_json::from_str(&text).ok().filter(Value::is_number).unwrap_or(Value::String(text)),
        );
    }
    let node = report?.nodes.get(n)?;
    match field {
        "time" => Some(node.time.as_secs_f64().into()),
        _ => node.summary.get(field).cloned(),
    }
}

/// What a node has, for a column that names something else.
fn known(graph: &Graph, report: Option<&Report>, n: usize) -> String {
    let params = graph.nodes[n].params.write().into_iter().map(|(name, _)| name.to_owned());
    let reported = report.and_then(|report| report.nodes.get(n));
    let summary = reported.into_iter().flat_map(|node| node.summary.keys().cloned());
    let time = reported.map(|_| "time".to_owned());
    let names: Vec<String> = params.chain(time).chain(summary).collect();
    names.join(", ")
}

/// Parts of a graph, each with an entry for each column.
type Rows = Vec<(String, Vec<Option<Value>>)>;

/// Rows of a graph: one for each of its parts that has a node of a column.
fn rows(graph: &Graph, report: Option<&Report>, columns: &[Column]) -> Result<Rows, String> {
    let mut rows = Rows::new();
    for &n in &graph.order {
        let id = graph.nodes[n].id.as_str();
        for (k, column) in columns.iter().enumerate() {
            let Some(part) = part(id, &column.node) else { continue };
            let Some(found) = entry(graph, report, n, &column.field) else {
                let more = if report.is_none() { "; `--run` adds what a run reports" } else { "" };
                let Column { field, .. } = column;
                let kind = graph.nodes[n].ty.name;
                return Err(format!(
                    "`{id}` ({kind}) has no `{field}`; it has {}{more}",
                    known(graph, report, n)
                ));
            };
            let at = rows.iter().position(|(name, _)| name == part).unwrap_or_else(|| {
                rows.push((part.to_owned(), vec![None; columns.len()]));
                rows.len() - 1
            });
            rows[at].1[k] = Some(found);
        }
    }
    Ok(rows)
}

/// Rows of a graph file, which is run if that is wanted; what is wrong with it has been printed.
fn of_file(args: &TableArgs, path: &Path, registry: &Arc<Registry>) -> Result<Rows, Exit> {
    let session = args.session(path, registry);
    let found = if args.run {
        let ready = prepare(&session).ok_or(Exit::Wrong)?;
        stop_on_signals(session.progress());
        let watch = Watch::start(&ready.graph.title, Arc::clone(&ready.progress), args.json || args.csv);
        let (outputs, _) = DirOutputs::in_memory();
        let result = ready.run(&outputs);
        watch.end();
        let report = result.map_err(|errors| {
            show(&errors, &ready.graph.sources);
            let stopped = session.progress().stop.load(Ordering::SeqCst);
            if stopped { Exit::Again } else { Exit::of(&errors) }
        })?;
        rows(&ready.graph, Some(&report), &args.columns)
    } else {
        let (loaded, _) = session.load();
        show(&loaded.diagnostics, &loaded.sources);
        rows(&loaded.graph.ok_or(Exit::Wrong)?, None, &args.columns)
    };
    found.map_err(|message| {
        tell(format_args!("{}: {message}", path.display()));
        Exit::Wrong
    })
}

fn cell(value: Option<&Value>) -> Cell {
    match value {
        None | Some(Value::Null) => Cell::Empty,
        Some(Value::Number(x)) => x.as_f64().map_or(Cell::Empty, Cell::Number),
        Some(Value::String(text)) => text.as_str().into(),
        Some(other) => other.to_string().into(),
    }
}

/// Tabulates parameters of nodes, and with `--run` what runs report of them, over graphs.
///
/// # Errors
/// When standard output is closed.
pub fn table(args: &TableArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let names: Vec<String> = args.columns.iter().map(Column::to_string).collect();
    let mut table = ResultTable::new(&["graph", "part"]);
    table.columns.extend(names.iter().cloned());
    let mut found = vec![false; names.len()];
    for path in &args.graphs {
        let rows = match of_file(args, path, registry) {
            Ok(rows) => rows,
            Err(exit) => return Ok(exit),
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for (part, values) in rows {
            found.iter_mut().zip(&values).for_each(|(found, value)| *found |= value.is_some());
            let cells = values.iter().map(|value| cell(value.as_ref()));
            table.push([Cell::from(&*name), part.as_str().into()].into_iter().chain(cells));
        }
    }
    if let Some(k) = found.iter().position(|found| !found) {
        let node = &args.columns[k].node;
        tell(format_args!(
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
