//! What a graph hears from outside while it plays: blows, contacts and numbers, from OSC or from lines on standard input, and meshes over TCP.
//!
//! Offline nothing comes in, and these nodes give what they give before the first message.

mod contacts;
mod control;
mod impacts;
mod mesh;

pub use contacts::{
    Gathering, LiveContacts, LiveContactsParams, LiveContactsPorts, Sent, contact_from_message,
    contact_to_message,
};
pub use control::{Glide, LiveControl, LiveControlParams, LiveControlPorts, control_to_message};
pub use impacts::{LiveImpacts, LiveImpactsParams, LiveImpactsPorts, from_message, to_message};
pub use mesh::{LiveMesh, LiveMeshParams, LiveMeshPorts};
