//! An editor that talks to the language server in memory.

use foley::graph::LoadOptions;
use foley::lsp::{Connection, serve};
use lsp_server::{Message, Notification, Request, RequestId};
use lsp_types::Uri;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::thread::JoinHandle;
use std::time::Duration;

/// Time in which the server has to answer before a test gives up.
const PATIENCE: Duration = Duration::from_secs(60);

/// An editor with a folder of graphs.
pub struct Editor {
    connection: Option<Connection>,
    server: Option<JoinHandle<()>>,
    folder: tempfile::TempDir,
    next: i32,
    version: i32,
    /// Findings that were published: the address, the version and the findings.
    published: Vec<(String, i64, Value)>,
}

impl Editor {
    /// An editor over a new folder.
    pub fn new() -> Self {
        let (client, server) = Connection::memory();
        let serve = move || serve(&server, &LoadOptions::default()).unwrap();
        let server = Some(std::thread::spawn(serve));
        let folder = tempfile::tempdir().unwrap();
        let (next, version, published) = (0, 0, Vec::new());
        let mut editor = Self { connection: Some(client), server, folder, next, version, published };
        let root = editor.uri("");
        let capabilities =
            json!({"textDocument": {"completion": {"completionItem": {"snippetSupport": true}}}});
        let started = editor
            .request("initialize", json!({"processId": null, "rootUri": root, "capabilities": capabilities}));
        assert_eq!(started["serverInfo"]["name"], "foley");
        editor.notify("initialized", json!({}));
        editor
    }

    pub fn path(&self, name: &str) -> PathBuf {
        fs::canonicalize(self.folder.path()).unwrap().join(name)
    }

    pub fn uri(&self, name: &str) -> String {
        let text = format!("file://{}", self.path(name).display());
        Uri::from_str(&text).unwrap().as_str().trim_end_matches('/').to_owned()
    }

    /// Writes a file on the disk.
    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    pub fn notify(&self, method: &str, params: Value) {
        let notification = Notification::new(method.to_owned(), params);
        self.connection.as_ref().unwrap().sender.send(notification.into()).unwrap();
    }

    fn receive(&mut self) -> Message {
        let message = self.connection.as_ref().unwrap().receiver.recv_timeout(PATIENCE).unwrap();
        if let Message::Notification(found) = &message
            && found.method == "textDocument/publishDiagnostics"
        {
            let p = &found.params;
            let uri = p["uri"].as_str().unwrap().to_owned();
            self.published.push((uri, p["version"].as_i64().unwrap_or(-1), p["diagnostics"].clone()));
        }
        message
    }

    /// The answer to a request, or the message of its error.
    pub fn try_request(&mut self, method: &str, params: Value) -> Result<Value, String> {
        self.next += 1;
        let id = RequestId::from(self.next);
        let request = Request::new(id.clone(), method.to_owned(), params);
        self.connection.as_ref().unwrap().sender.send(request.into()).unwrap();
        loop {
            if let Message::Response(response) = self.receive()
                && response.id == id
            {
                let text = serde_json::to_value(&response).unwrap();
                return match text.get("error").filter(|e| !e.is_null()) {
                    Some(error) => Err(error["message"].as_str().unwrap().to_owned()),
                    None => Ok(text.get("result").cloned().unwrap_or(Value::Null)),
                };
            }
        }
    }

    pub fn request(&mut self, method: &str, params: Value) -> Value {
        self.try_request(method, params).unwrap()
    }

    /// Opens a text, without a file on the disk, and returns its findings.
    pub fn open(&mut self, name: &str, text: &str) -> Vec<Value> {
        self.version += 1;
        let item = json!({"uri": self.uri(name), "languageId": "ron", "version": self.version, "text": text});
        self.notify("textDocument/didOpen", json!({"textDocument": item}));
        self.findings(name)
    }

    /// Replaces a range of a text, or all of it, and returns its new findings.
    pub fn change(&mut self, name: &str, range: Option<Value>, text: &str) -> Vec<Value> {
        self.version += 1;
        let change = match range {
            Some(range) => json!({"range": range, "text": text}),
            None => json!({"text": text}),
        };
        let document = json!({"uri": self.uri(name), "version": self.version});
        let params = json!({"textDocument": document, "contentChanges": [change]});
        self.notify("textDocument/didChange", params);
        self.findings(name)
    }

    /// Replaces a text, and does not wait for its findings.
    pub fn change_unheard(&mut self, name: &str, text: &str) {
        self.version += 1;
        let document = json!({"uri": self.uri(name), "version": self.version});
        let params = json!({"textDocument": document, "contentChanges": [{"text": text}]});
        self.notify("textDocument/didChange", params);
    }

    /// The findings of the newest version of a text.
    fn findings(&mut self, name: &str) -> Vec<Value> {
        let (uri, version) = (self.uri(name), i64::from(self.version));
        loop {
            let found = self.published.iter().rev().find(|(of, v, _)| *of == uri && *v == version);
            if let Some((_, _, found)) = found {
                return found.as_array().unwrap().clone();
            }
            self.receive();
        }
    }

    /// The findings that are published for a text from now on.
    pub fn next_findings(&mut self, name: &str) -> Vec<Value> {
        let (uri, before) = (self.uri(name), self.published.len());
        loop {
            if let Some((_, _, found)) = self.published[before..].iter().find(|(of, _, _)| *of == uri) {
                return found.as_array().unwrap().clone();
            }
            self.receive();
        }
    }

    /// Parameters of a request about the `|` in a text.
    pub fn at(&self, name: &str, text: &str) -> Value {
        json!({"textDocument": {"uri": self.uri(name)}, "position": position(text, "|")})
    }

    /// Opens a text with a `|`, and returns the labels that can be typed there.
    pub fn completions(&mut self, text: &str) -> Vec<Value> {
        let name = format!("typed{}.ron", self.next);
        self.open(&name, &text.replacen('|', "", 1));
        let found = self.request("textDocument/completion", self.at(&name, text));
        found["items"].as_array().unwrap().clone()
    }

    /// The text that a hover over the `|` shows.
    pub fn hover(&mut self, name: &str, text: &str) -> String {
        let found = self.request("textDocument/hover", self.at(name, text));
        found["contents"]["value"].as_str().unwrap_or_default().to_owned()
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        self.request("shutdown", Value::Null);
        self.notify("exit", Value::Null);
        self.connection = None;
        self.server.take().unwrap().join().unwrap();
    }
}

/// The position of a part of a text.
pub fn position(text: &str, part: &str) -> Value {
    let before = &text[..text.find(part).unwrap()];
    let line = before.matches('\n').count();
    let column = before.rsplit('\n').next().unwrap().encode_utf16().count();
    json!({"line": line, "character": column})
}

/// The range of a part of a text.
pub fn range(text: &str, part: &str) -> Value {
    let start = position(text, part);
    let end = text.find(part).unwrap() + part.len();
    let rest = format!("{}\0", &text[..end]);
    json!({"start": start, "end": position(&rest, "\0")})
}

/// Labels of completions, in the order in which an editor shows them.
pub fn labels(items: &[Value]) -> Vec<String> {
    let mut sorted: Vec<&Value> = items.iter().collect();
    sorted.sort_by_key(|item| item["sortText"].as_str().unwrap().to_owned());
    sorted.iter().map(|item| item["label"].as_str().unwrap().to_owned()).collect()
}

/// A text with the edits of an answer.
pub fn edited(text: &str, edits: &Value) -> String {
    let offset = |p: &Value| {
        let line = p["line"].as_u64().unwrap() as usize;
        let start: usize = text.split_inclusive('\n').take(line).map(str::len).sum();
        let units = p["character"].as_u64().unwrap() as usize;
        let (mut at, mut seen) = (start, 0);
        while seen < units {
            let c = text[at..].chars().next().unwrap();
            (at, seen) = (at + c.len_utf8(), seen + c.len_utf16());
        }
        at
    };
    let mut all: Vec<(usize, usize, &str)> = edits
        .as_array()
        .unwrap()
        .iter()
        .map(|e| (offset(&e["range"]["start"]), offset(&e["range"]["end"]), e["newText"].as_str().unwrap()))
        .collect();
    all.sort_by_key(|edit| (edit.0, edit.1));
    let (mut out, mut at) = (String::new(), 0);
    for (start, end, new) in all {
        assert!(start >= at, "the edits overlap");
        out.push_str(&text[at..start]);
        out.push_str(new);
        at = end;
    }
    out + &text[at..]
}

/// Writes the edits of a workspace edit into the texts of files.
pub fn edits_of(edit: &Value, uri: &str) -> Value {
    edit["changes"].get(uri).cloned().unwrap_or(json!([]))
}

/// A path as a test names it.
pub fn file_name(uri: &Value) -> &str {
    Path::new(uri.as_str().unwrap()).file_name().unwrap().to_str().unwrap()
}
