//! Pairs of vectors that a spline is fitted to.

/// One pair: a vector, its image, and the weight of the pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The vector.
    pub from: Vec<f64>,
    /// Its image.
    pub to: Vec<f64>,
    /// Weight, above 0.
    pub weight: f64,
}
