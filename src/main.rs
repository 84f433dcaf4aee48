//! The `foley` command.
#![forbid(unsafe_code)]

fn main() {}
