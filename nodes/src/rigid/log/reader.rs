//! Reader of contact logs.

use super::bodies::Bodies;
use super::contact_tracker::{ContactTracker, Manifold, TrackerParams};
use super::error::LogError;
use super::frame_interval::FrameIntervals;
use super::poses::{Poses, read_poses};
use super::row::{Row, read_rows};
use crate::core::time::{Tick, ticks};
use crate::rigid::item::ContactFrame;

/// Options of a reader of contact logs.
#[derive(Clone, Debug)]
pub struct LogOptions {
    /// Names of the bodies, by number; empty to use the numbers of the log.
    pub bodies: Vec<String>,
    /// Masses of the bodies, by number, kg; 0 for one that does not move.
    pub masses: Vec<f64>,
    /// Points that belong to one contact.
    pub manifold: Manifold,
    /// Frames per second of the engine; `None` estimates them over the log.
    pub rate: Option<f64>,
    /// Longest time for which a contact can be missing, s; at least two frames.
    pub hold: f64,
    /// Largest distance that a point moves from one frame to the next in addition to its slip, m.
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

/// Contacts of a log over time.
#[derive(Clone, Debug, Default)]
pub struct ContactTrack {
    /// Frames of contacts, in the order of time and contact.
    pub frames: Vec<(Tick, ContactFrame)>,
    /// Frame interval of the engine in most of the log.
    pub step: Tick,
    /// Longest frame interval, late frames included.
    pub longest: Tick,
    /// Frame interval that the times of the log have in common; `None` for a single time.
    pub observed: Option<Tick>,
    /// Number of rows of the file.
    pub rows: usize,
    /// Number of contacts.
    pub contacts: u64,
    /// Number of frames filled in where a contact was missing.
    pub bridged: u64,
    /// Bodies that are not in the list of names, with their numbers.
    pub unlisted: Vec<(u32, String)>,
    /// Names of the list that have no contact in the log.
    pub untouched: Vec<String>,
    /// Number of gaps between frames that are not a whole number of frames, and of all gaps.
    pub uneven: (usize, usize),
}

/// Distinct times of rows.
fn frame_times(rows: &[Row]) -> Vec<Tick> {
    let mut times: Vec<Tick> = rows.iter().map(|row| ticks(row.time)).collect();
    times.dedup();
    times
}

/// Reads a contact log, and poses of its bodies if there are any.
///
/// # Shapes
/// One [`ContactFrame`] per contact and frame; body a is the one with the smaller number. Force is the mean over the frame if the
/// log has impulses. A contact that is missing for no longer than `hold` has frames with a force of 0.
///
/// # Errors
/// [`LogError`] with line and column for unknown, missing or duplicate columns, numbers that are not finite, times that are not in
/// order, a normal or a quaternion of wrong length, and an empty file.
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
    let times = frame_times(&rows);
    let intervals = FrameIntervals::new(&times, options.rate);
    let params = TrackerParams {
        manifold: options.manifold,
        hold: options.hold,
        jump: options.jump,
        masses: options.masses.clone(),
    };
    let mut tracker = ContactTracker::new(params, &poses_read);
    let frames = rows.chunk_by(|a, b| ticks(a.time) == ticks(b.time));
    for (frame, interval) in frames.zip(&intervals.intervals) {
        tracker.push_frame(frame, *interval);
    }
    let (contacts, bridged) = (tracker.contact_count(), tracker.bridged);
    let frames = tracker.finish();
    let is_touched = |k: usize| rows.iter().any(|row| row.bodies.contains(&(k as u32)));
    let untouched = options.bodies.iter().enumerate().filter(|(k, _)| !is_touched(*k));
    Ok(ContactTrack {
        untouched: untouched.map(|(_, name)| name.clone()).collect(),
        unlisted: bodies.unlisted().to_vec(),
        frames,
        step: intervals.common,
        observed: intervals.observed,
        longest: intervals.longest,
        rows: rows.len(),
        contacts,
        bridged,
        uneven: (intervals.uneven, times.len().saturating_sub(1)),
    })
}

#[cfg(test)]
mod tests;
