//! The `foley` command.
#![forbid(unsafe_code)]

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    match foley::cli::main(foley::cli::Args::parse()) {
        Ok(exit) => exit.into(),
        // A reader such as `head` that has seen enough is no failure.
        Err(e)
            if e.downcast_ref::<std::io::Error>()
                .is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe) =>
        {
            ExitCode::SUCCESS
        }
        Err(e) => {
            eprintln!("foley: {e:#}");
            ExitCode::FAILURE
        }
    }
}
