//! The `foley` command.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    foley::cli::run(foley::Registry::standard())
}
