//! Nodes whose input comes from outside while a graph plays: impacts, contacts, triggers and numbers from OSC or from JSON lines on
//! standard input, and meshes over TCP; and meters that show levels meanwhile.
//!
//! In an offline run there is no input: the outputs are those before the first message.

mod contact_message;
mod contact_tracker;
mod live_contacts;
mod live_control;
mod live_impacts;
mod live_mesh;
mod live_meter;
mod live_triggers;

pub use contact_message::{ContactMessage, contact_from_message, contact_to_message};
pub use contact_tracker::ContactTracker;
pub use live_contacts::{LiveContacts, LiveContactsParams, LiveContactsPorts};
pub use live_control::{Glide, LiveControl, LiveControlParams, LiveControlPorts, control_to_message};
pub use live_impacts::{
    LiveImpacts, LiveImpactsParams, LiveImpactsPorts, impact_from_message, impact_to_message,
};
pub use live_mesh::{LiveMesh, LiveMeshParams, LiveMeshPorts};
pub use live_meter::{LiveMeter, LiveMeterParams, LiveMeterPorts};
pub use live_triggers::{
    LiveTriggers, LiveTriggersParams, LiveTriggersPorts, trigger_from_message, trigger_to_message,
};
