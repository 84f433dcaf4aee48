//! All benches of whole graphs, in one program so that they link once.
//!
//! `cargo bench -p foley -- engine live` runs the named benches, without a name all of them.

mod budget;
mod common;
mod engine;
mod growth;
mod live;
mod lsp;
mod memo;
mod peers;
mod sheet;
mod voices;

type Bench = (&'static str, fn());

const BENCHES: [Bench; 9] = [
    ("budget", budget::bench),
    ("engine", engine::bench),
    ("growth", growth::bench),
    ("live", live::bench),
    ("lsp", lsp::bench),
    ("memo", memo::bench),
    ("peers", peers::bench),
    ("sheet", sheet::bench),
    ("voices", voices::bench),
];

fn main() -> std::process::ExitCode {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let named = |name: &str| args.iter().any(|arg| arg == name);
    let any = BENCHES.iter().any(|(name, _)| named(name));
    if let (false, Some(unknown)) = (any, args.first()) {
        eprintln!("no bench is named `{unknown}`; there are {}", BENCHES.map(|(name, _)| name).join(", "));
        return std::process::ExitCode::FAILURE;
    }
    for (name, bench) in BENCHES.iter().filter(|(name, _)| !any || named(name)) {
        eprintln!("\n== {name}");
        bench();
    }
    std::process::ExitCode::SUCCESS
}
