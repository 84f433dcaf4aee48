//! Listening tests, and the statistics of their ratings.

pub mod listening_test;
pub mod rating_statistics;
pub mod ratings;
