//! Reads the contacts that a physics engine logged.

use super::bodies::Bodies;
use super::error::LogError;
use super::item::ContactFrame;
use super::join::{Joiner, Joining, Manifold};
use super::pace::Pace;
use super::poses::{Poses, read_poses};
use super::row::{Row, read_rows};
use crate::core::time::{Tick, ticks};

/// How a log is read.
#[derive(Clone, Debug)]
pub struct LogOptions {
    /// Names of the bodies, by number; empty for the log's own numbers.
    pub bodies: Vec<String>,
    /// Masses of the bodies, by number, kg; 0 for one that does not move.
    pub masses: Vec<f64>,
    /// What one contact is.
    pub manifold: Manifold,
    /// Frames per second of the engine; `None` finds them, all along the log.
    pub rate: Option<f64>,
    /// Longest time for which a contact may be missing, s; at least two frames.
    pub hold: f64,
    /// How far a point may go from one frame to the next beyond what its slip explains, m.
    pub jump: f64,
}

impl Default for LogOptions {
    fn default() -> Self {
        Self {
            bodies: Vec::new(),
            masses: Vec::new(),
            manifold: Manifold::Centroid,
            rate: None,
            hold: 0.03,
            jump: 0.02,
        }
    }
}

/// Contacts of a log.
#[derive(Clone, Debug, Default)]
pub struct ContactTrack {
    /// Frames of contacts, in the order of time and then of contacts.
    pub frames: Vec<(Tick, ContactFrame)>,
    /// Time between two frames of the engine in most of the log.
    pub step: Tick,
    /// The longest of all these times, late frames among them.
    pub longest: Tick,
    /// Rows of the file.
    pub rows: usize,
    /// Contacts.
    pub contacts: u64,
    /// Frames in which a contact was missing and yet went on.
    pub bridged: u64,
    /// Bodies that no list names, with their numbers.
    pub unlisted: Vec<(u32, String)>,
    /// Names of the list of which the log knows nothing.
    pub unseen: Vec<String>,
    /// Steps of time that are no whole number of frames, of all steps.
    pub uneven: (usize, usize),
}

/// Times of frames.
fn times(rows: &[Row]) -> Vec<Tick> {
    let mut times: Vec<Tick> = rows.iter().map(|row| ticks(row.time)).collect();
    times.dedup();
    times
}

/// Reads a log of contacts, and the poses of the bodies where there are any.
///
/// # Shapes
/// One [`ContactFrame`] per contact and frame; body a is the one with the smaller number. Force is the mean over the frame where the log has
/// impulses. In frames in which a contact is missing for no longer than `hold` its force is 0.
///
/// # Errors
/// Names line and column, what was found and what would be right: columns that are not known, missing or said twice, fields that are no
/// finite number, time that goes back, a normal or a quaternion of wrong length, an empty file.
///
/// # Complexity
/// Linear in the rows; in each frame the points of a pair times its contacts.
///
/// # Example
/// ```
/// use foley_nodes::rigid::{LogOptions, read_contacts};
///
/// let text = "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n0.1,world,box,0,0,0,0,0,1,9.8,0.3,0,0\n";
/// let track = read_contacts(text.as_bytes(), None, &LogOptions::default())?;
/// assert_eq!((track.frames[0].1.bodies, track.frames[0].1.force), ([0, 1], 9.8));
/// # Ok::<(), foley_nodes::rigid::LogError>(())
/// ```
pub fn read_contacts(
    contacts: &[u8],
    poses: Option<&[u8]>,
    options: &LogOptions,
) -> Result<ContactTrack, LogError> {
    let mut bodies = Bodies::new(&options.bodies);
    let poses_read = match poses {
        Some(bytes) => read_poses(bytes, &mut bodies).map_err(LogError::Poses)?,
        None => Poses::default(),
    };
    let rows = read_rows(contacts, poses.is_some(), &mut bodies).map_err(LogError::Contacts)?;
    let times = times(&rows);
    let pace = Pace::new(&times, options.rate);
    let how = Joining {
        manifold: options.manifold,
        hold: options.hold,
        jump: options.jump,
        masses: options.masses.clone(),
    };
    let mut joiner = Joiner::new(how, &poses_read);
    let frames = rows.chunk_by(|a, b| ticks(a.time) == ticks(b.time));
    for (frame, step) in frames.zip(&pace.steps) {
        joiner.frame(frame, *step);
    }
    let (contacts, bridged) = (joiner.contacts(), joiner.bridged);
    let frames = joiner.close();
    let seen = |k: usize| rows.iter().any(|row| row.bodies.contains(&(k as u32)));
    let unseen = options.bodies.iter().enumerate().filter(|(k, _)| !seen(*k)).map(|(_, name)| name.clone());
    Ok(ContactTrack {
        unseen: unseen.collect(),
        unlisted: bodies.unlisted().to_vec(),
        frames,
        step: pace.step,
        longest: pace.longest,
        rows: rows.len(),
        contacts,
        bridged,
        uneven: (pace.uneven, times.len().saturating_sub(1)),
    })
}

#[cfg(test)]
#[path = "log_tests.rs"]
mod tests;
