//! The `foley` command: reads arguments, calls the rooms behind it, prints, and returns an exit code.

mod args;
mod cache;
mod check;
mod console;
mod docs;
mod draw;
mod levels;
mod likeness;
mod live;
mod lsp;
mod new;
mod nodes;
mod plan;
mod probe;
mod progress;
mod run;
mod schema;
mod table;
mod test;
mod text;
mod watch;

pub use args::Args;
pub use levels::{HEADING, measure, row};
pub use new::template;
pub use nodes::describe;
pub use schema::schema;

use crate::diag::Diagnostic;
use args::Command;
use clap::Parser as _;
use foley_nodes::registry::Registry;
use std::process::ExitCode;
use std::sync::Arc;

/// Exit code of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done,
    /// The run failed.
    Failed,
    /// The graph, an input or an argument is wrong.
    Wrong,
    /// Stopped, or something was busy: try again.
    Again,
}

impl Exit {
    /// Exit code for these errors: failure if the machine or foley failed, otherwise an error of the graph or an input.
    #[must_use]
    pub fn of(errors: &[Diagnostic]) -> Self {
        let failed = |d: &Diagnostic| d.code == "F080" || d.code.starts_with("F09");
        if errors.iter().any(failed) { Self::Failed } else { Self::Wrong }
    }

    /// The number that the process ends with.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Wrong => 2,
            Self::Again => 75,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}

/// The whole command with the nodes of a registry: parses the arguments of the process, runs them, and reports errors.
///
/// A program with nodes of its own is this call: see `examples/own_node`.
#[must_use]
pub fn run(registry: Registry) -> ExitCode {
    // A file beyond the limit of the process is an error of the write then, and does not end the process: threads inherit this.
    #[cfg(unix)]
    let _ = nix::sys::signal::SigSet::from(nix::sys::signal::Signal::SIGXFSZ).thread_block();
    match main(Args::parse(), &Arc::new(registry)) {
        Ok(exit) => exit.into(),
        // A reader of standard output that ends early, such as `head`, is not a failure.
        Err(e)
            if e.downcast_ref::<std::io::Error>()
                .is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe) =>
        {
            ExitCode::SUCCESS
        }
        Err(e) => {
            console::print_message(format_args!("{e:#}"));
            ExitCode::FAILURE
        }
    }
}

/// Runs the command.
///
/// # Errors
/// If something fails that no diagnostic describes, such as a closed standard output.
pub fn main(args: Args, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    match args.command {
        Command::Run(args) => run::run(&args, registry),
        Command::Probe(args) => probe::probe(&args, registry),
        Command::Test(args) => test::test(&args, registry),
        Command::Watch(args) if args.live => live::watch(&args, registry),
        Command::Watch(args) => watch::watch(&args, registry),
        Command::Live(args) => live::live(&args, registry),
        Command::Check(args) => check::check(&args, registry),
        Command::Fmt(args) => text::fmt(&args),
        Command::Upgrade(args) => text::upgrade(&args),
        Command::Plan(args) => plan::plan(&args, registry),
        Command::Nodes(args) => nodes::nodes(&args, registry),
        Command::Explain(args) => text::explain(&args),
        Command::Graph(args) => draw::draw(&args, registry),
        Command::Table(args) => table::table(&args, registry),
        Command::Levels(args) => levels::levels(&args),
        Command::Likeness(args) => likeness::likeness(&args),
        Command::Cache(args) => cache::cache(&args, registry),
        Command::New(args) => new::new(&args),
        Command::Schema => schema::print(registry),
        Command::Docs(args) => docs::docs(&args, registry),
        Command::Completions(args) => text::completions(&args),
        Command::Lsp(args) => lsp::lsp(&args, registry),
    }
}
