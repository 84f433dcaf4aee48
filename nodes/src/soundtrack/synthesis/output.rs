//! The open part of the tree of an output: one root with all below, and its history.

use crate::impl_state;

/// One level of the output.
#[derive(Clone, Debug, Default)]
pub struct OutputLevel {
    /// Values by node and channel, from `history` nodes before the current root on.
    pub values: Vec<f32>,
    /// The nodes that they were copied from; [`NONE`] where there is none yet.
    pub picks: Vec<u32>,
    /// The length of the stretch of the source that each node ends.
    pub runs: Vec<u32>,
}

impl_state!(OutputLevel { values, picks, runs });

/// No node.
pub const NONE: u32 = u32::MAX;

/// The open part of an output.
#[derive(Clone, Debug)]
pub struct OutputTree {
    /// Number of nodes before the current root, in each level.
    pub history: usize,
    channels: usize,
    /// The levels.
    pub levels: Vec<OutputLevel>,
}

impl_state!(OutputTree { each levels });

impl OutputTree {
    /// Nothing yet.
    pub fn new(depth: usize, channels: usize, history: usize) -> Self {
        let level = |l: usize| {
            let nodes = history + (1 << l);
            OutputLevel {
                values: vec![0.0; nodes * channels],
                picks: vec![NONE; nodes],
                runs: vec![0; nodes],
            }
        };
        Self { history, channels, levels: (0..depth).map(level).collect() }
    }

    /// Makes the end of the current root the history of the next.
    pub fn advance(&mut self) {
        let (history, channels) = (self.history, self.channels);
        for (l, level) in self.levels.iter_mut().enumerate() {
            let nodes = 1 << l;
            level.values.copy_within(nodes * channels.., 0);
            level.picks.copy_within(nodes.., 0);
            level.runs.copy_within(nodes.., 0);
            level.picks[history..].fill(NONE);
        }
    }

    /// Copies the current root of another output of the same model, and as much of its history as there is room for.
    pub fn take_history(&mut self, other: &Self) {
        let (channels, own) = (self.channels, self.history);
        for (level, other_level) in self.levels.iter_mut().zip(&other.levels) {
            let nodes = level.picks.len() - own;
            let count = own.min(other.history) + nodes;
            let (to, from) = (level.picks.len() - count, other_level.picks.len() - count);
            level.picks[..to].fill(NONE);
            level.picks[to..].copy_from_slice(&other_level.picks[from..]);
            level.runs[to..].copy_from_slice(&other_level.runs[from..]);
            level.values[to * channels..].copy_from_slice(&other_level.values[from * channels..]);
        }
    }

    /// The values of a node, whose index is negative within the history.
    pub fn value(&self, level: usize, node: isize) -> &[f32] {
        let k = (node + self.history as isize) as usize * self.channels;
        &self.levels[level].values[k..k + self.channels]
    }

    /// The source of a node; [`NONE`] before the first root.
    pub fn pick(&self, level: usize, node: isize) -> u32 {
        let k = node + self.history as isize;
        if k < 0 { NONE } else { self.levels[level].picks[k as usize] }
    }

    /// The root of the model that a leaf was copied from; `None` before the first root. The nodes above the leaf may be copied from others.
    pub fn root_of_leaf(&self, leaf: isize) -> Option<u32> {
        let finest = self.levels.len().saturating_sub(1);
        Some(self.pick(finest, leaf)).filter(|leaf| *leaf != NONE).map(|leaf| leaf >> finest)
    }

    /// The length of the stretch that a node ends, in nodes.
    pub fn run(&self, level: usize, node: isize) -> u32 {
        self.levels[level].runs[(node + self.history as isize) as usize]
    }

    /// Sets a node. `goes_on` is true if the one before it has the node before it in the same recording.
    pub fn set(&mut self, level: usize, node: usize, values: &[f32], pick: u32, goes_on: bool) {
        let k = node + self.history;
        let run = if goes_on { self.levels[level].runs[k - 1].saturating_add(1) } else { 1 };
        let level = &mut self.levels[level];
        level.values[k * self.channels..(k + 1) * self.channels].copy_from_slice(values);
        level.picks[k] = pick;
        level.runs[k] = run;
    }

    /// The values of the nodes of the current root.
    pub fn current(&self, level: usize) -> &[f32] {
        &self.levels[level].values[self.history * self.channels..]
    }
}
