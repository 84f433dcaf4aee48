//! Reference implementation of contact and sliding speed by brute force, as an oracle for tests of the detector.

use super::detector::DetectorParams;
use crate::contact::broad_phase::exclusion::Exclude;
use crate::contact::error::ContactError;
use crate::contact::item::Contact;
use crate::contact::slip::slide;
use crate::contact::triangle::{closest_point, is_behind};
use crate::contact::vector::{norm, sub, widen};
use crate::mesh::Topology;

/// Positions of all surfaces in one frame, the cloth first, in double precision.
pub type Surfaces = Vec<Vec<[f64; 3]>>;

/// Contacts and speeds between two frames, one entry per cloth vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedFrame {
    /// Middle of the two frame times, seconds.
    pub time: f64,
    /// Closest surface and triangle, if within the radius.
    pub contact: Vec<Option<(u32, u32)>>,
    /// Sliding speed, m/s; 0 without contact.
    pub tangential: Vec<f64>,
    /// Rate of change of the distance from the triangle's plane, m/s; 0 without contact.
    pub normal: Vec<f64>,
}

/// Rest distance along edges from one vertex to every vertex, by relaxing all edges until nothing changes.
fn edge_distances(cloth: &Topology, start: usize) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; cloth.vertex_count()];
    distance[start] = 0.0;
    let mut changed = true;
    while changed {
        changed = false;
        for t in &cloth.triangles {
            for (a, b) in
                [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)].map(|(i, j)| (t[i] as usize, t[j] as usize))
            {
                let through = distance[a] + norm(sub(widen(cloth.rest[a]), widen(cloth.rest[b])));
                if through < distance[b] {
                    distance[b] = through;
                    changed = true;
                }
            }
        }
    }
    distance
}

/// Returns true for each triangle of its own cloth that is excluded for a vertex.
///
/// # Complexity
/// O(V F) in the worst case.
#[must_use]
pub fn excluded(cloth: &Topology, vertex: usize, radius: f32, exclude: Exclude) -> Vec<bool> {
    let is_incident = |t: &[u32; 3]| t.contains(&(vertex as u32));
    let limit = match exclude {
        Exclude::IncidentOnly => return cloth.triangles.iter().map(is_incident).collect(),
        Exclude::Distance(d) => f64::from(d),
        Exclude::Auto => {
            let length = |c: u32| norm(sub(widen(cloth.rest[vertex]), widen(cloth.rest[c as usize])));
            let incident = cloth.triangles.iter().filter(|t| is_incident(t));
            incident.flatten().map(|&c| length(c)).fold(2.0 * f64::from(radius), f64::max)
        }
    };
    let distance = edge_distances(cloth, vertex);
    let near = |t: &[u32; 3]| t.iter().any(|&c| distance[c as usize] < limit);
    cloth.triangles.iter().map(|t| is_incident(t) || near(t)).collect()
}

/// Returns all contacts of one vertex, nearest first: squared distance, surface, triangle.
///
/// `own` is true for the excluded triangles of the cloth.
///
/// # Complexity
/// O(F log F).
#[must_use]
pub fn contacts_of(
    vertex: usize,
    topologies: &[&Topology],
    positions: &Surfaces,
    own: &[bool],
    params: &DetectorParams,
) -> Vec<(f64, u32, u32)> {
    let x = positions[0][vertex];
    let squared_radius = f64::from(params.radius).powi(2);
    let mut found = Vec::new();
    for (surface, topology) in topologies.iter().enumerate() {
        for (triangle, corners) in topology.triangles.iter().enumerate() {
            if surface == 0 && (!params.self_contact || own[triangle]) {
                continue;
            }
            let corners = corners.map(|c| positions[surface][c as usize]);
            let squared_distance = closest_point(x, corners).squared_distance;
            if squared_distance <= squared_radius && (params.two_sided || !is_behind(x, corners)) {
                found.push((squared_distance, surface as u32, triangle as u32));
            }
        }
    }
    found.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    found
}

/// Returns the sliding speeds of an animation: entry i is the motion from frame i to frame i + 1.
///
/// # Shapes
/// `topologies` and each frame hold the cloth first; one time per frame. The result is one shorter than the frames.
///
/// # Errors
/// [`ContactError`] for times that do not increase and for counts that do not match.
///
/// # Complexity
/// O(frames V F): for tests and small scenes.
pub fn sliding_speeds(
    topologies: &[&Topology],
    frames: &[Surfaces],
    times: &[f64],
    params: &DetectorParams,
) -> Result<Vec<SpeedFrame>, ContactError> {
    if times.len() != frames.len() {
        let (found, expected) = (times.len(), frames.len());
        return Err(ContactError::Length { what: "the list of frame times", found, expected });
    }
    for frame in frames {
        if frame.len() != topologies.len() {
            let (found, expected) = (frame.len(), topologies.len());
            return Err(ContactError::Length { what: "the list of surfaces in a frame", found, expected });
        }
        for (surface, (positions, topology)) in frame.iter().zip(topologies).enumerate() {
            let (found, expected) = (positions.len(), topology.vertex_count());
            if found != expected {
                return Err(ContactError::Positions { surface, found, expected });
            }
        }
    }
    let Some(cloth) = topologies.first() else { return Ok(Vec::new()) };
    let own: Vec<Vec<bool>> =
        (0..cloth.vertex_count()).map(|v| excluded(cloth, v, params.radius, params.exclude)).collect();
    let mut speeds = Vec::new();
    for (i, pair) in frames.windows(2).enumerate() {
        let dt = times[i + 1] - times[i];
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(ContactError::Time { frame: i + 1, found: times[i + 1], previous: times[i] });
        }
        let mut frame = SpeedFrame {
            time: 0.5 * (times[i] + times[i + 1]),
            contact: Vec::new(),
            tangential: Vec::new(),
            normal: Vec::new(),
        };
        for (v, own) in own.iter().enumerate() {
            let first = contacts_of(v, topologies, &pair[0], own, params).first().copied();
            let motion = first.map(|(_, surface, triangle)| {
                let corners = topologies[surface as usize].triangles[triangle as usize];
                let at = |f: &Surfaces| corners.map(|c| f[surface as usize][c as usize]);
                slide(pair[0][0][v], at(&pair[0]), pair[1][0][v], at(&pair[1]))
            });
            frame.contact.push(first.map(|f| (f.1, f.2)));
            frame.tangential.push(motion.map_or(0.0, |m| m.tangential / dt));
            frame.normal.push(motion.map_or(0.0, |m| m.normal / dt));
        }
        speeds.push(frame);
    }
    Ok(speeds)
}

/// Returns the surface and the triangle of a contact, for comparison with [`contacts_of`].
#[must_use]
pub fn key(contact: &Contact) -> Option<(u32, u32)> {
    contact.is_some().then_some((contact.surface, contact.triangle))
}
