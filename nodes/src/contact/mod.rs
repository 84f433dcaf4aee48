//! Sliding contact: which triangle a vertex touches, and how fast it slides along it.
