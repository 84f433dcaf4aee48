//! A material from a file, as a node.

use super::material::Material;
use crate::artefact_file;

artefact_file! {
    /// A material from a file: its damping, its elastic constants and their provenance.
    ///
    /// The file is RON, as `MaterialOut` writes it, and may be written by hand. `damping` states its `convention`: C if its parameters give
    /// `c` of the mode equation `z'' + c z' + lambda z = 0`, D if they give the decay rate `c / 2` of the amplitude. Young's modulus is in
    /// Pa, the density in kg/m^3.
    pub struct MaterialFile / MaterialFileParams / MaterialFilePorts / MaterialFileIo, version 1;
    /// The file.
    path: "trial.material.ron";
    /// The material.
    material: Material;
}
