-- Checks `foley lsp` through the client of Neovim: starts it on a small graph with one mistake, makes the requests that an editor
-- makes, and prints one line for each. The exit code is 1 if one failed.
--
--   nvim --headless -u NONE -l editors/nvim_check.lua FOLEY             Neovim 0.9 or newer
--   FOLEY=FOLEY nvim --headless -u NONE -S editors/nvim_check.lua       Neovim 0.7 or newer
--
-- FOLEY is the command, by default `foley` of PATH.

local PATIENCE = 20000 -- ms for one answer

local GRAPH = [[
#![schema = "foley:graph/1"]
Graph(
    nodes: {
        "wind": Noise(level: 0.2, duration: Some(1.0)),
          "soft": Gain(audio: "wind",   gain: 0.5),
        "bright": HighPas(audio: "soft", cutoff: 400.0),
        "out": WavOut(path: "🎵 soft.wav", audio: "soft"),
        "high": WavOut(path: "high.wav", audio: "bright"),
    },
)
]]

local failed = 0

-- Makes one check. It passes if `run` returns no text, and fails with the text that it returns or the error that it throws.
local function check(name, run)
  local ok, wrong = pcall(run)
  if ok and wrong == nil then
    io.stdout:write("ok      " .. name .. "\n")
  else
    failed = failed + 1
    local line = tostring(wrong):gsub("%s+", " ")
    io.stdout:write("FAILED  " .. name .. ": " .. line .. "\n")
  end
  io.stdout:flush()
end

local function finish(folder)
  if folder then
    vim.fn.delete(folder, "rf")
  end
  io.stdout:write(failed == 0 and "all ok\n" or failed .. " failed\n")
  io.stdout:flush()
  vim.cmd(failed == 0 and "qall!" or "cquit 1")
end

-- The graph in a buffer of a file.
local folder = vim.fn.tempname()
vim.fn.mkdir(folder, "p")
local file = folder .. "/check.ron"
do
  local written = assert(io.open(file, "w"))
  written:write(GRAPH)
  written:close()
end
vim.cmd("edit " .. vim.fn.fnameescape(file))
local buffer = vim.api.nvim_get_current_buf()
vim.bo[buffer].filetype = "ron"
local uri = vim.uri_from_bufnr(buffer)

local function text()
  return table.concat(vim.api.nvim_buf_get_lines(buffer, 0, -1, false), "\n") .. "\n"
end

-- The position in the protocol of the byte after `before` in the first line that has `before .. after`.
local function position(before, after)
  for nth, line in ipairs(vim.api.nvim_buf_get_lines(buffer, 0, -1, false)) do
    local start = line:find(before .. after, 1, true)
    if start then
      local byte, column = start - 1 + #before, nil
      if vim.fn.has("nvim-0.11") == 1 then
        column = vim.str_utfindex(line, "utf-16", byte)
      else
        _, column = vim.str_utfindex(line, byte)
      end
      return { line = nth - 1, character = column }
    end
  end
  error("the graph has no " .. before .. after)
end

-- Sends a request and returns the result.
local function request(method, params)
  params.textDocument = { uri = uri }
  local answers, problem = vim.lsp.buf_request_sync(buffer, method, params, PATIENCE)
  if not answers then
    error(method .. ": " .. tostring(problem), 0)
  end
  for _, answer in pairs(answers) do
    local err = answer.err or answer.error
    if err then
      error(method .. ": " .. (err.message or vim.inspect(err)), 0)
    end
    if answer.result == nil or answer.result == vim.NIL then
      error(method .. ": the result is null", 0)
    end
    return answer.result
  end
  error(method .. ": no answer", 0)
end

local function labels(before, after)
  local result = request("textDocument/completion", { position = position(before, after) })
  local found = {}
  for _, item in ipairs(result.items or result) do
    found[item.label] = item
  end
  return found
end

local function offers(found, ...)
  for _, label in ipairs({ ... }) do
    if not found[label] then
      local all = vim.tbl_keys(found)
      table.sort(all)
      return "`" .. label .. "` is not among: " .. table.concat(all, ", "):sub(1, 300)
    end
  end
end

local function hover(before, after)
  local contents = request("textDocument/hover", { position = position(before, after) }).contents
  return type(contents) == "string" and contents or contents.value or vim.inspect(contents)
end

-- The diagnostics of a line, counted from 0, once there are some, or once there are none.
local function diagnostics(line, some)
  local function here()
    return vim.diagnostic.get(buffer, { lnum = line })
  end
  local in_time = vim.wait(PATIENCE, function()
    return (#here() > 0) == some
  end, 20)
  return in_time, here()
end

-- Applies an edit of the workspace to the buffer.
local function apply(edit)
  vim.lsp.util.apply_workspace_edit(edit, "utf-16")
end

local function count(part)
  local _, number = text():gsub(vim.pesc(part), "")
  return number
end

local binary = (arg and arg[1]) or vim.env.FOLEY or "foley"
local command = vim.fn.exepath(binary)
local client, exit

check("start", function()
  if command == "" then
    return "the command " .. binary .. " was not found"
  end
  local config = {
    name = "foley",
    cmd = { command, "lsp" },
    root_dir = folder,
    on_exit = function(code, signal)
      exit = { code = code, signal = signal }
    end,
  }
  local id
  if vim.lsp.start then
    id = vim.lsp.start(config, { bufnr = buffer })
  else
    id = vim.lsp.start_client(config)
    vim.lsp.buf_attach_client(buffer, id)
  end
  local up = vim.wait(PATIENCE, function()
    client = id and vim.lsp.get_client_by_id(id)
    return exit ~= nil or (client ~= nil and client.initialized == true)
  end, 20)
  if exit then
    return "the server ended with code " .. exit.code
  elseif not up then
    return "no answer to initialize"
  end
end)

if failed > 0 then
  finish(folder)
end

local mistake = position('"bright": ', "HighPas(").line

check("diagnostics", function()
  local in_time, found = diagnostics(mistake, true)
  if not in_time then
    return "there are none for HighPas"
  elseif not found[1].message:find("HighPas", 1, true) then
    return "the message is " .. found[1].message
  elseif found[1].col ~= 18 or found[1].end_col ~= 25 then
    return ("columns %d to %d, not 18 to 25"):format(found[1].col, found[1].end_col)
  end
end)

check("quick fix", function()
  local start = position('"bright": ', "HighPas(")
  local range = { start = start, ["end"] = { line = start.line, character = start.character + 7 } }
  local actions = request("textDocument/codeAction", { range = range, context = { diagnostics = {} } })
  for _, action in ipairs(actions) do
    if action.edit then
      apply(action.edit)
      if count("HighPass(") ~= 1 then
        return "`" .. action.title .. "` leaves " .. text()
      end
      local in_time, found = diagnostics(mistake, false)
      return not in_time and "there is still: " .. found[1].message or nil
    end
  end
  return "no action has an edit: " .. vim.inspect(actions)
end)

check("completion of a node type", function()
  return offers(labels('"wind": Noi', "se("), "Noise")
end)

check("completion of a field", function()
  return offers(labels("Gain(", "audio"), "db")
end)

check("completion of a link", function()
  return offers(labels('audio: "', 'soft", cutoff'), "wind", "soft")
end)

check("hover on a node type", function()
  local shown = hover("Ga", "in(")
  return not shown:find("Multiplies audio", 1, true) and "it shows " .. shown or nil
end)

check("hover on a field", function()
  local shown = hover("cut", "off: 400")
  return not (shown:find("cutoff", 1, true) and shown:find("Hz", 1, true)) and "it shows " .. shown or nil
end)

check("definition", function()
  local result = request("textDocument/definition", { position = position('soft.wav", audio: "', 'soft"') })
  local place = result[1] or result
  local found, line = place.uri or place.targetUri, (place.range or place.targetSelectionRange).start.line
  local expected = position('"soft"', ": Gain").line
  if vim.uri_to_fname(found) ~= vim.uri_to_fname(uri) or line ~= expected then
    return ("it is %s, line %d, not line %d"):format(found, line, expected)
  end
end)

check("references", function()
  local at = position('soft.wav", audio: "', 'soft"')
  local found = request("textDocument/references", { position = at, context = { includeDeclaration = true } })
  return #found ~= 3 and #found .. " places, not 3" or nil
end)

check("rename", function()
  local at = position('soft.wav", audio: "', 'soft"')
  apply(request("textDocument/rename", { position = at, newName = "quiet" }))
  if count('"quiet"') ~= 3 or count('"soft"') ~= 0 or count("🎵 soft.wav") ~= 1 then
    return "it leaves " .. text()
  end
end)

check("formatting", function()
  local edits = request("textDocument/formatting", { options = { tabSize = 4, insertSpaces = true } })
  vim.lsp.util.apply_text_edits(edits, buffer, "utf-16")
  if count('\n        "quiet": Gain(audio: "wind", gain: 0.5),\n') ~= 1 then
    return "it leaves " .. text()
  end
end)

local everything = { start = { line = 0, character = 0 }, ["end"] = { line = 10, character = 0 } }

check("symbols", function()
  local names = {}
  local function collect(symbols)
    for _, symbol in ipairs(symbols) do
      names[symbol.name] = true
      collect(symbol.children or {})
    end
  end
  collect(request("textDocument/documentSymbol", {}))
  for _, id in ipairs({ "wind", "quiet", "bright", "out" }) do
    if not names[id] then
      return "`" .. id .. "` is not among: " .. table.concat(vim.tbl_keys(names), ", ")
    end
  end
end)

check("folding", function()
  return #request("textDocument/foldingRange", {}) == 0 and "there are no ranges" or nil
end)

check("inlay hints", function()
  return #request("textDocument/inlayHint", { range = everything }) == 0 and "there are no hints" or nil
end)

check("semantic colours", function()
  local data = request("textDocument/semanticTokens/full", {}).data
  return (#data == 0 or #data % 5 ~= 0) and #data .. " numbers" or nil
end)

check("no diagnostics at the end", function()
  local function none()
    return #vim.diagnostic.get(buffer) == 0
  end
  if not vim.wait(PATIENCE, none, 20) then
    return vim.diagnostic.get(buffer)[1].message
  end
end)

check("stop", function()
  if type(client.stop) ~= "function" then
    return "the client has ended"
  elseif vim.fn.has("nvim-0.11") == 1 then
    client:stop()
  else
    client.stop()
  end
  local function ended()
    return exit ~= nil
  end
  if not vim.wait(PATIENCE, ended, 20) then
    return "the server is still running"
  elseif exit.code ~= 0 then
    return ("the server ended with code %d, signal %d"):format(exit.code, exit.signal)
  end
end)

finish(folder)
