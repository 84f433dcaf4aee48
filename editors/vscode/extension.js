// Starts `foley lsp` for graphs, and passes the settings on to it.
"use strict";

const fs = require("fs");
const os = require("os");
const path = require("path");
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

/** The running client, if there is one. */
let client;
/** The last start or stop: they take place one after the other. */
let turn = Promise.resolve();
/** The output of the server, which outlives it. */
let output;

/** The first folder of the workspace, or undefined. */
function workspaceFolder() {
  const folders = (vscode.workspace.workspaceFolders || []).filter((folder) => folder.uri.scheme === "file");
  return folders.length > 0 ? folders[0].uri.fsPath : undefined;
}

/** Replaces `~/` and `${workspaceFolder}` at the start of a path. */
function expand(text) {
  const folder = workspaceFolder();
  if (text === "~" || text.startsWith("~/") || text.startsWith("~\\")) {
    return path.join(os.homedir(), text.slice(1));
  }
  return folder ? text.replace(/^\$\{workspaceFolder\}/, () => folder) : text;
}

/** A path as an absolute one; relative paths begin at the workspace. */
function absolute(text) {
  return path.resolve(workspaceFolder() || os.homedir(), expand(text));
}

/** Returns true if a file can be run. */
function isExecutable(file) {
  try {
    fs.accessSync(file, fs.constants.X_OK);
    return fs.statSync(file).isFile();
  } catch {
    return false;
  }
}

/** The file of a command, as the shell would find it, or undefined. */
function find(command) {
  // Windows runs only files with one of these endings.
  const endings = process.platform === "win32" ? (process.env.PATHEXT || ".EXE").split(";") : [];
  const isNamed = endings.some((ending) => command.toLowerCase().endsWith(ending.toLowerCase()));
  const names = endings.length === 0 || isNamed ? [command] : endings.map((ending) => command + ending);
  if (/[/\\]/.test(command) || command.startsWith("~")) {
    return names.map(absolute).find(isExecutable);
  }
  // A relative folder in `PATH` would be one of whatever folder the editor was started in.
  const folders = (process.env.PATH || "").split(path.delimiter).filter((folder) => path.isAbsolute(folder));
  return folders.flatMap((folder) => names.map((name) => path.join(folder, name))).find(isExecutable);
}

async function reportMissing(command) {
  const open = "Open Settings";
  const choice = await vscode.window.showErrorMessage(
    `The command "${command}" was not found. Install foley (cargo install --locked --path . in its folder), ` +
      'or set "foley.path" to the command. Until then .ron files have syntax colouring only.',
    open,
  );
  if (choice === open) {
    await vscode.commands.executeCommand("workbench.action.openSettings", "foley.path");
  }
}

async function start() {
  const settings = vscode.workspace.getConfiguration("foley");
  const wanted = settings.get("path", "foley").trim() || "foley";
  const command = find(wanted);
  if (command === undefined) {
    // Without waiting: a message stays until somebody closes it.
    void reportMissing(wanted);
    return;
  }
  const folders = settings.get("allowRead", []).filter((folder) => typeof folder === "string" && folder !== "");
  const args = ["lsp", ...folders.flatMap((folder) => ["--allow-read", absolute(folder)])];
  const started = new LanguageClient(
    "foley",
    "foley",
    { command, args, options: { cwd: workspaceFolder() } },
    {
      documentSelector: [
        { scheme: "file", language: "ron" },
        { scheme: "untitled", language: "ron" },
      ],
      outputChannel: output,
    },
  );
  client = started;
  try {
    await started.start();
  } catch (error) {
    // The client has shown the error.
    output.appendLine(`${command} ${args.join(" ")}: ${error}`);
  }
}

async function stop() {
  const stopped = client;
  client = undefined;
  try {
    if (stopped && stopped.needsStop()) {
      await stopped.stop();
    }
    if (stopped) {
      await stopped.dispose();
    }
  } catch (error) {
    // A server that ended by itself, or never began.
    output.appendLine(`stop: ${error}`);
  }
}

/** Does something after all starts and stops before it. */
function inTurn(action) {
  turn = turn.then(action, action);
  return turn;
}

function restart() {
  return inTurn(async () => {
    await stop();
    await start();
  });
}

async function activate(context) {
  output = vscode.window.createOutputChannel("foley");
  context.subscriptions.push(
    output,
    vscode.commands.registerCommand("foley.restart", restart),
    vscode.workspace.onDidChangeConfiguration((event) => {
      if (event.affectsConfiguration("foley.path") || event.affectsConfiguration("foley.allowRead")) {
        return restart();
      }
    }),
    vscode.workspace.onDidGrantWorkspaceTrust(restart),
  );
  await inTurn(start);
}

function deactivate() {
  return inTurn(stop);
}

module.exports = { activate, deactivate };
