//! Points of damping from a file, as a node.

use super::damping_points::DampingPoints;
use crate::artefact_file;

artefact_file! {
    /// Points of damping over frequency from a file, for a `DampingFit`.
    ///
    /// The file is CSV, or JSON as a tap of points writes it. Columns of a CSV are `lambda` (squared natural frequency, rad^2/s^2) or
    /// `frequency` (Hz), `c` or `d` (1/s: `d` is the decay rate of the amplitude, `c` is twice that), and optionally `sd` (standard
    /// deviation of `c` or `d`), `weight`, `recording` (a name) and `mode` (a number that the recordings of one mode share).
    pub struct DampingPointsFile / DampingPointsFileParams / DampingPointsFilePorts / DampingPointsFileIo, version 1;
    /// The file.
    path: "points.csv";
    /// The points.
    points: DampingPoints;
}
