//! Renders a graph inside a tool: parameters set, results in memory, mistakes as values.
//!
//! `cargo run --example render_in_a_tool -- [GRAPH] [NAME=VALUE ...]`
use foley::Session;
use foley::diag::Severity;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let graph = arguments.next().unwrap_or_else(|| "graphs/impact/strikes.ron".into());
    let mut session = Session::from_file(graph);
    for setting in arguments {
        match setting.split_once('=') {
            Some((name, value)) => session.set(name, value),
            None => {
                eprintln!("`{setting}` is no NAME=VALUE");
                return ExitCode::from(2);
            }
        }
    }
    match session.render_to_memory() {
        Ok((report, files)) => {
            for path in files.paths() {
                // A tool would hand the bytes on; this one prints their number.
                println!(
                    "{path}: {} bytes, {:.2} s of sound",
                    files.get(&path).unwrap_or_default().len(),
                    report.length
                );
            }
            ExitCode::SUCCESS
        }
        Err(errors) => {
            for found in errors.diagnostics.iter().filter(|found| found.severity == Severity::Error) {
                eprintln!("{}: {}", found.code, found.message);
            }
            ExitCode::FAILURE
        }
    }
}
