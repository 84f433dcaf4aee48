//! Friction models from JSON: refused, or with finite power at any speed.
#![no_main]

use foley_nodes::friction::FrictionModel;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(model) = serde_json::from_slice::<FrictionModel>(bytes)
        && model.validate().is_ok()
    {
        assert!(model.power(0.5).is_finite());
    }
});
