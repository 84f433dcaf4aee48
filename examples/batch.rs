//! Renders one graph for many animations, with one cache: results that they share are computed once.
//!
//! `cargo run --release --example batch -- GRAPH PARAM OUT FILE...` sets the parameter to each file in turn, for example
//! `graphs/cloth/friction.ron sheet.path out shot1.abc shot2.abc`. A file that fails does not stop the others.
use foley::Session;
use foley::memo::Memo;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [graph, parameter, out, files @ ..] = &arguments[..] else {
        eprintln!("batch GRAPH PARAM OUT FILE...");
        return ExitCode::from(2);
    };
    let memo = Arc::new(Memo::new(Path::new(out).join("cache"), 1 << 30, Path::new(graph)));
    let mut failed = 0;
    for file in files {
        let mut session = Session::from_file(graph).with_memo(Some(Arc::clone(&memo)));
        session.set(parameter, file);
        let name = Path::new(file).file_stem().unwrap_or_default();
        match session.render(Path::new(out).join(name)) {
            Ok(report) => println!("{file}: {:.2} s in {} file(s)", report.length, report.outputs.len()),
            Err(errors) => {
                eprintln!("{file}:\n{errors}");
                failed += 1;
            }
        }
    }
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
