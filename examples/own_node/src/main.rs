//! The whole `foley` command with two more node types: `cargo run -- run tremolo.ron`, `cargo run -- nodes Tremolo`.

mod beat_rate;
mod tremolo;

fn main() -> std::process::ExitCode {
    let registry = foley::Registry::standard().family("modulation");
    foley::cli::run(registry.with::<tremolo::Tremolo>().with_func::<beat_rate::BeatRate>())
}
