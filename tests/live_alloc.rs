//! The audio callback neither allocates nor frees, also while graphs are swapped, and edits leave no memory behind.
//!
//! The counting allocator is the one unsafe thing here, so this test is a binary of its own.
#![allow(unsafe_code)]

mod common;

use common::counter::Counter;
use foley::Registry;
use foley::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley::live::{Callback, LiveGraph, Options, Player, PlayerEvent};
use foley_nodes::core::input::NoInputs;
use foley_nodes::core::random::Rng;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<i64> = const { Cell::new(0) };
}

struct Counting;

fn count(bytes: i64) {
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
    let _ = BYTES.try_with(|all| all.set(all.get() + bytes));
}

// SAFETY: every call goes to the system's allocator unchanged; the counters are plain cells of this thread.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller fulfils the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as i64));
        // SAFETY: the caller fulfils the contract of `dealloc`.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as i64 - layout.size() as i64);
        // SAFETY: the caller fulfils the contract of `realloc`.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn material(text: &str) -> LiveGraph {
    let path = common::graphs().join("basics/test.ron");
    let registry = Arc::new(Registry::standard().with::<Counter>());
    let loaded = load_text("test", text, &path, &LoadOptions::default().registry(registry));
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}\n{text}"));
    let files = DirFiles::new(loaded.root, Limits::default());
    LiveGraph { seed: graph.seed, graph, files, memo: None, inputs: Arc::new(NoInputs) }
}

/// Edits of every kind: numbers, added and removed nodes, other links, look-ahead, a loop, a file, modes.
fn version(draw: &mut Rng) -> String {
    let gain = draw.between(0.1, 0.9);
    let tone = 100 + draw.below(3) * 50;
    let mut nodes = format!(
        "\"a\": Tone(frequency: {tone}.0, rate: 44100, level: 0.2), \
         \"n\": Noise(rate: 44100, level: 0.05), \
         \"g\": Gain(audio: \"a\", gain: {gain:.3}), "
    );
    let mut ends = vec!["g".to_owned(), "n".to_owned()];
    if draw.below(2) == 0 {
        nodes += "\"ahead\": Advance(audio: \"n\", seconds: 0.01), ";
        ends.push("ahead".into());
    }
    if draw.below(2) == 0 {
        nodes += &format!("\"late\": Delay(audio: \"g\", seconds: {:.3}), ", draw.between(0.0, 0.05));
        ends.push("late".into());
    }
    if draw.below(2) == 0 {
        nodes +=
            "\"clicks\": Metronome(interval: 0.05), \"blips\": Impulses(events: \"clicks\", rate: 44100), ";
        ends.push("blips".into());
    }
    if draw.below(3) == 0 {
        nodes += "\"back\": Feedback(audio: \"mix\", like: \"g\", delay: 0.05, gain: 0.3), ";
        ends.push("back".into());
    }
    if draw.below(3) == 0 {
        nodes += "\"file\": WavIn(path: \"../assets/recordings/clothing_rustle_1.flac\"), \
                  \"mono\": Mono(audio: \"file\"), ";
        ends.push("mono".into());
    }
    let list: Vec<String> = ends.iter().map(|e| format!("\"{e}\"")).collect();
    format!(
        "#![schema = \"foley:graph/1\"]\nGraph(seed: 5, nodes: {{ {nodes} \"mix\": Mix(inputs: [{}]), \
         \"out\": WavOut(audio: \"mix\", path: \"o.wav\") }})",
        list.join(", ")
    )
}

struct Stand {
    player: Player,
    callback: Callback,
    block: Vec<f32>,
    /// Calls of the allocator in the callback.
    calls: u64,
    blocks: u64,
    /// Nodes whose reason for giving nothing the player has reported.
    silent: Vec<String>,
}

impl Stand {
    fn new(text: &str) -> Self {
        let options = Options { threads: 0, metered: true, ahead: 0.02, ..Options::default() };
        let (player, callback) = Player::start(material(text), options).unwrap();
        let block = vec![0.0; 128 * callback.channels()];
        Self { player, callback, block, calls: 0, blocks: 0, silent: Vec::new() }
    }

    fn play(&mut self, blocks: usize) {
        for _ in 0..blocks {
            self.player.pump();
            self.fill();
        }
    }

    /// Plays blocks without the workers.
    fn starve(&mut self, blocks: usize) {
        (0..blocks).for_each(|_| self.fill());
    }

    fn fill(&mut self) {
        let before = CALLS.get();
        self.callback.fill(&mut self.block);
        self.calls += CALLS.get() - before;
        self.blocks += 1;
        for reported in self.player.tick() {
            assert!(!matches!(reported, PlayerEvent::Failed(_)), "{reported:?}");
            if let PlayerEvent::Silent(notes) = reported {
                self.silent.extend(notes.into_iter().map(|(node, _)| node));
            }
        }
    }

    fn edit(&mut self, text: &str) {
        while self.player.is_busy() {
            self.play(1);
        }
        self.player.load(material(text)).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
    }
}

#[test]
fn ten_thousand_blocks_with_two_hundred_edits_never_call_the_allocator() {
    let mut draw = Rng::new(1);
    let mut stand = Stand::new(&version(&mut draw));
    while stand.blocks < 10_000 {
        stand.edit(&version(&mut draw));
        stand.play(50);
    }
    assert!(stand.blocks >= 10_000);
    assert_eq!(stand.calls, 0, "calls of the allocator in {} blocks", stand.blocks);
    assert_eq!(stand.player.shared().meter.missed.load(Relaxed), 0);
    assert_eq!(stand.player.shared().meter.not_finite.load(Relaxed), 0);
}

#[test]
fn to_find_out_why_nothing_is_heard_never_calls_the_allocator() {
    let mut stand = Stand::new(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"beats\": Metronome(interval: 0.1),
        \"clicks\": Impulses(events: \"beats\", rate: 44100),
        \"muted\": Gain(audio: \"clicks\", gain: 0.0),
        \"out\": WavOut(audio: \"muted\", path: \"o.wav\") })",
    );
    // Seven seconds: no message reaches the nodes, so that they have five.
    stand.play(2400);
    assert!(stand.silent.iter().any(|node| node == "muted"), "{:?}", stand.silent);
    assert_eq!(stand.calls, 0);
}

#[test]
fn late_events_never_call_the_allocator() {
    let mut stand = Stand::new(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"beats\": Metronome(interval: 0.001),
        \"counted\": Counter(beats: \"beats\"),
        \"clicks\": Impulses(events: \"counted\", rate: 44100),
        \"out\": WavOut(audio: \"clicks\", path: \"o.wav\") })",
    );
    for missed in [50, 1000] {
        stand.play(10);
        stand.starve(missed);
    }
    stand.play(10);
    let meter = &stand.player.shared().meter;
    assert!(meter.missed.load(Relaxed) > 1000 && meter.lost_events.load(Relaxed) > 0);
    assert_eq!(stand.calls, 0);
}

#[test]
fn a_thousand_edits_leave_no_memory_behind() {
    let mut draw = Rng::new(2);
    let versions: Vec<String> = (0..10).map(|_| version(&mut draw)).collect();
    let mut stand = Stand::new(&versions[0]);
    let mut after = Vec::new();
    for edit in 0..1000 {
        stand.edit(&versions[(edit * 7) % versions.len()]);
        if edit % 250 == 249 {
            stand.edit(&versions[0]);
            while stand.player.is_busy() {
                stand.play(1);
            }
            stand.play(10);
            after.push(BYTES.get());
        }
    }
    let (first, last) = (after[0], after[after.len() - 1]);
    assert!(last < first + first / 20, "bytes after each 250 edits: {after:?}");
    assert_eq!(stand.calls, 0);
}
