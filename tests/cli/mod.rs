//! The command line as a user runs it, and its messages.

mod command;
mod commands;
mod diagnostics;
mod fixes;
mod level;
mod messages;
#[cfg(unix)]
mod named_files;
mod new_projects;
mod probe;
mod refused;
mod silence;
mod table;
mod test_files;
mod times;
mod tools;
mod trace;
#[cfg(unix)]
mod watch;
