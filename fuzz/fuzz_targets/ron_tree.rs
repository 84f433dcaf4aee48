//! The tree preserves every text and agrees with `ron` on its validity; formatting it twice changes nothing more.
#![no_main]

use foley::lang::{fmt, parse};
use libfuzzer_sys::fuzz_target;
use serde::de::IgnoredAny;

fuzz_target!(|text: &str| {
    let parsed = parse(text);
    assert_eq!(parsed.syntax().text().to_string(), text);
    assert_eq!(parsed.is_ok(), ron::from_str::<IgnoredAny>(text).is_ok(), "{:?}", parsed.errors());
    let _ = parsed.document();
    if let Ok(once) = fmt::format(text) {
        assert_eq!(fmt::format(&once).as_ref(), Ok(&once));
    }
});
