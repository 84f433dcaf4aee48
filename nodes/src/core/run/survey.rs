//! Survey of the nodes of a stage: activity, levels, and why some give nothing.

use crate::core::silence::Silence;

/// Activity or levels of the nodes of a stage, taken by [`Stage::survey`](super::stage::Stage::survey).
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// `None` for a survey of levels.
    pub(super) active: Option<Vec<u64>>,
    pub(super) silence: Vec<Option<Silence>>,
    /// `None` for a survey of activity.
    pub(super) peaks: Option<Vec<f32>>,
}

impl Survey {
    /// A survey of a stage with this number of nodes. If `record` is true, the stage records their activity afterwards.
    #[must_use]
    pub fn new(nodes: usize, record: bool) -> Self {
        let active = vec![0; if record { nodes } else { 0 }];
        Self { active: Some(active), silence: vec![None; nodes], peaks: None }
    }

    /// A survey of the levels of a stage with this number of nodes. If `record` is true, the stage records them afterwards.
    #[must_use]
    pub fn of_levels(nodes: usize, record: bool) -> Self {
        let peaks = vec![0.0; if record { nodes } else { 0 }];
        Self { peaks: Some(peaks), ..Self::default() }
    }

    /// True for a survey of levels.
    #[must_use]
    pub fn is_of_levels(&self) -> bool {
        self.peaks.is_some()
    }

    /// The largest magnitude in the streams of numbers of a node since the last survey of levels, if it has recorded.
    #[must_use]
    pub fn peak(&self, node: usize) -> Option<f32> {
        self.peaks.as_ref()?.get(node).copied()
    }

    /// As [`Stage::activity`](super::stage::Stage::activity), since the last survey, if it has recorded.
    #[must_use]
    pub fn activity(&self, node: usize) -> Option<u64> {
        self.active.as_ref()?.get(node).copied()
    }

    /// Reason for which a node has given nothing so far.
    #[must_use]
    pub fn silence(&self, node: usize) -> Option<Silence> {
        *self.silence.get(node)?
    }
}
