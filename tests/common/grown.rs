//! Graphs made at random.

use foley_nodes::core::random::Rng;
use std::fmt::Write as _;

/// A graph text and the taps to write beside its files.
pub type Grown = (String, Vec<String>);

/// An audio stream of a graph that grows.
#[derive(Clone)]
struct Audio {
    id: String,
    rate: usize,
    channels: usize,
}

/// A graph that grows, with the nodes that can be linked to.
struct Plant {
    draw: Rng,
    nodes: String,
    taps: Vec<String>,
    audio: Vec<Audio>,
    meshes: Vec<String>,
    curvatures: Vec<String>,
    poses: Vec<String>,
}

/// Rates of sound, low to high: those of 44.1 kHz and of 48 kHz have long common periods.
const RATES: [usize; 7] = [8000, 11_025, 16_000, 22_050, 44_100, 48_000, 96_000];
/// Rates of frames.
const FRAMES: [&str; 6] = ["24", "\"24000/1001\"", "\"30000/1001\"", "60", "50", "120"];

/// A graph of audio alone: sources of several rates, look-ahead up to a second, delays, loops, rate changes, unequal ends.
pub fn audio_graph(seed: u64) -> Grown {
    let mut plant = Plant::sown(seed);
    for k in 0..3 + plant.draw.below(10) {
        plant.audio_node(&format!("n{k}"));
    }
    plant.harvest(seed)
}

/// A graph of all kinds of streams: meshes and poses at the rates of film, curvature and its events, features in units, triggers,
/// folds that need another phase, sound of one and two channels up to 96 kHz.
pub fn mixed_graph(seed: u64) -> Grown {
    let mut plant = Plant::sown(1000 + seed);
    plant.mesh();
    plant.orbit();
    plant.beats();
    for k in 0..6 + plant.draw.below(10) {
        let id = format!("n{k}");
        match plant.draw.below(9) {
            0 => plant.curvature(&id),
            1 => plant.pose(&id),
            2 | 3 => plant.placed(&id),
            4 => plant.levels(k, &id),
            5 => plant.features(k, &id),
            6 => plant.normalized(&id),
            _ => plant.audio_node(&id),
        }
    }
    plant.buckles();
    plant.harvest(seed)
}

impl Plant {
    /// Noise of one to three rates.
    fn sown(seed: u64) -> Self {
        let (draw, nodes) = (Rng::new(seed), String::new());
        let (taps, audio, meshes, curvatures, poses) = Default::default();
        let mut plant = Self { draw, nodes, taps, audio, meshes, curvatures, poses };
        for k in 0..1 + plant.draw.below(3) {
            let rate = RATES[plant.draw.below(RATES.len())];
            let duration = plant.draw.between(0.05, 0.6);
            let text = format!("Noise(rate: {rate}, duration: Some({duration:.4}), level: 0.2)");
            plant.sound(format!("s{k}"), rate, 1, &text);
        }
        plant
    }

    fn node(&mut self, id: &str, text: &str) {
        let _ = writeln!(self.nodes, "\"{id}\": {text},");
    }

    fn sound(&mut self, id: String, rate: usize, channels: usize, text: &str) {
        self.node(&id, text);
        self.audio.push(Audio { id, rate, channels });
    }

    fn any_audio(&mut self) -> Audio {
        self.audio[self.draw.below(self.audio.len())].clone()
    }

    fn any(&mut self, of: impl Fn(&Self) -> &Vec<String>) -> String {
        let count = of(self).len();
        let k = self.draw.below(count);
        of(self)[k].clone()
    }

    fn frames(&mut self) -> &'static str {
        FRAMES[self.draw.below(FRAMES.len())]
    }

    /// A node that is made of one sound, or of all that are compatible with it.
    fn audio_node(&mut self, id: &str) {
        let Audio { id: from, rate, channels } = self.any_audio();
        let (mut made, mut wide) = (rate, channels);
        let text = match self.draw.below(9) {
            0 => format!("Gain(audio: \"{from}\", gain: {:.3})", self.draw.between(-1.0, 1.0)),
            1 => format!("Delay(audio: \"{from}\", seconds: {:.5})", self.draw.between(0.0, 0.3)),
            2 => format!("Advance(audio: \"{from}\", seconds: {:.5})", self.draw.between(0.0, 1.0)),
            3 => format!("HighPass(audio: \"{from}\", cutoff: {:.1})", self.draw.between(30.0, 2000.0)),
            4 => {
                made = RATES[self.draw.below(RATES.len())];
                if made == rate {
                    format!("Gain(audio: \"{from}\", gain: 0.5)")
                } else {
                    format!("Resample(audio: \"{from}\", rate: {made})")
                }
            }
            5 => {
                // A loop: the input, mixed with its own past.
                let seconds = self.draw.between(0.003, 0.1);
                let back = format!(
                    "Feedback(audio: \"{id}\", like: \"{from}\", delay: {seconds:.4}, gain: 0.5, tail: 0.1)"
                );
                self.node(&format!("back_{id}"), &back);
                format!("Mix(inputs: [\"{from}\", \"back_{id}\"])")
            }
            6 if channels == 1 => {
                wide = 2;
                format!("Pan(audio: \"{from}\", position: {:.2})", self.draw.between(-1.0, 1.0))
            }
            6 => {
                wide = 1;
                format!("Mono(audio: \"{from}\")")
            }
            _ => {
                let same = self.audio.iter().filter(|a| (a.rate, a.channels) == (rate, channels));
                let same: Vec<String> = same.map(|a| format!("\"{}\"", a.id)).collect();
                format!("Mix(inputs: [{}])", same.join(", "))
            }
        };
        self.sound(id.to_owned(), made, wide, &text);
    }

    /// A sheet of 30 vertices with a wave in it.
    fn mesh(&mut self) {
        let (rate, duration) = (self.frames(), self.draw.between(0.2, 0.7));
        let text = format!(
            "MeshGenerator(kind: SineSheet, rate: {rate}, duration: {duration:.3}, vertices: (6, 5), amplitude: 0.05, frequency: 4.0)"
        );
        self.node("mesh", &text);
        self.meshes.push("mesh".into());
        self.node("bend", "MeanCurvature(mesh: \"mesh\")");
        self.curvatures.push("bend".into());
        self.taps.push("bend.curvature=0curvature.npy".into());
        self.node("vertex", "VertexPose(mesh: \"mesh\", origin: 3)");
        self.poses.push("vertex".into());
    }

    fn orbit(&mut self) {
        let (rate, duration) = (self.frames(), self.draw.between(0.1, 0.8));
        let text = format!("Orbit(rate: {rate}, frequency: 1.5, duration: Some({duration:.3}))");
        self.node("orbit", &text);
        self.poses.push("orbit".into());
    }

    fn beats(&mut self) {
        let (interval, duration) = (self.draw.between(0.002, 0.05), self.draw.between(0.2, 0.8));
        let rate = RATES[self.draw.below(RATES.len())];
        let text = format!("Metronome(interval: {interval:.5}, duration: Some({duration:.3}))");
        self.node("beats", &text);
        self.taps.push("beats.beats=0beats.jsonl".into());
        self.sound(
            "clicks".into(),
            rate,
            1,
            &format!("Impulses(events: \"beats\", rate: {rate}, decay: 0.01)"),
        );
    }

    fn curvature(&mut self, id: &str) {
        let mesh = self.any(|plant| &plant.meshes);
        let method = ["Cotan", "Dihedral"][self.draw.below(2)];
        self.node(id, &format!("MeanCurvature(mesh: \"{mesh}\", method: {method})"));
        self.curvatures.push(id.to_owned());
    }

    fn pose(&mut self, id: &str) {
        let mesh = self.any(|plant| &plant.meshes);
        let origin = self.draw.below(30);
        self.node(
            id,
            &format!("VertexPose(mesh: \"{mesh}\", origin: {origin}, front: Some(29), up: Some(5))"),
        );
        self.poses.push(id.to_owned());
    }

    /// A sound at a place that moves.
    fn placed(&mut self, id: &str) {
        let Audio { id: from, rate, channels } = self.any_audio();
        let pose = self.any(|plant| &plant.poses);
        if channels == 1 && self.draw.below(2) == 0 {
            let text =
                format!("StructuralHrtf(audio: \"{from}\", position: \"{pose}\", listener: (0.1, 0.2, 0.3))");
            self.sound(id.to_owned(), rate, 2, &text);
        } else {
            let delay = self.draw.below(2) == 0;
            let text = format!("DistanceGain(audio: \"{from}\", position: \"{pose}\", delay: {delay})");
            self.sound(id.to_owned(), rate, channels, &text);
        }
    }

    /// The level of a sound in each frame.
    fn levels(&mut self, k: usize, id: &str) {
        let (from, rate) = (self.any_audio().id, self.frames());
        self.node(id, &format!("LevelMeter(audio: \"{from}\", rate: {rate})"));
        self.taps.push(format!("{id}.levels={k}levels.csv"));
    }

    /// Vectors in units of a few milliseconds, smoothed with as much look-ahead.
    fn features(&mut self, k: usize, id: &str) {
        let from = self.any_audio().id;
        let unit = ["1/240", "1/100", "37 samples", "512 samples"][self.draw.below(4)];
        let causal = self.draw.below(2) == 0;
        self.node(&format!("raw_{id}"), &format!("Mfcc(audio: \"{from}\", unit: \"{unit}\", f_hi: 4000.0)"));
        self.node(id, &format!("TemporalGaussian(features: \"raw_{id}.features\", causal: {causal})"));
        self.taps.push(format!("{id}.smooth={k}features.npy"));
    }

    /// A sound by its own peak: a fold, and so a second phase.
    fn normalized(&mut self, id: &str) {
        let Audio { id: from, rate, channels } = self.any_audio();
        self.node(&format!("peak_{id}"), &format!("Loudness(audio: \"{from}\")"));
        self.sound(
            id.to_owned(),
            rate,
            channels,
            &format!("Normalize(audio: \"{from}\", level: \"peak_{id}\", peak_db: -6.0)"),
        );
    }

    /// Events of a cloth, with a dead band that a fold measures or that is constant.
    fn buckles(&mut self) {
        let curvature = self.any(|plant| &plant.curvatures);
        let band = if self.draw.below(2) == 0 {
            self.node("rest", &format!("RestNoise(curvature: \"{curvature}\", to: 0.05, factor: 0.01)"));
            "\"rest\"".to_owned()
        } else {
            "0.01".to_owned()
        };
        let merge = [0.0, 0.033, 0.1][self.draw.below(3)];
        self.node("buckles", &format!("BuckleDetector(curvature: \"{curvature}\", h_eps: {band})"));
        self.node("events", &format!("CrumpleEvents(buckles: \"buckles\", merge_window: {merge})"));
        self.taps.push("events.events=0events.jsonl".into());
    }

    /// Up to three of the last sounds are written.
    fn harvest(mut self, seed: u64) -> Grown {
        let last: Vec<Audio> = self.audio.iter().rev().take(1 + self.draw.below(3)).cloned().collect();
        for (k, Audio { id, .. }) in last.iter().enumerate() {
            self.node(
                &format!("out{k}"),
                &format!("WavOut(audio: \"{id}\", path: \"{k}out.wav\", format: Float32)"),
            );
        }
        let nodes = self.nodes;
        (format!("#![schema = \"foley:graph/1\"]\nGraph(seed: {seed}, nodes: {{\n{nodes}}})"), self.taps)
    }
}
