//! The rules that every node type keeps.

mod conformance;
mod defaults;
mod golden;
mod readers;
mod standalone;
