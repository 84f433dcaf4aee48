//! Answers of the language server about a graph of 2,000 nodes in 125 sections of sixteen, each mixed to one: the time after a key press until
//! its findings, completion and other answers are there.
//!
//! `cargo bench -p foley -- lsp`

use foley::graph::LoadOptions;
use foley::lsp::{Connection, serve};
use lsp_server::{Message, Notification, Request, RequestId};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::time::Instant;

const URI: &str = "file:///bench/large.ron";
/// Number of sections of 16 nodes.
const SECTIONS: usize = 125;
/// Number of key presses.
const PRESSES: usize = 50;

fn text() -> String {
    let mut text =
        String::from("#![schema = \"foley:graph/1\"]\nGraph(\n    params: {\"level\": 0.1},\n    nodes: {\n");
    for section in 0..SECTIONS {
        let _ = writeln!(text, "        // Section {section}.");
        let _ = writeln!(
            text,
            "        \"noise{section}\": Noise(colour: Pink, level: \"$level\", duration: Some(1.0)),"
        );
        for k in 0..13 {
            let from = if k == 0 { format!("noise{section}") } else { format!("gain{section}_{}", k - 1) };
            let _ = writeln!(text, "        \"gain{section}_{k}\": Gain(audio: \"{from}\", gain: 0.9),");
        }
        let _ = writeln!(
            text,
            "        \"mix{section}\": Mix(inputs: [\"gain{section}_12\", \"noise{section}\"]),"
        );
        let _ = writeln!(
            text,
            "        \"out{section}\": WavOut(audio: \"mix{section}\", path: \"{section}.wav\"),"
        );
    }
    text + "    },\n)\n"
}

struct Client {
    connection: Connection,
    next: i32,
    version: i32,
}

impl Client {
    fn notify(&self, method: &str, params: Value) {
        let message = Notification::new(method.to_owned(), params);
        self.connection.sender.send(message.into()).expect("the server runs");
    }

    fn request(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let id = RequestId::from(self.next);
        let message = Request::new(id.clone(), method.to_owned(), params);
        self.connection.sender.send(message.into()).expect("the server runs");
        loop {
            match self.connection.receiver.recv().expect("the server runs") {
                Message::Response(answer) if answer.id == id => {
                    return serde_json::to_value(&answer).expect("an answer is JSON")["result"].clone();
                }
                _ => {}
            }
        }
    }

    /// Waits for the findings of the newest text.
    fn findings(&self) -> usize {
        loop {
            if let Message::Notification(found) = self.connection.receiver.recv().expect("the server runs")
                && found.params["version"] == self.version
            {
                return found.params["diagnostics"].as_array().map_or(0, Vec::len);
            }
        }
    }
}

/// Median and largest of some times, ms.
fn row(what: &str, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    let (median, worst) = (times[times.len() / 2], times[times.len() - 1]);
    println!("{what:<44} median {median:7.2} ms, worst {worst:7.2} ms");
}

pub fn bench() {
    let (client, server) = Connection::memory();
    let thread = std::thread::spawn(move || serve(&server, &LoadOptions::default()));
    let mut client = Client { connection: client, next: 0, version: 1 };
    client.request("initialize", json!({"capabilities": {}}));
    client.notify("initialized", json!({}));
    let text = text();
    let document = json!({"uri": URI, "languageId": "ron", "version": 1, "text": text});
    let start = Instant::now();
    client.notify("textDocument/didOpen", json!({"textDocument": document}));
    let found = client.findings();
    println!(
        "{} nodes, {} bytes, {found} finding(s) after {:.1} ms",
        SECTIONS * 16,
        text.len(),
        start.elapsed().as_secs_f64() * 1e3
    );
    // A letter is typed into a link in the middle of the text, and deleted again.
    let before = &text[..text.find("\"gain60_5\": Gain(audio: \"gain60_4").expect("the node is there")];
    let line = before.matches('\n').count();
    let at = json!({"line": line, "character": 40});
    let after = json!({"line": line, "character": 41});
    let place = json!({"textDocument": {"uri": URI}, "position": at});
    let whole = json!({"start": {"line": 0, "character": 0}, "end": {"line": 4000, "character": 0}});
    let screen =
        json!({"start": {"line": line - 30, "character": 0}, "end": {"line": line + 30, "character": 0}});
    let requests = [
        ("completion of a link", "textDocument/completion", place.clone()),
        ("hover", "textDocument/hover", place.clone()),
        ("definition", "textDocument/definition", place.clone()),
        ("semantic tokens of all", "textDocument/semanticTokens/full", place.clone()),
        (
            "semantic tokens of 60 lines",
            "textDocument/semanticTokens/range",
            json!({"textDocument": {"uri": URI}, "range": screen}),
        ),
        (
            "hints of 60 lines",
            "textDocument/inlayHint",
            json!({"textDocument": {"uri": URI}, "range": screen}),
        ),
        ("hints of all", "textDocument/inlayHint", json!({"textDocument": {"uri": URI}, "range": whole})),
        ("symbols", "textDocument/documentSymbol", place.clone()),
        ("folding", "textDocument/foldingRange", place.clone()),
    ];
    let mut press = |range: Value, letter: &str, method: Option<(&str, &Value)>| {
        client.version += 1;
        let start = Instant::now();
        let document = json!({"uri": URI, "version": client.version});
        let change = json!({"range": range, "text": letter});
        client
            .notify("textDocument/didChange", json!({"textDocument": document, "contentChanges": [change]}));
        match method {
            Some((method, params)) => drop(client.request(method, params.clone())),
            None => drop(client.findings()),
        }
        start.elapsed().as_secs_f64() * 1e3
    };
    let (insert, delete) = (json!({"start": at, "end": at}), json!({"start": at, "end": after}));
    let mut both = |method: Option<(&str, &Value)>| -> Vec<f64> {
        let mut times = Vec::new();
        for _ in 0..PRESSES {
            times.push(press(insert.clone(), "1", method));
            times.push(press(delete.clone(), "", method));
        }
        times
    };
    row("key press to findings", both(None));
    for (what, method, params) in &requests {
        row(&format!("key press to {what}"), both(Some((method, params))));
    }
    client.request("shutdown", Value::Null);
    client.notify("exit", Value::Null);
    drop(client);
    let _ = thread.join();
}
