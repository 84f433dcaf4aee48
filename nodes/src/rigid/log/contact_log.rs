//! The node `ContactLog`.

use super::contact_tracker::Manifold;
use super::error::LogError;
use super::reader::{ContactTrack, LogOptions, read_contacts};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::seconds;
use crate::rigid::item::ContactFrame;
use crate::{params, ports};
use std::sync::Arc;

params! {
    /// Reads contacts of rigid bodies from the log of a physics engine: CSV with a header, or one JSON object per line.
    ///
    /// Columns are identified by name; the chapter on contacts of the book lists those of foley, MuJoCo and Bullet. A
    /// suffix states a unit other than SI, as in `time_ms` or `px_mm`. Every contact point is one row, with the time,
    /// the two bodies, position, normal, force or impulse, and the velocity of b relative to a. A separate file of
    /// poses of the bodies adds positions on the bodies, velocities that the log does not have, and speeds of approach.
    ///
    /// A contact point that circulates, as on the rim of a coin that settles, is followed at any number of turns per frame by the angular
    /// velocity in the poses, and the time at which a contact began within its frame by the velocities before and after it.
    ///
    /// Body a of a pair is always the one with the smaller number. Points are tracked from frame to frame to find their contacts. A
    /// contact that is missing for up to `hold` continues without force; after a longer gap it has ended.
    ///
    /// The summary reports the `frame` for ContactClassifier and ContactPath as `longest_frame_ms`, with late frames and without
    /// missing ones.
    pub struct ContactLogParams {
        /// The file of contacts.
        path: AssetPath;
        /// The file of poses; quaternions are read by the names of their columns, in any order.
        poses: Option<AssetPath> = None;
        /// Names of the bodies, beginning with body 0. Without names the numbers of the log apply, and `world` is 0.
        bodies: Vec<Text> = Vec::new();
        /// Masses of the bodies, by number; 0 for one that does not move.
        masses: Vec<f64> = Vec::new(), unit "kg", range 0.0..=1.0e12_f64;
        /// Points that belong to one contact.
        manifold: Manifold = Manifold::Centroid;
        /// Frames per second of the engine; None estimates them, also where they change.
        rate: Option<f64> = None, unit "Hz", range 1.0..=100_000.0;
        /// Longest time for which a contact can be missing without ending; at least two frames.
        hold: f64 = 0.03, unit "s", range 0.0..=1.0;
        /// Largest distance that a point moves from one frame to the next in addition to its slip, if every point is a contact.
        jump: f64 = 0.02, unit "m", range 0.0..=1000.0;
    }
}
ports! {
    pub struct ContactLogPorts / ContactLogIo {
        in {}
        out {
            /// The contacts, one event per contact and frame.
            contacts: Events<ContactFrame>,
        }
    }
}

/// The node `ContactLog`.
#[derive(Debug)]
pub struct ContactLog {
    track: Arc<ContactTrack>,
}

fn options(p: &ContactLogParams) -> LogOptions {
    LogOptions {
        bodies: p.bodies.iter().map(|name| name.0.clone()).collect(),
        masses: p.masses.clone(),
        manifold: p.manifold,
        rate: p.rate,
        hold: p.hold,
        jump: p.jump,
    }
}

fn read_track(p: &ContactLogParams, contacts: &[u8], poses: Option<&[u8]>) -> Result<ContactTrack, Reject> {
    if let Some((_, name)) = p.bodies.iter().enumerate().find(|(k, name)| p.bodies[..*k].contains(name)) {
        return Err(Reject::new("F133", format!("the body {:?} is named twice", name.0)).at("bodies"));
    }
    if !p.bodies.is_empty() && p.masses.len() > p.bodies.len() {
        let message = format!("{} masses for {} bodies; one each is needed", p.masses.len(), p.bodies.len());
        return Err(Reject::new("F133", message).at("masses"));
    }
    read_contacts(contacts, poses, &options(p)).map_err(|e| match e {
        LogError::Contacts(e) => Reject::new("F131", format!("{:?}, {e}", p.path.0)).at("path"),
        LogError::Poses(e) => {
            let path = p.poses.as_ref().map_or("", |path| &path.0);
            Reject::new("F132", format!("{path:?}, {e}")).at("poses")
        }
    })
}

/// Notes on a log for the user.
fn notes(p: &ContactLogParams, track: &ContactTrack) -> Vec<String> {
    let path = &p.path.0;
    let mut notes = Vec::new();
    let (uneven, gaps) = track.uneven;
    let wrong_rate = p.rate.zip(track.observed).filter(|(_, observed)| {
        let ratio = *observed as f64 / track.step.max(1) as f64;
        (ratio - 1.0).abs() > 0.05
    });
    if let Some((rate, observed)) = wrong_rate {
        let own = seconds(observed);
        notes.push(format!(
            "{path:?}: its frames are {:.3} ms apart, {:.1} a second, and `rate` is {rate}: leave `rate` out, unless frames without contacts are missing",
            own * 1e3,
            1.0 / own
        ));
    } else if uneven * 10 > gaps {
        let ms = seconds(track.step) * 1e3;
        notes.push(format!("{path:?}: {uneven} of {gaps} gaps between frames are not a whole number of frames of {ms:.3} ms; set `rate` if frames have another length"));
    }
    if wrong_rate.is_none() && track.bridged * 10 > track.frames.len() as u64 {
        let (missing, all) = (track.bridged, track.frames.len());
        notes.push(format!(
            "{path:?}: {missing} of {all} frames of contacts are missing and treated as silent; set `rate` if frames have another length"
        ));
    }
    for name in &track.untouched {
        notes.push(format!("{path:?}: nothing touches the body {name:?}"));
    }
    if !p.bodies.is_empty() && !track.unlisted.is_empty() {
        let names: Vec<String> = track.unlisted.iter().map(|(k, name)| format!("{name} is {k}")).collect();
        notes.push(format!("{path:?}: bodies that are not in `bodies`: {}", names.join(", ")));
    }
    notes
}

impl Node for ContactLog {
    type Params = ContactLogParams;
    type Ports = ContactLogPorts;
    const NAME: &'static str = "ContactLog";
    const VERSION: u32 = 7;
    const CLASS: Class = Class::Audio;

    fn shape(p: &ContactLogParams, s: &mut Shape<'_, '_, ContactLogPorts>) -> Result<(), Reject> {
        let contacts = s.bytes("path", &p.path.0)?;
        let poses = p.poses.as_ref().map(|path| s.bytes("poses", &path.0)).transpose()?;
        let track = read_track(p, &contacts, poses.as_deref())?;
        for note in notes(p, &track) {
            s.note(note);
        }
        s.ends(Some(track.frames.last().map_or(0, |(tick, _)| tick + 1)));
        s.prepare(track);
        Ok(())
    }

    fn build(p: &ContactLogParams, cx: &Build<'_>) -> Result<Self, Fault> {
        if let Some(track) = cx.prepared::<ContactTrack>() {
            return Ok(Self { track });
        }
        let contacts = cx.bytes("path", &p.path.0)?;
        let poses = p.poses.as_ref().map(|path| cx.bytes("poses", &path.0)).transpose()?;
        Ok(Self { track: Arc::new(read_track(p, &contacts, poses.as_deref())?) })
    }

    fn run(&mut self, mut io: ContactLogIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.contacts.window();
        let frames = &self.track.frames;
        let first = frames.partition_point(|(tick, _)| *tick < from);
        for (tick, frame) in frames.iter().skip(first).take_while(|(tick, _)| *tick < to) {
            io.contacts.push(*tick, *frame);
        }
        Ok(())
    }

    fn finish(&mut self, _: ContactLogIo<'_>) -> Result<Summary, Fault> {
        let track = &self.track;
        Ok(vec![
            ("rows", track.rows.into()),
            ("frames", track.frames.len().into()),
            ("contacts", track.contacts.into()),
            ("bridged", track.bridged.into()),
            ("frame_ms", (seconds(track.step) * 1e3).into()),
            ("longest_frame_ms", (seconds(track.longest) * 1e3).into()),
        ])
    }

    fn trial(rng: &mut Rng) -> (ContactLogParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let mut text = String::from("time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n");
        let mut poses = String::from("time,name,px,py,pz,qw,qx,qy,qz\n");
        let mut time = 0.0;
        for _ in 0..1 + rng.below(20) {
            time += [1.0, 1.0, 1.0, 2.0, 5.0][rng.below(5)] / 120.0;
            poses += &format!("{time},ball,{},0,0,1,0,0,0\n", time * 0.5);
            for _ in 0..1 + rng.below(3) {
                let [x, y] = [(); 2].map(|()| rng.between(-0.1, 0.1));
                let force = rng.between(0.0, 20.0);
                let body = ["ball", "box"][rng.below(2)];
                text += &format!("{time},world,{body},{x},{y},0,0,0,1,{force},{x},0.2,{y}\n");
            }
        }
        files.insert("contacts.csv", text);
        files.insert("poses.csv", poses);
        let params = ContactLogParams {
            path: "contacts.csv".into(),
            poses: [None, Some("poses.csv".into())][rng.below(2)].clone(),
            bodies: [Vec::new(), vec!["box".into(), "ball".into(), "world".into()]][rng.below(2)].clone(),
            masses: vec![0.0, 0.2],
            // At higher rates more frames would be filled in than the events of a window can hold.
            rate: [None, Some(120.0)][rng.below(2)],
            hold: rng.between(0.0, 0.1),
            ..ContactLogParams::trial(rng)
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Datum;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Tick, ticks};

    const LOG: &str = "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz\n\
        0,world,box,0,0,0,0,0,1,2,0.5,0,0\n0.01,world,box,0.005,0,0,0,0,1,2,0.5,0,0\n0.2,world,box,0.1,0,0,0,0,1,2,0.5,0,0\n";

    fn standalone(text: &str, masses: &str) -> Standalone {
        let (path, bodies) = (Datum::Text("log.csv".into()), vec![Datum::Text("world".into())]);
        let masses: Vec<Datum> =
            masses.split_whitespace().map(|m| Datum::Float(m.parse().unwrap())).collect();
        let p = ContactLogParams::read(&|name| match name {
            "path" => Some(path.clone()),
            "bodies" => Some(Datum::List(bodies.clone())),
            "masses" => Some(Datum::List(masses.clone())),
            _ => None,
        });
        let mut standalone = Standalone::new::<ContactLog>(p.unwrap());
        standalone.files.insert("log.csv", text);
        standalone
    }

    #[test]
    fn frames_come_at_their_times_in_windows_of_any_length() {
        let run = standalone(LOG, "0").window(ticks(0.007)).run().unwrap();
        let frames = run.events(ContactLogPorts::contacts);
        let times: Vec<(Tick, bool, bool)> = frames.iter().map(|(t, f)| (*t, f.begins, f.ends)).collect();
        assert_eq!(times, [(0, true, false), (ticks(0.01), false, true), (ticks(0.2), true, true)]);
    }

    #[test]
    fn missing_frames_give_a_note_and_a_slower_rate_does_not() {
        let line = |time: f64| format!("{time},world,box,{},0,0,0,0,1,2,0.5,0,0\n", 0.5 * time);
        let header = LOG.split('\n').next().unwrap();
        let even: String = (0..60).map(|k| line(0.01 * f64::from(k))).collect();
        let slower: String = (0..30).map(|k| line(0.6 + 0.02 * f64::from(k))).collect();
        let notes = |text: &str| {
            let mut notes = standalone(&format!("{header}\n{text}"), "0").shape().unwrap().notes;
            notes.retain(|note| note.contains("missing"));
            notes
        };
        assert_eq!(notes(&even), [""; 0]);
        assert_eq!(notes(&(even.clone() + &slower)), [""; 0]);
        // Two frames, then one without contact.
        let holes: String = (0..60).filter(|k| k % 3 != 2).map(|k| line(0.01 * f64::from(k))).collect();
        let found = notes(&holes);
        assert!(
            found.len() == 1 && found[0].contains("19 of 59 frames of contacts are missing"),
            "{found:?}"
        );
    }

    #[test]
    fn errors_are_found_before_the_run() {
        let reject = standalone(&LOG.replace("0.005", "far"), "0").shape().unwrap_err();
        assert!(reject.code == "F131" && reject.message.contains("line 3, column `px`"), "{reject}");
        let reject = standalone(LOG, "0 1").shape().unwrap_err();
        assert!(reject.code == "F133" && reject.message.contains("2 masses for 1"), "{reject}");
    }
}
