//! Modes that ring under impacts, and the contacts of rigid bodies.

use super::Registry;
use crate::modal::bank::modal_bank::ModalBankNode;
use crate::modal::mode::membrane_modes::MembraneModes;
use crate::modal::mode::modes_file::ModesFile;
use crate::modal::residual::modal_residual::ModalResidual;
use crate::modal::surface::contact_damping::ContactDamping;
use crate::modal::surface::impact_projector::ImpactProjector;
use crate::modal::surface::mode_decay_times::ModeDecayTimes;
use crate::modal::surface::support_contacts::SupportContacts;
use crate::rigid::classification::contact_classifier::ContactClassifier;
use crate::rigid::classification::contact_report::ContactReport;
use crate::rigid::log::contact_log::ContactLog;

/// Modes of a membrane, and banks of modes.
pub(super) fn banks(types: Registry) -> Registry {
    types.with_func::<MembraneModes>().with::<ModalBankNode>()
}

/// Files of modes, their residual, and the surfaces that they have.
pub(super) fn modes(types: Registry) -> Registry {
    types
        .with::<ModalResidual>()
        .with_func::<ModesFile>()
        .with::<ImpactProjector>()
        .with::<ContactDamping>()
        .with::<SupportContacts>()
        .with::<ModeDecayTimes>()
}

/// Adds the family of rigid bodies.
pub(super) fn rigid_bodies(types: Registry) -> Registry {
    types.family("rigid").with::<ContactClassifier>().with::<ContactReport>().with::<ContactLog>()
}
