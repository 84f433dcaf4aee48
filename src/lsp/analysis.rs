//! Diagnostics of a graph and formats of its links, computed on a thread of its own for the newest text.

use crate::diag::{Diagnostic, Sources};
use crate::graph::{LoadOptions, Texts};
use crate::session::{Errors, Inspection, Session};
use crossbeam_channel::{Receiver, Sender, unbounded};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::time::seconds;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

/// A graph to be inspected.
#[derive(Debug)]
pub struct Request {
    /// Its path.
    pub path: PathBuf,
    /// Version of its text.
    pub version: i32,
    /// The texts of the open files, its own among them.
    pub texts: Arc<Texts>,
}

/// Results of the analysis of a graph.
#[derive(Debug)]
pub struct Analysis {
    /// Its path.
    pub path: PathBuf,
    /// Version of the text that was inspected.
    pub version: i32,
    /// Errors and warnings, with the texts that they point into.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts.
    pub sources: Sources,
    /// Notes of nodes: the id of each, and a text.
    pub notes: Vec<(String, String)>,
    /// Facts about the valid nodes, by id.
    pub nodes: HashMap<String, NodeFacts>,
    /// The files that the graph asked for.
    pub asked: Vec<PathBuf>,
}

/// Facts about a node that are known without running it.
#[derive(Clone, Debug)]
pub struct NodeFacts {
    /// Its type.
    pub ty: Arc<NodeType>,
    /// Rate and format of each output that is a stream, such as `48000 Hz, stereo`.
    pub outputs: Vec<Option<StreamFacts>>,
    /// Its latency when the graph plays, s; `None` if the graph cannot run.
    pub latency: Option<f64>,
    /// Its end, s; `None` for a node without end.
    pub end: Option<f64>,
}

/// Rate and format of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamFacts {
    /// Items a second, such as `48000 Hz`.
    pub rate: String,
    /// The format, such as `stereo`.
    pub format: String,
}

impl Analysis {
    /// Inspects a graph.
    fn of(request: Request, options: &LoadOptions) -> Self {
        let Request { path, version, texts } = request;
        let mut options = options.clone();
        options.texts = Some(texts);
        let Inspection { errors, graph, shapes, latencies, asked } =
            Session::from_file(&path).with_load_options(options).inspect();
        let Errors { diagnostics, notes, sources } = errors;
        let nodes = graph.nodes.into_iter().enumerate().map(|(n, node)| {
            let shape = shapes.get(n);
            let outputs = shape.map(|shape| shape.outputs.iter());
            let stream = |shape: &foley_nodes::core::item::StreamShape| StreamFacts {
                rate: shape.rate.to_string(),
                format: shape.text.clone(),
            };
            let facts = NodeFacts {
                outputs: outputs.into_iter().flatten().map(|shape| shape.as_ref().map(stream)).collect(),
                latency: latencies.get(n).map(|latency| seconds(*latency)),
                end: shape.and_then(|shape| shape.end).map(seconds),
                ty: node.ty,
            };
            (node.id, facts)
        });
        let nodes = nodes.collect();
        let asked = asked.files.into_keys().collect();
        Self { path, version, diagnostics, sources, notes, nodes, asked }
    }
}

/// The thread that inspects graphs.
#[derive(Debug)]
pub struct Analyst {
    requests: Option<Sender<Request>>,
    /// Results, in the order of the requests; a request whose graph was requested again meanwhile has none.
    pub results: Receiver<Analysis>,
    thread: Option<JoinHandle<()>>,
}

impl Analyst {
    /// Starts the thread.
    ///
    /// # Errors
    /// When the system refuses a thread.
    pub fn start(options: LoadOptions) -> std::io::Result<Self> {
        let (requests, incoming) = unbounded();
        let (outgoing, results) = unbounded();
        let work = move || work(&incoming, &outgoing, &options);
        let thread = thread::Builder::new().name("foley-lsp-analysis".into()).spawn(work)?;
        Ok(Self { requests: Some(requests), results, thread: Some(thread) })
    }

    /// Requests the inspection of a graph.
    pub fn request(&self, request: Request) {
        if let Some(requests) = &self.requests {
            let _ = requests.send(request);
        }
    }
}

impl Drop for Analyst {
    fn drop(&mut self) {
        self.requests = None;
        // The thread ends with the first result that nobody takes.
        self.results = crossbeam_channel::never();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn work(requests: &Receiver<Request>, results: &Sender<Analysis>, options: &LoadOptions) {
    let mut waiting: Vec<Request> = Vec::new();
    loop {
        if waiting.is_empty() {
            let Ok(request) = requests.recv() else { return };
            waiting.push(request);
        }
        // Of several texts of one graph only the last is of use.
        for request in requests.try_iter() {
            waiting.retain(|older| older.path != request.path);
            waiting.push(request);
        }
        let request = waiting.remove(0);
        // A defect in a node must not end the findings of all graphs.
        let analysis = catch_unwind(AssertUnwindSafe(|| Analysis::of(request, options)));
        if analysis.is_ok_and(|analysis| results.send(analysis).is_err()) {
            return;
        }
    }
}
