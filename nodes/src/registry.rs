//! The plain list of all node types.

use crate::core::node::NodeType;
use crate::{dsp, io};

/// Every node type, one line each, by family.
#[must_use]
pub fn all() -> Vec<NodeType> {
    vec![
        NodeType::of::<io::nodes::WavInNode>("io"),
        NodeType::of::<io::nodes::WavOutNode>("io"),
        NodeType::of::<dsp::Advance>("dsp"),
        NodeType::of::<dsp::nodes::BiquadNode>("dsp"),
        NodeType::each::<dsp::nodes::ChannelsNode>("dsp"),
        NodeType::of::<dsp::nodes::DelayNode>("dsp"),
        NodeType::of::<dsp::nodes::FadeNode>("dsp"),
        NodeType::of::<dsp::nodes::FeedbackNode>("dsp"),
        NodeType::of::<dsp::nodes::GainNode>("dsp"),
        NodeType::of::<dsp::nodes::HighPassNode>("dsp"),
        NodeType::of::<dsp::nodes::ImpulsesNode>("dsp"),
        NodeType::of::<dsp::nodes::LoudnessNode>("dsp"),
        NodeType::of::<dsp::nodes::LowPassNode>("dsp"),
        NodeType::of::<dsp::nodes::MetronomeNode>("dsp"),
        NodeType::of::<dsp::nodes::MixNode>("dsp"),
        NodeType::each::<dsp::nodes::MonoNode>("dsp"),
        NodeType::of::<dsp::nodes::NoiseNode>("dsp"),
        NodeType::of::<dsp::nodes::NormalizeNode>("dsp"),
        NodeType::of::<dsp::nodes::PanNode>("dsp"),
        NodeType::of::<dsp::nodes::ResampleNode>("dsp"),
        NodeType::of::<dsp::nodes::SweepNode>("dsp"),
        NodeType::of::<dsp::nodes::ToneNode>("dsp"),
        NodeType::of::<dsp::nodes::TrimNode>("dsp"),
    ]
}
