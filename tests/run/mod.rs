//! Runs: the engine, caches, checkpoints and the session.

mod checkpoints;
mod engine;
mod memo;
mod memo_streams;
mod session;
mod units;
