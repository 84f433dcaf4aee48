//! Begin and end of contacts that come in as messages.

use super::ContactMessage;
use crate::contact::vector::{Vec3, norm};
use crate::core::time::{Tick, ticks};
use crate::rigid::ContactFrame;

/// Converts messages into contacts that begin and end.
#[derive(Debug)]
pub struct ContactTracker {
    /// Frame interval of messages without one.
    pub frame_interval: Tick,
    /// Time without a message after which a contact has ended.
    pub silence: Tick,
    max_contacts: usize,
    /// Time and contents of the last frame of each contact.
    contacts: Vec<(Tick, ContactFrame)>,
    /// Number of messages left out because there were too many contacts.
    pub left_out: u64,
}

impl ContactTracker {
    /// A tracker of at most `max_contacts` simultaneous contacts.
    #[must_use]
    pub fn new(frame_interval: Tick, silence: Tick, max_contacts: usize) -> Self {
        Self {
            frame_interval,
            silence,
            max_contacts,
            contacts: Vec::with_capacity(max_contacts),
            left_out: 0,
        }
    }

    /// Processes one message and returns its frame; `None` if the contact is unknown or left out.
    pub fn process(&mut self, tick: Tick, message: &ContactMessage) -> Option<ContactFrame> {
        let index = self.contacts.iter().position(|(_, frame)| frame.contact == message.id);
        if message.ends {
            let (_, frame) = self.contacts.swap_remove(index?);
            return Some(Self::ended(frame));
        }
        let previous = index.and_then(|k| self.contacts.get(k)).copied();
        // A frame interval in the message takes precedence over the times of arrival.
        let elapsed = previous
            .map_or(self.frame_interval, |(last, _)| (tick - last).max(self.frame_interval / 4).max(1));
        let interval = message.step.filter(|s| *s > 0.0).map_or(elapsed, |s| ticks(s.min(1.0)).max(1));
        // Body a is the one with the lower index.
        let sign = if message.bodies[0] > message.bodies[1] { -1.0 } else { 1.0 };
        let oriented = |v: Vec3| v.map(|x| (x * sign) as f32);
        let over_a = message.travel.map(|v| v.map(|x| x as f32));
        // The velocity over b is the velocity over a minus the slip.
        let over_b = message.travel.map(|v| [0, 1, 2].map(|k| (v[k] - message.velocity[k]) as f32));
        let length = norm(message.normal);
        let mut frame = ContactFrame {
            contact: message.id,
            bodies: message.bodies,
            interval,
            point: message.point,
            local: [message.point; 2],
            normal: oriented(message.normal.map(|x| x / length)),
            force: message.force as f32,
            friction: None,
            velocity: oriented(message.velocity),
            travel: [over_a, over_b],
            approach: message.approach.map(|v| v as f32),
            // That of a contact that goes on says nothing about a landing.
            depth: message.depth.filter(|_| previous.is_none()).map(|d| d as f32),
            mass: message.mass.map(|m| m as f32),
            begins: previous.is_none(),
            ends: false,
        };
        if sign < 0.0 {
            frame.bodies.swap(0, 1);
            frame.travel.swap(0, 1);
        }
        if let Some(last) = index.and_then(|k| self.contacts.get_mut(k)) {
            *last = (tick, frame);
        } else if self.contacts.len() < self.max_contacts {
            self.contacts.push((tick, frame));
        } else {
            self.left_out += 1;
            return None;
        }
        Some(frame)
    }

    /// Removes the first contact whose silence ends before a time; returns the time of its end and its last frame.
    pub fn next_timeout(&mut self, before: Tick) -> Option<(Tick, ContactFrame)> {
        let oldest = self.contacts.iter().enumerate().min_by_key(|(_, (last, frame))| (*last, frame.contact));
        let (k, end) =
            oldest.map(|(k, (last, _))| (k, last + self.silence)).filter(|(_, end)| *end < before)?;
        let (_, frame) = self.contacts.swap_remove(k);
        Some((end, Self::ended(frame)))
    }

    /// The last frame of a contact: without force.
    fn ended(frame: ContactFrame) -> ContactFrame {
        ContactFrame { force: 0.0, approach: frame.approach.map(|_| 0.0), begins: false, ends: true, ..frame }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MESSAGE: [f64; 19] =
        [3.0, 0.0, 2.0, 1.0, -2.0, 0.5, 0.0, 0.0, 1.0, 9.5, 0.3, 0.0, -0.1, 0.2, -1.0, 0.4, 0.0, 0.0, 0.01];

    #[test]
    fn contacts_begin_continue_and_end_by_message_or_by_silence() {
        let mut tracker = ContactTracker::new(ticks(0.01), ticks(0.05), 2);
        let message =
            |id| ContactMessage { id, step: None, ..ContactMessage::from_numbers(&MESSAGE).unwrap() };
        let first = tracker.process(0, &message(1)).unwrap();
        assert!(first.begins && !first.ends && first.interval == ticks(0.01));
        let next = tracker.process(ticks(0.02), &message(1)).unwrap();
        assert!(!next.begins && next.interval == ticks(0.02));
        assert!(tracker.process(ticks(0.02), &message(2)).unwrap().begins);
        assert!(tracker.process(ticks(0.02), &message(3)).is_none() && tracker.left_out == 1);
        let ended = tracker.process(ticks(0.03), &ContactMessage::end(2)).unwrap();
        assert!(ended.ends && ended.force == 0.0 && ended.bodies == [0, 2]);
        assert!(tracker.process(ticks(0.03), &ContactMessage::end(2)).is_none());
        assert_eq!(tracker.next_timeout(ticks(0.07)), None);
        let (end, stalled) = tracker.next_timeout(ticks(0.071)).unwrap();
        assert!(end == ticks(0.07) && stalled.ends && stalled.contact == 1);
        assert!(tracker.process(ticks(0.08), &message(1)).unwrap().begins, "the contact can begin again");
    }

    #[test]
    fn body_a_has_the_smaller_index() {
        let mut tracker = ContactTracker::new(ticks(0.01), ticks(0.05), 2);
        let message = ContactMessage { bodies: [2, 0], ..ContactMessage::from_numbers(&MESSAGE).unwrap() };
        let frame = tracker.process(0, &message).unwrap();
        assert_eq!(
            (frame.bodies, frame.normal, frame.velocity),
            ([0, 2], [-0.0, -0.0, -1.0], [-0.3, -0.0, 0.1])
        );
        assert_eq!(frame.travel[1], Some([0.4, 0.0, 0.0]));
    }
}
