//! Arguments of `foley table`.

use super::graph::GraphsArgs;
use super::parse::{parse_seconds, parse_threads};
use crate::session::Session;
use clap::Args as ClapArgs;
use foley_nodes::registry::Registry;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// A column: the end of the ids of nodes, and a field of these nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The end of the ids, whole names.
    pub node: String,
    /// A parameter, or a figure of a run.
    pub field: String,
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.node, self.field)
    }
}

fn parse_column(text: &str) -> Result<Column, String> {
    let parts = text.rsplit_once('.').filter(|(node, field)| !node.is_empty() && !field.is_empty());
    let (node, field) = parts.ok_or("NODE.FIELD was expected, such as contacts.radius")?;
    Ok(Column { node: node.into(), field: field.into() })
}

/// Arguments of `foley table`.
#[derive(Clone, Debug, ClapArgs)]
pub struct TableArgs {
    /// The graphs.
    #[command(flatten)]
    pub graphs: GraphsArgs,
    /// A column: a parameter of the nodes whose ids end in NODE, or with --run `time` or a field of their summaries
    #[arg(long = "column", short, value_name = "NODE.FIELD", required = true, value_parser = parse_column)]
    pub columns: Vec<Column>,
    /// Run each graph, without the cache and without writing its files
    #[arg(long)]
    pub run: bool,
    /// Threads that compute [default: all cores]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_threads)]
    pub threads: Option<usize>,
    /// Stop each run here at the latest; needed for graphs without end
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub until: Option<f64>,
    /// Print JSON
    #[arg(long, conflicts_with = "csv")]
    pub json: bool,
    /// Print CSV
    #[arg(long)]
    pub csv: bool,
}

impl TableArgs {
    /// A session over one of the graphs.
    #[must_use]
    pub fn session(&self, graph: &Path, registry: &Arc<Registry>) -> Session {
        let session = self.graphs.session(graph, registry).with_quiet(true);
        session.with_threads(self.threads).with_until(self.until)
    }
}
