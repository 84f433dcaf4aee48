//! Item 13: Nanoseconds per node and block of 64 samples: chains of 100 and 1000 nodes, and a fan-out of 1000.
//!
//! A chain is a source and gains; a fan-out is a source, 998 gains and their sum. The figure is the time of a window over all these nodes; nothing is
//! subtracted. The file at the end, without which nothing would run, is a region of its own, as in every run, and is not part of what is
//! timed. `chain.100.gain` is the cost of one more gain, as the bench `engine` states it: the chain less its source alone, over the gains.

use super::measure::{Item, Times};
use foley::graph::{Graph, LoadOptions, load_text};
use std::fmt::Write as _;
use std::path::Path;

const BLOCK: i64 = 64;
const UNIT: &str = "ns/node/block64";

fn graph(nodes: &str, last: &str) -> Graph {
    let text = format!(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {{
        \"source\": Tone(waveform: Square, rate: 48000),
        {nodes}
        \"out\": WavOut(audio: \"{last}\", path: \"unused.wav\", format: Float32),\n}})"
    );
    let loaded = load_text("peers.ron", &text, Path::new("peers.ron"), &LoadOptions::default());
    loaded.graph.unwrap_or_else(|| panic!("{:?}", loaded.diagnostics))
}

fn chain(gains: usize) -> Graph {
    let (mut text, mut last) = (String::new(), "source".to_owned());
    for k in 0..gains {
        let _ = writeln!(text, "\"g{k}\": Gain(audio: \"{last}\", gain: 0.9999),");
        last = format!("g{k}");
    }
    graph(&text, &last)
}

fn fan(gains: usize) -> Graph {
    let (mut text, mut inputs) = (String::new(), String::new());
    for k in 0..gains {
        let _ = writeln!(text, "\"g{k}\": Gain(audio: \"source\", gain: 0.9999),");
        let _ = write!(inputs, "\"g{k}\", ");
    }
    let _ = writeln!(text, "\"sum\": Mix(inputs: [{inputs}]),");
    graph(&text, "sum")
}

/// Times a number of blocks of a graph, and prints the number of its nodes.
fn times(item: Item, name: &str, graph: &Graph, blocks: usize) -> Times {
    crate::common::with_windows(graph, BLOCK, |step, nodes| {
        item.print(&format!("{name}.nodes"), nodes as f64, "nodes");
        Times::of(|| (0..blocks).for_each(|_| step()))
    })
}

pub fn bench(item: Item) {
    let figure = |name: &str, nodes: usize, blocks: usize, times: &Times| {
        item.print_times(name, UNIT, times, |seconds| 1e9 * seconds / (nodes * blocks) as f64);
    };
    for (nodes, blocks) in [(100, 10_000), (1000, 1000)] {
        let name = format!("chain.{nodes}");
        let all = times(item, &name, &chain(nodes - 1), blocks);
        figure(&name, nodes, blocks, &all);
        let alone = times(item, "source", &chain(0), 10_000);
        let [wall, cpu] = [0, 1].map(|k| {
            let per_block = all.medians()[k] / blocks as f64 - alone.medians()[k] / 10_000.0;
            1e9 * per_block / (nodes - 1) as f64
        });
        item.print(&format!("{name}.gain"), wall, UNIT);
        item.print(&format!("{name}.gain.cpu"), cpu, UNIT);
    }
    let (nodes, blocks) = (1000, 1000);
    let name = format!("fan.{nodes}");
    figure(&name, nodes, blocks, &times(item, &name, &fan(nodes - 2), blocks));
}
