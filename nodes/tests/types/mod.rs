//! The rules that every node type obeys.

mod conformance;
mod defaults;
mod golden;
mod readers;
mod standalone;
