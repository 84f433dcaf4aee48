//! The surface of an object with the shapes of its modes: where impacts excite them, and where supports damp them.

pub mod contact;
pub mod contact_damping;
pub mod coupling;
pub mod damping_of_contacts;
pub mod impact_projector;
pub mod mode_decay_times;
pub mod mode_shapes;
pub mod support;
pub mod support_contacts;
pub mod surface_index;
pub mod surface_view;
