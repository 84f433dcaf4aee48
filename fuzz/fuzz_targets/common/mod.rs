//! Functions shared by the targets of value files.

use foley_nodes::core::item::AnyValue;
use foley_nodes::core::node::Func;
use foley_nodes::core::params::{Datum, Params};
use foley_nodes::core::standalone::Standalone;

/// The value that a node makes of a file; `None` where the node rejects the file with a reason. The value can be
/// written by every kind of tap, and the cache does not change it.
pub fn value_of<F: Func>(bytes: &[u8]) -> Option<AnyValue> {
    let path = |name: &str| (name == "path").then(|| Datum::Text("file".into()));
    let params = F::Params::read(&path).ok()?;
    let mut standalone = Standalone::func::<F>(params);
    standalone.files.insert("file", bytes);
    match standalone.run() {
        Ok(run) => {
            let value = run.value(0)?;
            let kind = value.kind();
            let _ = (value.json(), (kind.plot)(&value), (kind.file)(&value));
            let cached = (kind.encode)(&value).and_then(|bytes| (kind.decode)(&bytes));
            assert!(cached.is_some(), "a value that was read cannot be cached");
            Some(value)
        }
        Err(fault) => {
            assert!(fault.code != "F099" && !fault.message.is_empty(), "{fault}");
            None
        }
    }
}
