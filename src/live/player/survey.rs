//! Finds out why nothing is heard while a graph plays, and the levels of its nodes.

use super::{Player, PlayerEvent};
use crate::live::playback::callback::{Command, RegionSurvey};
use crate::plan::Runnable;
use crate::run::{NodeReport, Period, explain_silence, reads_messages};
use foley_nodes::core::silence::Silence;
use foley_nodes::core::stage::Survey;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Duration of silence after which the activity of nodes is recorded, and duration of the recording, s.
const HALF: f64 = 0.5;

/// Duration of silence after which nodes that no message reaches are reported, s: what files hold for them may come later.
const PATIENCE: f64 = 5.0;

/// Interval between two measurements of the levels of all nodes, and the time that one takes.
const LEVELS: Duration = Duration::from_millis(800);
const MEASURED: Duration = Duration::from_millis(200);

/// Surveys of the nodes while nothing is heard: the first begins to record their activity, and the others return it.
#[derive(Default)]
pub struct Surveys {
    /// Number of the graph that plays.
    graph: u64,
    /// The window of the last request; `None` while sound is heard.
    requested: Option<u64>,
    /// Number of requests since sound was heard.
    requests: u64,
    /// Answers to the last request.
    answers: Vec<RegionSurvey>,
    levels: NodeLevels,
}

/// Measurements of the levels of all nodes, one after the other.
#[derive(Default)]
struct NodeLevels {
    /// Start of the present step; `None` if levels are not wanted.
    since: Option<Instant>,
    step: LevelStep,
    answers: Vec<RegionSurvey>,
    /// Peaks of the last measurement that have not been taken.
    last: Option<BTreeMap<String, f32>>,
}

#[derive(Clone, Copy, Default, PartialEq)]
enum LevelStep {
    #[default]
    Waiting,
    Measuring,
    Asked,
}

impl Surveys {
    /// Discards the surveys of the graph before.
    pub fn begin_again(&mut self) {
        let levels = NodeLevels { since: self.levels.since, ..NodeLevels::default() };
        *self = Self { graph: self.graph + 1, levels, ..Self::default() };
    }

    /// Adds an answer.
    pub fn add(&mut self, answer: RegionSurvey) {
        if answer.graph != self.graph {
            return;
        }
        if answer.survey.is_of_levels() {
            self.levels.answers.push(answer);
        } else if self.requested.is_some() {
            self.answers.push(answer);
        }
    }
}

impl Player {
    /// Surveys the nodes during silence, and reports nodes that are silent although input arrives.
    pub(super) fn watch_silence(&mut self) {
        let windows = |seconds: f64| {
            (seconds * self.timing.rate.as_f64() / self.timing.quantum.max(1) as f64).ceil() as u64
        };
        let window = self.shared.window.load(Relaxed);
        let heard = self.shared.meter.last_sound.load(Relaxed);
        // What comes in is heard after the latency.
        let latency = foley_nodes::core::time::seconds(self.playing.plan.latency);
        let quiet = window >= heard + windows(HALF) && window >= windows(HALF + latency);
        if self.is_busy() || self.failed {
            return;
        }
        let Some(requested) = self.surveys.requested else {
            if quiet {
                self.request_survey(true);
            }
            return;
        };
        if !quiet {
            self.request_survey(false);
            self.surveys.begin_again();
            return;
        }
        if self.surveys.answers.len() == self.playing.plan.regions.len() {
            let answers = std::mem::take(&mut self.surveys.answers);
            // The first request begins to record.
            let mut notes = if self.surveys.requests > 1 { self.silent_nodes(&answers) } else { Vec::new() };
            if window < heard + windows(PATIENCE)
                && let Some(graph) = self.graph()
            {
                notes.retain(|(node, _)| reads_messages(graph, node));
            }
            if !notes.is_empty() {
                self.events.push(PlayerEvent::Silent(notes));
            }
        }
        if window >= requested + windows(HALF + latency) {
            self.request_survey(true);
        }
    }

    /// Requests the activity of the nodes of all regions, and sets if it is recorded from now on.
    fn request_survey(&mut self, record: bool) {
        self.surveys.answers.clear();
        self.surveys.requests += 1;
        self.surveys.requested = Some(self.shared.window.load(Relaxed));
        self.send_surveys(|nodes| Survey::new(nodes, record));
    }

    /// Sends a survey to each region, made for its number of nodes.
    fn send_surveys(&mut self, survey: impl Fn(usize) -> Survey) {
        let graph = self.surveys.graph;
        let regions = &self.playing.plan.regions;
        let last = regions.len() - 1;
        for (number, region) in regions.iter().enumerate() {
            let survey = survey(region.nodes.len());
            if number == last {
                let survey = Box::new(RegionSurvey { graph, region: None, survey });
                let _ = self.commands.push(Command::Survey(survey));
            } else {
                let survey = Box::new(RegionSurvey { graph, region: Some(number), survey });
                self.workers.survey(number, survey);
            }
        }
    }

    /// Measures the levels of all nodes from now on, in a fifth of each second.
    pub fn measure_levels(&mut self) {
        self.surveys.levels.since = Some(Instant::now());
    }

    /// The largest magnitudes in the audio of each node in the last measurement, by the id of the node; `None` until the next is there.
    pub fn take_levels(&mut self) -> Option<BTreeMap<String, f32>> {
        self.surveys.levels.last.take()
    }

    /// Takes the next step of a measurement of levels.
    pub(super) fn watch_levels(&mut self) {
        while let Some(answer) = self.workers.take_survey() {
            self.surveys.add(*answer);
        }
        let NodeLevels { since, step, answers, .. } = &mut self.surveys.levels;
        let Some(passed) = since.map(|since| since.elapsed()).filter(|_| !self.failed) else { return };
        let (next, record) = match *step {
            LevelStep::Waiting if passed >= LEVELS => (LevelStep::Measuring, true),
            LevelStep::Measuring if passed >= MEASURED => (LevelStep::Asked, false),
            LevelStep::Asked if answers.len() >= self.playing.plan.regions.len() || passed >= LEVELS => {
                let answers = std::mem::take(answers);
                let (last, since) = (self.levels_of(&answers), Some(Instant::now()));
                self.surveys.levels = NodeLevels { last, since, ..NodeLevels::default() };
                return;
            }
            _ => return,
        };
        answers.clear();
        (*step, *since) = (next, Some(Instant::now()));
        self.send_surveys(|nodes| Survey::of_levels(nodes, record));
    }

    /// The peaks in answers of all regions; `None` if some are missing.
    fn levels_of(&self, answers: &[RegionSurvey]) -> Option<BTreeMap<String, f32>> {
        let graph = self.graph()?;
        let regions = &self.playing.plan.regions;
        let is_same = graph.nodes.iter().map(|node| &node.id).eq(&self.playing.ids);
        if !is_same || answers.len() != regions.len() {
            return None;
        }
        let mut peaks = BTreeMap::new();
        for answer in answers {
            let region = &regions[answer.region.unwrap_or(regions.len() - 1)];
            for (k, node) in region.nodes.iter().enumerate() {
                let Runnable::Node(n) = node.runnable else { continue };
                let node = &graph.nodes[n];
                let has_audio = node.ty.outputs.iter().any(|port| port.kind.name() == "audio");
                if let Some(peak) = answer.survey.peak(k).filter(|_| has_audio) {
                    peaks.insert(node.id.clone(), peak);
                }
            }
        }
        Some(peaks)
    }

    /// The nodes that give nothing although something comes in.
    fn silent_nodes(&self, answers: &[RegionSurvey]) -> Vec<(String, String)> {
        let Some(graph) = self.graph() else { return Vec::new() };
        if !graph.nodes.iter().map(|node| &node.id).eq(&self.playing.ids) {
            return Vec::new();
        }
        let mut reports: Vec<NodeReport> = graph.nodes.iter().map(|_| NodeReport::default()).collect();
        let regions = &self.playing.plan.regions;
        for answer in answers {
            let region = &regions[answer.region.unwrap_or(regions.len() - 1)];
            for (k, node) in region.nodes.iter().enumerate() {
                let Runnable::Node(n) = node.runnable else { continue };
                reports[n].activity = answer.survey.activity(k);
                match answer.survey.silence(k) {
                    None => {}
                    Some(Silence::Off) => drop(reports[n].summary.insert("off".to_owned(), true.into())),
                    Some(silence) => {
                        reports[n].summary.insert("silent".to_owned(), silence.to_string().into());
                    }
                }
            }
        }
        explain_silence(graph, &reports, &[], Period::Second)
    }
}
