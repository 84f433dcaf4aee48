//! All tests of every node type, in one binary.

mod trial;

mod maths;
mod types;
