//! The motion of an object of a scene, whatever the format.

use super::MeshError;
use super::affine::Affine;

/// World transforms of an object over time, in axes and units of the file.
///
/// # Shapes
/// One transform a frame, at least one. Times are in s and increase. An object that does not move has one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectMotion {
    object: String,
    times: Vec<f64>,
    /// Times of the keys of the file, if the frames are others.
    keys: Option<Vec<f64>>,
    world: Vec<Affine>,
}

impl ObjectMotion {
    /// Evaluates the world transform of an object at each time.
    ///
    /// # Errors
    /// As `world`, and [`MeshError::TransformNotFinite`].
    pub(super) fn evaluate(
        object: String,
        times: Vec<f64>,
        mut world: impl FnMut(f64) -> Result<Affine, MeshError>,
    ) -> Result<Self, MeshError> {
        let mut transforms = Vec::with_capacity(times.len());
        for (frame, &time) in times.iter().enumerate() {
            let transform = world(time)?;
            if !transform.is_finite() {
                return Err(MeshError::TransformNotFinite { object, frame, time });
            }
            transforms.push(transform);
        }
        Ok(Self { object, times, keys: None, world: transforms })
    }

    #[cfg(feature = "gltf")]
    pub(super) fn with_keys(self, keys: Vec<f64>) -> Self {
        Self { keys: Some(keys), ..self }
    }

    /// Name of the object in the file.
    #[must_use]
    pub fn object(&self) -> &str {
        &self.object
    }

    /// Time of each frame in s.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Times in the file, s: of the keys of an animation that is evaluated at another rate, or else of the frames.
    #[must_use]
    pub fn file_times(&self) -> &[f64] {
        self.keys.as_deref().unwrap_or(&self.times)
    }

    /// Returns the position in the scene of a point in the axes of the object. Returns `None` if there is no such frame.
    #[must_use]
    pub fn position(&self, frame: usize, point: [f64; 3]) -> Option<[f64; 3]> {
        self.world.get(frame).map(|world| world.apply(point))
    }

    /// Returns a direction of the object in the scene, with the scale of the object. Returns `None` if there is no such frame.
    #[must_use]
    pub fn direction(&self, frame: usize, direction: [f64; 3]) -> Option<[f64; 3]> {
        self.world.get(frame).map(|world| world.direction(direction))
    }
}
