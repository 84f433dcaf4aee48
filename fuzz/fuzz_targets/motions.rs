//! Motions from tables, JSON lines and BVH, and texture models: rejected with a reason, or finite.
#![no_main]

use foley_nodes::soundtrack::motion::read_curve_table;
use foley_nodes::soundtrack::wavelet::TextureModel;
use foley_nodes::spatial::motion::bvh::Bvh;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match read_curve_table(bytes, "") {
        Ok(table) => assert!(table.end().is_finite()),
        Err(e) => assert!(e.line > 0 && !e.message.is_empty()),
    }
    let _ = Bvh::read(bytes);
    if let Ok(model) = TextureModel::from_bytes(bytes) {
        assert!(model.tree.validate().is_ok());
    }
});
