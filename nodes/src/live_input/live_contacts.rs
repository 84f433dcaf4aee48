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
use crate::core::time::ticks;
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
    frames: u64,
}

impl Node for LiveContacts {
    type Params = LiveContactsParams;
    type Ports = LiveContactsPorts;
    const NAME: &'static str = "LiveContacts";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;

    fn shape(p: &LiveContactsParams, s: &mut Shape<'_, '_, LiveContactsPorts>) -> Result<(), Reject> {
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveContactsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let silence = ticks(p.silence).max(2 * ticks(p.frame));
        let tracker = ContactTracker::new(ticks(p.frame), silence, p.room.into());
        Ok(Self { inbox: cx.inputs.open(&p.channel.0, MessageKind::Contact, MAX_COUNT), tracker, frames: 0 })
    }

    fn run(&mut self, mut io: LiveContactsIo<'_>) -> Result<(), Fault> {
        let (_, end) = io.contacts.window();
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(end)) {
            while let Some((at, frame)) = self.tracker.next_timeout(tick) {
                io.contacts.push(at, frame);
            }
            let frame =
                contact_from_message(&message).and_then(|contact| self.tracker.process(tick, &contact));
            if let Some(frame) = frame {
                self.frames += 1;
                io.contacts.push(tick, frame);
            }
        }
        while let Some((at, frame)) = self.tracker.next_timeout(end) {
            io.contacts.push(at, frame);
        }
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
