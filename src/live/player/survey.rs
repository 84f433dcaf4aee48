//! Finds out why nothing is heard while a graph plays.

use super::{Player, PlayerEvent};
use crate::live::playback::callback::{Command, RegionSurvey};
use crate::plan::Runnable;
use crate::run::{NodeReport, Period, explain_silence, reads_messages};
use foley_nodes::core::silence::Silence;
use foley_nodes::core::stage::Survey;
use std::sync::atomic::Ordering::Relaxed;

/// Time of silence from which on the activity of nodes is recorded, and for which it is, s.
const HALF: f64 = 0.5;

/// Time of silence from which on nodes are reported that no message reaches, s: what files hold for them may come later.
const PATIENCE: f64 = 5.0;

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
}

impl Surveys {
    /// Forgets what is known of the graph before.
    pub fn begin_again(&mut self) {
        *self = Self { graph: self.graph + 1, ..Self::default() };
    }

    /// Adds an answer.
    pub fn add(&mut self, answer: RegionSurvey) {
        if answer.graph == self.graph && self.requested.is_some() {
            self.answers.push(answer);
        }
    }
}

impl Player {
    /// Surveys the nodes while nothing is heard, and reports what is silent although something comes in.
    pub(super) fn watch_silence(&mut self) {
        while let Some(answer) = self.workers.take_survey() {
            self.surveys.add(*answer);
        }
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

    /// Asks all regions what their nodes have done, and to record it from now on, or not.
    fn request_survey(&mut self, record: bool) {
        let graph = self.surveys.graph;
        self.surveys.answers.clear();
        self.surveys.requests += 1;
        self.surveys.requested = Some(self.shared.window.load(Relaxed));
        let regions = &self.playing.plan.regions;
        let last = regions.len() - 1;
        for (number, region) in regions.iter().enumerate() {
            let survey = Survey::new(region.nodes.len(), record);
            if number == last {
                let survey = Box::new(RegionSurvey { graph, region: None, survey });
                let _ = self.commands.push(Command::Survey(survey));
            } else {
                let survey = Box::new(RegionSurvey { graph, region: Some(number), survey });
                self.workers.survey(number, survey);
            }
        }
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
