//! Parameters of a search for correspondences, and known causes of a sound.

/// Parameters of the search for proposals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuggestParams {
    /// Units in a window, the length of a proposal.
    pub window: usize,
    /// Units from window to window.
    pub hop: usize,
    /// Maximum number of proposals.
    pub count: usize,
    /// lambda of the warp that scores them.
    pub lambda: f64,
    /// Maximum number of windows of either side in the alignment; more are clustered.
    pub most: usize,
    /// Weight of the first feature, which is loudness, relative to each of the others in the comparison of ranks.
    pub level: f64,
    /// True to list all `count` proposals, also those of little gain: more of them follow the loudness better.
    pub all: bool,
    /// Thresholds of silence, if they are known; otherwise the quietest moment of the target counts as silence.
    pub silence: Option<Silence>,
}

/// Thresholds of silence, of the first feature (loudness).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Silence {
    /// Maximum mean of a silent window of the target.
    pub target: f64,
    /// Minimum difference of a silent window of the database from the loudest one.
    pub below: f64,
    /// Maximum difference of a silent window of the database from the quietest one.
    pub within: f64,
}

impl Default for SuggestParams {
    fn default() -> Self {
        Self {
            window: 24,
            hop: 12,
            count: 12,
            lambda: 1e3,
            most: 2000,
            level: 1.0,
            all: false,
            silence: None,
        }
    }
}

/// Power of one cause of the target's sound, known if the target is synthetic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cause {
    /// Its power in each unit of the target.
    pub power: Vec<f64>,
    /// For each segment of the database, true if it comes from this cause alone; `None` if it is unknown.
    pub segments: Vec<Option<bool>>,
}
