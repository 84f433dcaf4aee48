//! Parameters of a listener's head that sources around it share.

use super::head::Head;
use super::structural_hrtf::Pinna;
use crate::core::fault::Reject;
use crate::params;
use crate::spatial::motion::interpolation::listener_pose;
use crate::spatial::motion::pose::Pose;

params! {
    /// The head of a listener: its pose and its shape.
    pub struct HeadParams {
        /// Position of the listener's head, unless `listener` is linked.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Direction of view of the listener, unless `listener` is linked: a vector of any length.
        look: [f64; 3] = [1.0, 0.0, 0.0], unit "", range -100_000.0..=100_000.0;
        /// Direction upwards from the listener: a vector not parallel to `look`.
        up: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Reflections of the pinna.
        pinna: Pinna = Pinna::Set0;
        /// Radius of the head.
        radius: f64 = 0.0875, unit "m", range 0.01..=1.0;
    }
}

impl HeadParams {
    /// The shape.
    #[must_use]
    pub fn head(&self) -> Head {
        Head { radius: self.radius, pinna: self.pinna.set(), ..Head::default() }
    }

    /// The pose.
    ///
    /// # Errors
    /// Directions that do not define it.
    pub fn pose(&self) -> Result<Pose, Reject> {
        listener_pose(self.listener, self.look, self.up)
    }

    /// The same shape in the pose of other parameters.
    #[must_use]
    pub fn posed_as(&self, other: &Self) -> Self {
        Self { listener: other.listener, look: other.look, up: other.up, ..*self }
    }
}
