//! The `foley` command: reads arguments, calls the rooms behind it, prints, and returns an exit code.

mod args;
mod cache;
mod check;
mod docs;
mod draw;
mod live;
mod new;
mod nodes;
mod plan;
mod progress;
mod run;
mod schema;
mod text;
mod watch;

pub use args::Args;
pub use new::template;
pub use nodes::{describe, param_words, plain, port_words};
pub use schema::schema;

use crate::diag::Diagnostic;
use args::Command;
use std::process::ExitCode;

/// What the command came to.
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
    /// What a run came to that ended with these errors: it failed if the machine did, or foley; all else is the graph's or an input's.
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

/// Runs the command.
///
/// # Errors
/// When something fails that no diagnostic describes, such as standard output going away.
pub fn main(args: Args) -> anyhow::Result<Exit> {
    match args.command {
        Command::Run(args) => run::run(&args),
        Command::Watch(args) if args.live => live::watch(&args),
        Command::Watch(args) => watch::watch(&args),
        Command::Live(args) => live::live(&args),
        Command::Check(args) => check::check(&args),
        Command::Fmt(args) => text::fmt(&args),
        Command::Plan(args) => plan::plan(&args),
        Command::Nodes(args) => nodes::nodes(&args),
        Command::Explain(args) => text::explain(&args),
        Command::Graph(args) => draw::draw(&args),
        Command::Cache(args) => cache::cache(&args),
        Command::New(args) => new::new(&args),
        Command::Schema => schema::print(),
        Command::Docs(args) => docs::docs(&args),
        Command::Completions(args) => text::completions(&args),
    }
}
