//! Modal models: rejected, or the same bytes when they are written again.
#![no_main]

use foley_nodes::solid::ModalModel;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(model) = ModalModel::from_bytes(bytes) {
        assert_eq!(ModalModel::from_bytes(&model.to_bytes().unwrap()).unwrap(), model);
    }
});
