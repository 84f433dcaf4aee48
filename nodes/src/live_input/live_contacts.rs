//! The node `LiveContacts`.

use super::contact_message::contact_from_message;
use super::contact_tracker::ContactTracker;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, MAX_COUNT, MessageKind};
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, ticks};
use crate::rigid::ContactFrame;
use crate::{params, ports};

params! {
    /// Contacts of rigid bodies that come in while the graph plays: from OSC, or as JSON lines on standard input.
    ///
    /// Each frame of each contact is one message. A contact begins with its first message. It ends with a message that ends
    /// it, or after `silence` without a message, so that a stalled sender becomes silent. Its last frame has no force. In an
    /// offline run there are no contacts.
    pub struct LiveContactsParams {
        /// Name of the channel: messages are sent to `/foley/contact/CHANNEL`.
        channel: Text;
        /// Frame interval of the sender for messages without one.
        frame: f64 = 0.0166666666667, unit "s", range 0.0001..=0.2;
        /// Time without a message after which a contact has ended: two frames and the largest delay of a message.
        silence: f64 = 0.05, unit "s", range 0.001..=10.0;
        /// Maximum number of simultaneous contacts; messages of further contacts are left out.
        room: u16 = 64, unit "contacts", range 1..=1024_u16;
        /// Time to receive messages; None for no limit.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveContacts`.
    pub struct LiveContactsPorts / LiveContactsIo {
        in {}
        out {
            /// The contacts, one event per contact and frame.
            contacts: Events<ContactFrame>,
        }
    }
}

/// The node `LiveContacts`.
pub struct LiveContacts {
    inbox: Option<Box<dyn Inbox>>,
    tracker: ContactTracker,
    burst: Burst,
    frames: u64,
}

/// Frames of one time, which are one frame of each contact: messages that wait together, as after a pause of the sender or before the start,
/// have no times of their own, and a contact that moved in no time would be infinitely fast.
struct Burst {
    tick: Tick,
    frames: Vec<ContactFrame>,
    room: usize,
}

impl Burst {
    fn new(room: usize) -> Self {
        Self { tick: Tick::MIN, frames: Vec::with_capacity(room), room }
    }

    /// Adds a frame; those of an earlier time are sent before it.
    fn add(&mut self, tick: Tick, frame: ContactFrame, mut send: impl FnMut(Tick, ContactFrame)) {
        if tick != self.tick || self.frames.len() == self.room {
            self.send_all(&mut send);
            self.tick = tick;
        }
        let before = self.frames.iter_mut().rfind(|before| before.contact == frame.contact);
        match before.filter(|before| !before.ends && !frame.ends) {
            Some(before) => {
                *before = ContactFrame { begins: before.begins, interval: before.interval, ..frame };
            }
            None => self.frames.push(frame),
        }
    }

    fn send_all(&mut self, mut send: impl FnMut(Tick, ContactFrame)) {
        self.frames.drain(..).for_each(|frame| send(self.tick, frame));
    }
}

impl Node for LiveContacts {
    type Params = LiveContactsParams;
    type Ports = LiveContactsPorts;
    const NAME: &'static str = "LiveContacts";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Audio;

    fn shape(p: &LiveContactsParams, s: &mut Shape<'_, '_, LiveContactsPorts>) -> Result<(), Reject> {
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveContactsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let silence = ticks(p.silence).max(2 * ticks(p.frame));
        let tracker = ContactTracker::new(ticks(p.frame), silence, p.room.into());
        let burst = Burst::new(2 * usize::from(p.room) + 1);
        Ok(Self {
            burst,
            inbox: cx.inputs.open(&p.channel.0, MessageKind::Contact, MAX_COUNT),
            tracker,
            frames: 0,
        })
    }

    fn run(&mut self, mut io: LiveContactsIo<'_>) -> Result<(), Fault> {
        let (_, end) = io.contacts.window();
        let (mut sent, contacts) = (0, &mut io.contacts);
        let mut send = |tick, frame| {
            sent += 1;
            contacts.push(tick, frame);
        };
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(end)) {
            while let Some((at, frame)) = self.tracker.next_timeout(tick) {
                self.burst.add(at, frame, &mut send);
            }
            let frame =
                contact_from_message(&message).and_then(|contact| self.tracker.process(tick, &contact));
            frame.into_iter().for_each(|frame| self.burst.add(tick, frame, &mut send));
        }
        while let Some((at, frame)) = self.tracker.next_timeout(end) {
            self.burst.add(at, frame, &mut send);
        }
        self.burst.send_all(&mut send);
        self.frames += sent;
        Ok(())
    }

    fn finish(&mut self, _: LiveContactsIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("frames", self.frames.into()), ("left_out", self.tracker.left_out.into())])
    }

    fn trial(rng: &mut Rng) -> (LiveContactsParams, MemoryFiles) {
        let params = LiveContactsParams::trial(rng);
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        (LiveContactsParams { duration, room: 1 + rng.below(64) as u16, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live_input::ContactMessage;

    #[test]
    fn messages_that_wait_together_are_one_frame_of_each_contact() {
        let numbers = [3.0, 0.0, 2.0, 1.0, -2.0, 0.5, 0.0, 0.0, 1.0, 9.5, 0.3, 0.0, -0.1];
        let message = |id: u64, x: f64| {
            let mut message = ContactMessage::from_numbers(&numbers).unwrap();
            (message.id, message.point[0]) = (id, x);
            message
        };
        let mut tracker = ContactTracker::new(ticks(0.016), ticks(0.1), 4);
        let (mut burst, mut sent) = (Burst::new(9), Vec::new());
        let mut add = |tick, message: &ContactMessage| {
            let frame = tracker.process(tick, message).unwrap();
            burst.add(tick, frame, |tick, frame| sent.push((tick, frame)));
        };
        // Sixty frames of a second have waited, of two contacts; then they come at their times.
        for k in 0..60 {
            add(0, &message(1, f64::from(k)));
            add(0, &message(2, 0.5));
        }
        add(ticks(0.016), &message(1, 60.0));
        add(ticks(0.016), &ContactMessage::end(1));
        burst.send_all(|tick, frame| sent.push((tick, frame)));
        let found: Vec<_> = sent.iter().map(|(t, f)| (*t, f.contact, f.point[0], f.begins, f.ends)).collect();
        let later = ticks(0.016);
        assert_eq!(
            found,
            [
                (0, 1, 59.0, true, false),
                (0, 2, 0.5, true, false),
                (later, 1, 60.0, false, false),
                (later, 1, 60.0, false, true)
            ]
        );
        assert!(sent.iter().all(|(_, frame)| frame.interval == ticks(0.016)));
    }
}
