//! Grain dictionaries, correlation patterns and models of patterns: rejected, or valid values that are written as they were read.
#![no_main]

use foley_nodes::grain::statistics::PatternModel;
use foley_nodes::grain::{CorrelationPatterns, GrainDictionary};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(dictionary) = GrainDictionary::from_bytes(bytes) {
        assert!(dictionary.validate().is_ok());
        assert!(dictionary.grains.iter().all(|grain| dictionary.windowed(grain).iter().all(|x| x.is_finite())));
    }
    if let Ok(patterns) = CorrelationPatterns::from_bytes(bytes) {
        assert!(patterns.check_order().is_ok());
    }
    if let Ok(model) = PatternModel::from_bytes(bytes) {
        assert!(model.validate().is_ok());
    }
});
