//! The runtime of foley: RON graphs of typed nodes, checked, planned and run.
#![forbid(unsafe_code)]

pub mod lang;
