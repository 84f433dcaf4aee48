//! A graph that plays without a device: both sides, run by one thread.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley::live::{Callback, LiveGraph, Options, Player, Reloaded};
use foley::plan::PlanOptions;
use foley_nodes::core::input::NoInputs;
use foley_nodes::io::AudioReader;
use std::fs::File;

pub fn graph(nodes: &str) -> String {
    format!("#![schema = \"foley:graph/1\"]\nGraph(seed: 5, nodes: {{ {nodes} }})")
}

pub fn material(text: &str) -> LiveGraph {
    material_in("basics", text)
}

/// The graph of a text in a folder of the examples.
pub fn material_in(folder: &str, text: &str) -> LiveGraph {
    let path = common::graphs().join(folder).join("test.ron");
    let loaded = load_text("test", text, &path, &LoadOptions::default());
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}\n{text}"));
    let seed = graph.seed;
    LiveGraph {
        graph,
        files: DirFiles::new(loaded.root, Limits::default()),
        seed,
        memo: None,
        inputs: std::sync::Arc::new(NoInputs),
    }
}

/// Both sides, run by one thread.
pub struct Stand {
    pub player: Player,
    pub callback: Callback,
    pub heard: Vec<f32>,
}

impl Stand {
    pub fn new(text: &str, quantum: usize) -> Self {
        let options = Options { quantum, threads: 0, metered: true, ..Options::default() };
        let (player, callback) = match Player::start(material(text), options) {
            Ok(both) => both,
            Err(e) => panic!("{e:?}\n{text}"),
        };
        Self { player, callback, heard: Vec::new() }
    }

    /// Plays `frames` frames in blocks of `block`.
    pub fn play(&mut self, frames: usize, block: usize) {
        let mut out = vec![0.0; block * self.callback.channels()];
        let wanted = self.heard.len() + frames * self.callback.channels();
        while self.heard.len() < wanted {
            self.player.pump();
            let n = out.len().min(wanted - self.heard.len());
            self.callback.fill(&mut out[..n]);
            self.heard.extend_from_slice(&out[..n]);
            for reported in self.player.tick() {
                assert!(!matches!(reported, foley::live::PlayerEvent::Failed(_)), "{reported:?}");
            }
        }
    }

    pub fn load(&mut self, text: &str) -> Reloaded {
        while self.player.is_busy() {
            self.play(128, 128);
        }
        self.player.load(material(text)).unwrap_or_else(|e| panic!("{e:?}\n{text}"))
    }

    pub fn settle(&mut self) {
        while self.player.is_busy() {
            self.play(128, 128);
        }
    }
}

pub fn offline(text: &str, seconds: f64) -> Vec<f32> {
    let until = Some(foley_nodes::core::time::ticks(seconds));
    offline_with(text, &PlanOptions { until, ..PlanOptions::default() })
}

pub fn offline_with(text: &str, options: &PlanOptions) -> Vec<f32> {
    let dir = tempfile::tempdir().unwrap();
    let LiveGraph { graph, files, .. } = material(text);
    if let Err(e) = common::run_graph(&graph, &files, options, dir.path()) {
        panic!("{e}\n{text}");
    }
    let file = File::open(dir.path().join("o.wav")).unwrap();
    let mut reader = AudioReader::open(Box::new(std::io::BufReader::new(file))).unwrap();
    let mut samples = vec![0.0; reader.info().frames as usize * reader.info().channels];
    reader.read(&mut samples).unwrap();
    samples
}

pub const OUT: &str = "\"out\": WavOut(audio: \"last\", path: \"o.wav\", format: Float32)";
