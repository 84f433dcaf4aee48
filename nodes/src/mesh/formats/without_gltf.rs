//! glTF in a build without the feature `gltf`: an error.

use crate::mesh::{MeshError, MeshLimits, MeshStream, ObjectMotion, ReadOptions};

/// Choice of an object and an animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfSelection {
    /// Name of a node or of its mesh; `None` for the mesh with the most vertices, or the only animated node.
    pub object: Option<String>,
    /// Name of the animation; `None` for the first.
    pub animation: Option<String>,
    /// Frames per second; `None` for the times of the file.
    pub fps: Option<f64>,
}

/// Reads a file that the asset refers to.
pub type Resolve<'a> = &'a mut dyn FnMut(&str) -> std::io::Result<Vec<u8>>;

fn refused<T>() -> Result<T, MeshError> {
    let what = "a reader that this build omits: the feature `gltf` adds it".into();
    Err(MeshError::Unsupported { format: "glTF", what })
}

/// Refuses the asset.
///
/// # Errors
/// Always.
pub fn open(_: &[u8], _: &GltfSelection, _: Resolve<'_>, _: &ReadOptions) -> Result<MeshStream, MeshError> {
    refused()
}

/// Refuses the asset.
///
/// # Errors
/// Always.
pub fn object_motion(
    _: &[u8],
    _: &GltfSelection,
    _: Resolve<'_>,
    _: &MeshLimits,
) -> Result<ObjectMotion, MeshError> {
    refused()
}

/// Refuses the asset.
///
/// # Errors
/// Always.
pub fn list(_: &[u8]) -> Result<Vec<String>, MeshError> {
    refused()
}
