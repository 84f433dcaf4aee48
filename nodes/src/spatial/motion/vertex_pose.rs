//! The node `VertexPose`.

use super::item::Poses;
use super::pose::Pose;
use crate::archive_state;
use crate::contact::vector::{sub, widen};
use crate::core::fault::Reject;
use crate::core::node::Each;
use crate::core::params::Params;
use crate::core::random::Rng;
use crate::mesh::{Mesh, MeshFormat};
use crate::params;

params! {
    /// Outputs the pose of a vertex of a moving mesh, such as the head of a character, or a source that moves with a body.
    ///
    /// The position is that of the vertex `origin`, moved by `offset` in local axes. Two more vertices define the orientation: seen from
    /// the origin, `front` is in front and `up` above, as far as perpendicular to the front. Without them the local axes are those of the
    /// scene. If the three vertices are on one line, the pose retains its last orientation.
    pub struct VertexPoseParams {
        /// Vertex at the position.
        origin: usize = 0, unit "vertices", range 0..=100_000_000;
        /// Vertex in front of the origin; None, together with `up`, uses the axes of the scene.
        front: Option<usize> = None, unit "vertices", range 0..=100_000_000;
        /// Vertex above the origin.
        up: Option<usize> = None, unit "vertices", range 0..=100_000_000;
        /// Offset from the vertex in local axes (front, left, up), such as from the nose to the centre of the head.
        offset: [f64; 3] = [0.0; 3], unit "m", range -1000.0..=1000.0;
    }
}

/// The node `VertexPose`.
#[derive(Debug)]
pub struct VertexPose {
    origin: usize,
    axes: Option<[usize; 2]>,
    offset: [f64; 3],
    last: Pose,
}

impl Each for VertexPose {
    type Params = VertexPoseParams;
    type In = Mesh;
    type Out = Poses;
    const NAME: &'static str = "VertexPose";
    const INPUT: (&'static str, &'static str) = ("mesh", "The moving mesh.");
    const OUTPUT: (&'static str, &'static str) = ("pose", "The pose, frame by frame.");

    fn format(p: &VertexPoseParams, mesh: &MeshFormat) -> Result<(), Reject> {
        let count = mesh.topology.vertex_count();
        let given = [("origin", Some(p.origin)), ("front", p.front), ("up", p.up)];
        for (field, vertex) in given.into_iter().filter_map(|(field, v)| Some((field, v?))) {
            if vertex >= count {
                let message = format!("there is no vertex {vertex}; the mesh has {count}, counted from 0");
                return Err(Reject::new("F067", message).at(field));
            }
        }
        if p.front.is_some() != p.up.is_some() {
            let (has, needs) = if p.front.is_some() { ("front", "up") } else { ("up", "front") };
            let message = format!("`{has}` alone does not define the orientation");
            return Err(Reject::new("F067", message).at(has).help(format!("give `{needs}` too, or neither")));
        }
        Ok(())
    }

    fn new(p: &VertexPoseParams, _: &MeshFormat) -> Self {
        let axes = p.front.zip(p.up).map(|(front, up)| [front, up]);
        Self { origin: p.origin, axes, offset: p.offset, last: Pose::default() }
    }

    fn each(&mut self, mesh: &[[f32; 3]], out: &mut [Pose]) {
        let vertex = |k: usize| mesh.get(k).copied().map(widen).unwrap_or_default();
        let origin = vertex(self.origin);
        let local = self.axes.and_then(|[front, up]| {
            Pose::looking(origin, sub(vertex(front), origin), sub(vertex(up), origin))
        });
        let rotation = local.map_or(self.last.rotation, |pose| pose.rotation);
        let base = Pose { position: origin.map(|x| x as f32), rotation };
        self.last = Pose { position: base.to_scene(self.offset).map(|x| x as f32), rotation };
        out.fill(self.last);
    }

    archive_state!(last);

    fn trial(rng: &mut Rng) -> VertexPoseParams {
        let vertices = [[None; 2], [Some(1), Some(2)]][rng.below(2)];
        let [front, up] = vertices;
        VertexPoseParams { origin: rng.below(2) * 3, front, up, ..VertexPoseParams::trial(rng) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::node::PerItem;
    use crate::core::ports::{Port, Stream};
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::mesh::Topology;

    fn standalone(p: VertexPoseParams, frames: Vec<[f32; 3]>) -> Standalone {
        let rest = frames[..3].to_vec();
        let format = MeshFormat::moving(Topology { rest, triangles: vec![[0, 1, 2]] });
        Standalone::new::<PerItem<VertexPose>>(p).input(
            Port::<Stream<Mesh>>::new(0),
            Rate::hz(60),
            format,
            frames,
        )
    }

    fn params() -> VertexPoseParams {
        VertexPoseParams { front: Some(1), up: Some(2), ..VertexPoseParams::read(&|_| None).unwrap() }
    }

    #[test]
    fn the_pose_follows_its_triangle_and_keeps_its_orientation_when_that_collapses() {
        let frames = vec![
            // Front x, up z; then front y, up z, moved; then all in one place.
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.3, 0.0, 1.0],
            [0.0, 0.0, 5.0],
            [0.0, 2.0, 5.0],
            [0.0, 0.5, 6.0],
            [1.0, 1.0, 1.0],
            [1.0, 1.0, 1.0],
            [1.0, 1.0, 1.0],
        ];
        let p = VertexPoseParams { offset: [-0.1, 0.0, 0.0], ..params() };
        let poses = standalone(p, frames).run().unwrap().stream(Port::<Stream<Poses>>::new(0));
        assert_eq!(poses[0].position, [-0.1, 0.0, 0.0]);
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-6);
        assert!(near(poses[1].position.map(f64::from), [0.0, -0.1, 5.0]));
        assert!(near(poses[1].to_local([-1.0, -0.1, 5.0]), [0.0, 1.0, 0.0]));
        assert_eq!(poses[2].rotation, poses[1].rotation);
        assert!(near(poses[2].position.map(f64::from), [1.0, 0.9, 1.0]));
    }

    #[test]
    fn missing_vertices_and_half_an_orientation_are_refused() {
        let reject = |p| standalone(p, vec![[0.0; 3]; 3]).shape().unwrap_err();
        assert_eq!(reject(VertexPoseParams { origin: 3, ..params() }).field.as_deref(), Some("origin"));
        assert!(reject(VertexPoseParams { up: None, ..params() }).help.unwrap().contains("`up`"));
    }
}
