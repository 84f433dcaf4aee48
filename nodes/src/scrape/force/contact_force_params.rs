//! Parameters that all excitations by contacts share.

use crate::core::time::Rate;
use crate::params;

params! {
    /// Force law of an excitation: `kappa (f/1 N)^a (v/1 m/s)^b` times the value read under the contact.
    pub struct ForceLawParams {
        /// Force in N of a value of 1 at 1 N and 1 m/s.
        kappa: f64 = 1.0, unit "N", range -1_000_000.0..=1_000_000.0;
        /// Exponent of the normal force.
        a: f64 = 1.0, unit "", range 0.0..=2.0;
        /// Exponent of the speed.
        b: f64 = 0.0, unit "", range 0.0..=2.0;
    }
}

params! {
    /// Contacts that an excitation reads, and the size of the surface that they touch.
    pub struct ContactForceParams {
        /// Factor of the force.
        gain: f64 = 1.0, unit "", range -1000.0..=1000.0;
        /// Size of the surfaces: 2 makes all lengths on them twice as large, heights and the size of the contact included.
        scale: f64 = 1.0, unit "", range 0.001..=1000.0;
        /// Number of the object whose contacts are read; None reads all.
        object: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Maximum number of simultaneous contacts.
        contacts: u16 = 64, unit "contacts", range 1..=1024_u16;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
