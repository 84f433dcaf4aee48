//! What a node is: time, ports, parameters, shapes, randomness and faults.

pub mod random;
