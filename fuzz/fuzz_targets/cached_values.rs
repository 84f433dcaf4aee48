//! Values as the cache stores them; the first byte selects the type. Each is rejected, or can be stored again.
#![no_main]

use foley_nodes::core::ports::PortKind;
use foley_nodes::registry::all;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((&which, rest)) = bytes.split_first() else { return };
    let outputs = all().into_iter().flat_map(|ty| ty.outputs);
    let kinds: Vec<_> = outputs
        .filter_map(|output| match output.kind {
            PortKind::Value(kind) | PortKind::Fold(kind) => Some(kind),
            _ => None,
        })
        .collect();
    let kind = kinds[usize::from(which) % kinds.len()];
    if let Some(value) = (kind.decode)(rest) {
        assert!((kind.encode)(&value).is_some(), "a value that was read cannot be cached");
    }
});
