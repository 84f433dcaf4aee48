//! Function shared by the targets of scenes.

use foley_nodes::mesh::*;

/// Checks the motion of an object, if it could be read: at least one frame, and finite positions.
pub fn read_motion(motion: Result<ObjectMotion, MeshError>) {
    if let Ok(motion) = motion {
        assert!(!motion.times().is_empty());
        for frame in 0..motion.times().len() {
            let position = motion.position(frame, [0.0; 3]);
            assert!(position.is_some_and(|p| p.iter().all(|x| x.is_finite())));
        }
    }
}
