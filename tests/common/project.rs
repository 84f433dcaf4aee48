//! A folder with a graph that is run again and again, with and without a memo.

use foley::diag::Diagnostic;
use foley::graph::{DirFiles, Graph, Limits, LoadOptions, load};
use foley::memo::{CachePolicy, Memo, Store, default_dir};
use foley::plan::{Plan, PlanOptions};
use foley::run::{DirOutputs, Job, Progress, Report, Tap, TapTarget, run};
use foley_nodes::core::ports::PortKind;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;

/// A recording is measured and played at a wanted level: a fold, and a phase that reads it.
pub const LEVEL: &str = "#![schema = \"foley:graph/1\"]
Graph(
    seed: 5,
    nodes: {
        \"noise\": Noise(colour: White, level: 0.1, rate: 8000, duration: Some(0.5)),
        \"soft\": Gain(audio: \"noise\", gain: 0.5),
        \"measured\": Loudness(audio: \"soft\"),
        \"loud\": Normalize(audio: \"soft\", level: \"measured\", peak_db: -6.0),
        \"out\": WavOut(audio: \"loud\", path: \"loud.wav\"),
    },
)
";

/// A friction model made of recordings, and a sound made of that.
pub const MODEL: &str = "#![schema = \"foley:graph/1\"]
Graph(
    seed: 5,
    nodes: {
        \"model\": FrictionModelFromClips(recordings: [\"a.wav\", \"b.wav\"], clip: 0.02, n_speed: 6),
        \"planes\": MeshGenerator(kind: Planes, speed: 0.4, duration: 0.4, size: [0.3, 0.3]),
        \"contacts\": ContactDetector(mesh: \"planes\", radius: 0.02),
        \"speed\": SlidingSpeed(contacts: \"contacts\", gate: Causal),
        \"sound\": IftNoise(speeds: \"speed\", model: \"model\", rate: 48000, level: 0.3),
        \"out\": WavOut(audio: \"sound\", path: \"sound.wav\"),
    },
)
";

/// Caches no streams, so that a test can examine values alone.
pub const NONE: CachePolicy = CachePolicy {
    seconds_per_byte: 1.0,
    min_seconds: f64::INFINITY,
    read_seconds_per_byte: 0.0,
    max_nodes: 0,
};

pub struct Project {
    pub dir: tempfile::TempDir,
    pub cap: u64,
    pub policy: CachePolicy,
    pub threads: usize,
}

impl Project {
    pub fn new(text: &str) -> Self {
        let project = Self { dir: tempfile::tempdir().unwrap(), cap: 1 << 30, policy: NONE, threads: 1 };
        project.edit(text);
        if text == MODEL {
            project.record("a.wav", 3);
            project.record("b.wav", 4);
        }
        project
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn edit(&self, text: &str) {
        fs::write(self.path("graph.ron"), text).unwrap();
    }

    /// Makes a recording: noise that swells.
    pub fn record(&self, name: &str, seed: u64) {
        let text = format!(
            "#![schema = \"foley:graph/1\"]
            Graph(seed: {seed}, nodes: {{
                \"n\": Noise(colour: White, level: 0.2, rate: 48000, duration: Some(0.5)),
                \"f\": Fade(audio: \"n\", fade_in: 0.5, fade_out: 0.0),
                \"out\": WavOut(audio: \"f\", path: \"{name}\"),
            }})"
        );
        super::run_text(&text, &PlanOptions::default(), self.dir.path()).unwrap();
    }

    pub fn run(&self) -> Report {
        self.run_with(true, &PlanOptions::default(), None)
    }

    pub fn run_with(&self, with_cache: bool, options: &PlanOptions, tap: Option<&str>) -> Report {
        let memo = with_cache.then(|| self.memo());
        self.run_over(memo.as_ref(), options, tap)
    }

    pub fn memo(&self) -> Memo {
        let path = self.path("graph.ron");
        Memo::new(default_dir(&path), self.cap, &path).with_policy(self.policy)
    }
    pub fn run_over(&self, memo: Option<&Memo>, options: &PlanOptions, tap: Option<&str>) -> Report {
        self.try_over(memo, options, tap).unwrap()
    }

    /// A run that may fail.
    pub fn try_run(&self) -> Result<Report, Vec<Diagnostic>> {
        self.try_over(Some(&self.memo()), &PlanOptions::default(), None)
    }

    fn try_over(
        &self,
        memo: Option<&Memo>,
        options: &PlanOptions,
        tap: Option<&str>,
    ) -> Result<Report, Vec<Diagnostic>> {
        let path = self.path("graph.ron");
        let loaded = load(&path, &LoadOptions::default());
        let graph = loaded.graph.expect("the graph is right");
        let files = DirFiles::new(loaded.root, Limits::default());
        let taps: Vec<Tap> = tap
            .iter()
            .map(|id| Tap {
                node: graph.find(id).unwrap(),
                port: 0,
                target: TapTarget::File(self.path(tap_name(&graph, id))),
            })
            .collect();
        let options = PlanOptions {
            taps: taps.iter().map(|t| (t.node, t.port)).collect(),
            threads: self.threads,
            ..options.clone()
        };
        let plan = Plan::new(&graph, &files, &options).unwrap();
        let outputs = DirOutputs::new(self.path("out"));
        let job = Job {
            graph: &graph,
            plan: &plan,
            files: &files,
            outputs: &outputs,
            taps: &taps,
            threads: self.threads,
            seed: graph.seed,
            memo,
            progress: Arc::new(Progress::default()),
        };
        run(&job)
    }

    pub fn store(&self) -> Store {
        Store::new(default_dir(&self.path("graph.ron")), self.cap)
    }

    pub fn entries(&self) -> Vec<PathBuf> {
        self.store().list().into_iter().map(|l| l.path).collect()
    }

    pub fn out(&self, name: &str) -> Vec<u8> {
        fs::read(self.path("out").join(name)).unwrap()
    }
}

pub fn cached(report: &Report, id: &str) -> bool {
    report.nodes.iter().find(|n| n.id == id).unwrap().cached
}

pub fn calls(report: &Report, id: &str) -> u64 {
    report.nodes.iter().find(|n| n.id == id).unwrap().calls
}

pub fn warned(report: &Report, text: &str) -> bool {
    report.notes.iter().any(|(_, note)| note.contains(text))
}

/// The file of a tap of the first output of a node.
fn tap_name(graph: &Graph, id: &str) -> &'static str {
    let node = &graph.nodes[graph.find(id).unwrap()];
    match node.ty.outputs[0].kind {
        PortKind::Stream(_) => "tap.npy",
        PortKind::Events(_) => "tap.jsonl",
        PortKind::Value(_) | PortKind::Fold(_) => "tap.json",
    }
}

/// Runs the command in the folder of a project; returns the text of both outputs.
pub fn foley(project: &Project, args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_foley"))
        .args(args)
        .current_dir(project.dir.path())
        .env("NO_COLOR", "1")
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}
