//! All benches of the nodes, in one program so that they link once.
//!
//! `cargo bench -p foley-nodes -- contact warp` runs the named benches, without a name all of them.

mod common;
mod contact;
mod curvature;
mod damping;
mod direction;
mod friction;
mod grains;
mod image;
mod isophotes;
mod levels;
mod modal;
mod onsets;
mod resample;
mod rigid;
mod scrape;
mod solid;
mod soundtrack;
mod unit;
mod warp;

use std::process::{ExitCode, Termination};

type Bench = (&'static str, fn() -> ExitCode);

/// Names each module, and the bench in it.
macro_rules! benches {
    ($($name:ident),+ $(,)?) => { [$((stringify!($name), || $name::bench().report())),+] };
}

fn main() -> ExitCode {
    let benches: [Bench; 18] = benches![
        contact, curvature, damping, direction, friction, grains, image, isophotes, levels, modal, onsets,
        resample, rigid, scrape, solid, soundtrack, unit, warp,
    ];
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let named = |name: &str| args.iter().any(|arg| arg == name);
    let any = benches.iter().any(|(name, _)| named(name));
    if let (false, Some(unknown)) = (any, args.first()) {
        let names: Vec<&str> = benches.iter().map(|(name, _)| *name).collect();
        eprintln!("no bench is named `{unknown}`; there are {}", names.join(", "));
        return ExitCode::FAILURE;
    }
    for (name, bench) in benches.iter().filter(|(name, _)| !any || named(name)) {
        eprintln!("\n== {name}");
        let code = bench();
        if code != ExitCode::SUCCESS {
            return code;
        }
    }
    ExitCode::SUCCESS
}
