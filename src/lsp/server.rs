//! The messages between editor and server.

use super::analysis::{Analysis, Analyst, Request as Inspect};
use super::context::Context;
use super::diagnostics::{diagnostics, text_errors};
use super::requests::answer;
use super::tokens::legend;
use super::workspace::{Workspace, path_of};
use crate::graph::LoadOptions;
use crossbeam_channel::select;
use foley_nodes::registry::Registry;
use lsp_server::{Connection, ErrorCode, Message, Notification, ProtocolError, Request, Response};
use lsp_types::notification::{
    DidChangeTextDocument, DidCloseTextDocument, DidOpenTextDocument, DidSaveTextDocument, Notification as _,
    PublishDiagnostics,
};
use lsp_types::{
    CodeActionKind, CodeActionOptions, CodeActionProviderCapability, CompletionOptions,
    DidChangeTextDocumentParams, DidCloseTextDocumentParams, DidOpenTextDocumentParams, DocumentLinkOptions,
    FoldingRangeProviderCapability, HoverProviderCapability, InitializeParams, OneOf,
    PublishDiagnosticsParams, RenameOptions, SemanticTokensFullOptions, SemanticTokensOptions,
    ServerCapabilities, TextDocumentContentChangeEvent, TextDocumentSyncCapability, TextDocumentSyncKind,
    TextDocumentSyncOptions, TextDocumentSyncSaveOptions, WorkDoneProgressOptions,
};
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Answers an editor until it ends the connection. `options` are the settings with which graphs are loaded.
///
/// # Errors
/// When the editor breaks the protocol.
pub fn serve(connection: &Connection, options: &LoadOptions) -> Result<(), ProtocolError> {
    let (id, params) = connection.initialize_start()?;
    let params: InitializeParams = serde_json::from_value(params).unwrap_or_default();
    let result = serde_json::json!({
        "capabilities": capabilities(),
        "serverInfo": {"name": "foley", "version": env!("CARGO_PKG_VERSION")},
    });
    connection.initialize_finish(id, result)?;
    let mut server = Server::new(connection, options, &params);
    server.run()
}

fn capabilities() -> ServerCapabilities {
    let no_progress = WorkDoneProgressOptions::default();
    ServerCapabilities {
        text_document_sync: Some(TextDocumentSyncCapability::Options(TextDocumentSyncOptions {
            open_close: Some(true),
            change: Some(TextDocumentSyncKind::INCREMENTAL),
            save: Some(TextDocumentSyncSaveOptions::Supported(true)),
            ..TextDocumentSyncOptions::default()
        })),
        completion_provider: Some(CompletionOptions {
            trigger_characters: Some(["\"", ".", "$", "/", ":", "("].map(str::to_owned).to_vec()),
            ..CompletionOptions::default()
        }),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        definition_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: no_progress,
        })),
        document_formatting_provider: Some(OneOf::Left(true)),
        document_symbol_provider: Some(OneOf::Left(true)),
        document_link_provider: Some(DocumentLinkOptions {
            resolve_provider: Some(false),
            work_done_progress_options: no_progress,
        }),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        inlay_hint_provider: Some(OneOf::Left(true)),
        code_action_provider: Some(CodeActionProviderCapability::Options(CodeActionOptions {
            code_action_kinds: Some(vec![CodeActionKind::QUICKFIX, CodeActionKind::REFACTOR_EXTRACT]),
            ..CodeActionOptions::default()
        })),
        semantic_tokens_provider: Some(
            SemanticTokensOptions {
                legend: legend(),
                range: Some(true),
                full: Some(SemanticTokensFullOptions::Bool(true)),
                work_done_progress_options: no_progress,
            }
            .into(),
        ),
        ..ServerCapabilities::default()
    }
}

struct Server<'c> {
    connection: &'c Connection,
    registry: Arc<Registry>,
    snippets: bool,
    workspace: Workspace,
    analyst: Option<Analyst>,
    analyses: HashMap<PathBuf, Arc<Analysis>>,
}

impl<'c> Server<'c> {
    // The older names of the folders are what some editors send.
    #[allow(deprecated)]
    fn new(connection: &'c Connection, options: &LoadOptions, params: &InitializeParams) -> Self {
        let completion = params.capabilities.text_document.as_ref().and_then(|text| text.completion.as_ref());
        let item = completion.and_then(|completion| completion.completion_item.as_ref());
        let mut workspace = Workspace::default();
        let folders = params.workspace_folders.iter().flatten().map(|folder| path_of(&folder.uri));
        workspace.folders = folders.collect();
        if workspace.folders.is_empty() {
            workspace.folders.extend(params.root_uri.as_ref().map(path_of));
        }
        Self {
            connection,
            registry: Arc::clone(&options.registry),
            snippets: item.and_then(|item| item.snippet_support).unwrap_or(false),
            workspace,
            // Without a thread there are no findings; all else is answered.
            analyst: Analyst::start(options.clone()).ok(),
            analyses: HashMap::new(),
        }
    }

    fn run(&mut self) -> Result<(), ProtocolError> {
        let results = self.analyst.as_ref().map_or_else(crossbeam_channel::never, |a| a.results.clone());
        loop {
            select! {
                recv(self.connection.receiver) -> message => match message {
                    Ok(Message::Request(request)) => {
                        if self.connection.handle_shutdown(&request)? {
                            return Ok(());
                        }
                        self.on_request(request);
                    }
                    Ok(Message::Notification(notification)) if notification.method == "exit" => return Ok(()),
                    Ok(Message::Notification(notification)) => self.on_notification(notification),
                    Ok(Message::Response(_)) => {}
                    // The editor is gone.
                    Err(_) => return Ok(()),
                },
                recv(results) -> analysis => if let Ok(analysis) = analysis {
                    self.on_analysis(analysis);
                },
            }
        }
    }

    fn send(&self, message: impl Into<Message>) {
        let _ = self.connection.sender.send(message.into());
    }

    fn on_request(&self, Request { id, method, params }: Request) {
        let context = Context {
            workspace: &self.workspace,
            registry: &self.registry,
            analyses: &self.analyses,
            snippets: self.snippets,
        };
        self.send(match answer(&context, &method, params) {
            Some(Ok(value)) => Response::new_ok(id, value),
            Some(Err(message)) => Response::new_err(id, ErrorCode::RequestFailed as i32, message),
            None => {
                let message = format!("the server does not support the request {method}");
                Response::new_err(id, ErrorCode::MethodNotFound as i32, message)
            }
        });
    }

    fn on_notification(&mut self, notification: Notification) {
        match &*notification.method {
            DidOpenTextDocument::METHOD => {
                let Some(DidOpenTextDocumentParams { text_document: opened }) = read(notification) else {
                    return;
                };
                let path = self.workspace.set(&opened.uri, opened.version, opened.text);
                self.inspect(&path);
            }
            DidChangeTextDocument::METHOD => {
                let Some(params) = read(notification) else { return };
                self.on_change(params);
            }
            DidCloseTextDocument::METHOD => {
                let Some(DidCloseTextDocumentParams { text_document: closed }) = read(notification) else {
                    return;
                };
                let path = self.workspace.close(&closed.uri);
                self.analyses.remove(&path);
                self.publish(PublishDiagnosticsParams::new(closed.uri, Vec::new(), None));
                self.inspect_users(&path);
            }
            // A file that graphs read may have been written by another program meanwhile.
            DidSaveTextDocument::METHOD => {
                let open: Vec<PathBuf> =
                    self.workspace.open_files().map(|(path, _)| path.to_owned()).collect();
                open.iter().for_each(|path| self.inspect(path));
            }
            _ => {}
        }
    }

    fn on_change(&mut self, params: DidChangeTextDocumentParams) {
        let DidChangeTextDocumentParams { text_document, content_changes } = params;
        let path = path_of(&text_document.uri);
        let Some(open) = self.workspace.open_file(&path) else { return };
        let mut text = open.file.text.to_string();
        let mut lines = None;
        for TextDocumentContentChangeEvent { range, text: new, .. } in content_changes {
            let Some(range) = range else {
                (text, lines) = (new, None);
                continue;
            };
            let span = match &lines {
                None if *text == *open.file.text => open.file.span(range),
                _ => super::file::TextFile::new(&*text).span(range),
            };
            lines = Some(());
            text.replace_range(span, &new);
        }
        // The findings of a graph are looked for while its text is parsed here.
        let is_graph = open.file.is_graph();
        if is_graph {
            self.request(&path, text_document.version, Some(&text));
        }
        self.workspace.set(&text_document.uri, text_document.version, text);
        let still_graph = self.workspace.open_file(&path).is_some_and(|open| open.file.is_graph());
        if !is_graph || !still_graph {
            self.inspect(&path);
        }
        self.inspect_users(&path);
    }

    /// Requests the findings of a graph; `newest` is its text if the workspace does not have it yet.
    fn request(&self, path: &Path, version: i32, newest: Option<&str>) {
        if let Some(analyst) = &self.analyst {
            let texts = self.workspace.texts(newest.map(|text| (path, text)));
            analyst.request(Inspect { path: path.to_owned(), version, texts });
        }
    }

    /// Requests the findings of an open file.
    fn inspect(&self, path: &Path) {
        let Some(open) = self.workspace.open_file(path) else { return };
        if !open.file.is_graph() {
            let found = text_errors(&open.file);
            self.publish(PublishDiagnosticsParams::new(open.uri.clone(), found, Some(open.version)));
            return;
        }
        self.request(path, open.version, None);
    }

    /// Requests the findings of the open graphs that use a file.
    fn inspect_users(&self, path: &Path) {
        let users = self.analyses.values().filter(|user| user.path != path);
        users.filter(|user| user.asked.iter().any(|p| p == path)).for_each(|user| self.inspect(&user.path));
    }

    fn on_analysis(&mut self, mut analysis: Analysis) {
        let open = self.workspace.open_file(&analysis.path).filter(|open| open.file.is_graph());
        let Some(open) = open else { return };
        let file = Arc::clone(&open.file);
        if open.version == analysis.version {
            let found = diagnostics(&self.workspace, &analysis, &file);
            let uri = open.uri.clone();
            self.publish(PublishDiagnosticsParams::new(uri, found, Some(analysis.version)));
        }
        // What was known of nodes stays while the text is half-typed.
        if let Some(before) = self.analyses.get(&analysis.path) {
            for (id, facts) in &before.nodes {
                let is_same = file.node(id).is_some_and(|node| node.ty.value == facts.ty.name);
                if is_same || id.contains('.') {
                    analysis.nodes.entry(id.clone()).or_insert_with(|| facts.clone());
                }
            }
        }
        self.analyses.insert(analysis.path.clone(), Arc::new(analysis));
    }

    fn publish(&self, params: PublishDiagnosticsParams) {
        self.send(Notification::new(PublishDiagnostics::METHOD.to_owned(), params));
    }
}

/// The parameters of a notification; one that cannot be read has no effect.
fn read<P: DeserializeOwned>(notification: Notification) -> Option<P> {
    serde_json::from_value(notification.params).ok()
}
