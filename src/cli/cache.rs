//! `foley cache`.

use super::Exit;
use super::args::{CacheArgs, CacheCommand, CacheDirArgs, GcArgs, StatArgs, WhyArgs};
use super::run::prepare;
use crate::graph::GraphNode;
use crate::memo::{KeyPart, Memo, RunCache, Store, StoredFile, changes, default_dir, has_cacheable_values};
use crate::plan::format_bytes;
use foley_nodes::registry::Registry;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// Inspects, empties or explains the cached results of earlier runs.
///
/// # Errors
/// When standard output goes away.
pub fn cache(args: &CacheArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    match &args.command {
        CacheCommand::Stat(args) => stat(args),
        CacheCommand::Gc(args) => gc(args),
        CacheCommand::Why(args) => why(args, registry),
    }
}

fn folder(args: &CacheDirArgs) -> PathBuf {
    let graph = args.graph.clone().unwrap_or_default();
    args.cache.clone().unwrap_or_else(|| default_dir(&graph))
}

fn stat(args: &StatArgs) -> anyhow::Result<Exit> {
    let dir = folder(&args.dir);
    let all = Store::new(&dir, u64::MAX).list();
    let mut kinds: BTreeMap<String, (usize, u64, f64)> = BTreeMap::new();
    for listed in &all {
        let (kind, seconds) = match &listed.entry {
            Some(entry) => (entry.kind.clone(), entry.seconds),
            None => ("(cannot be read)".to_owned(), 0.0),
        };
        let sum = kinds.entry(kind).or_default();
        *sum = (sum.0 + 1, sum.1 + listed.bytes, sum.2 + seconds);
    }
    let bytes: u64 = all.iter().map(|l| l.bytes).sum();
    let mut out = super::console::stdout();
    if args.json {
        let kinds: serde_json::Map<_, _> = kinds
            .into_iter()
            .map(|(kind, (entries, bytes, seconds))| {
                (kind, json!({ "entries": entries, "bytes": bytes, "seconds": seconds }))
            })
            .collect();
        let all = json!({ "folder": dir, "entries": all.len(), "bytes": bytes, "kinds": kinds });
        writeln!(out, "{all:#}")?;
        return Ok(Exit::Done);
    }
    writeln!(out, "{}: {} entries, {}", dir.display(), all.len(), format_bytes(bytes as usize))?;
    for (kind, (entries, bytes, seconds)) in kinds {
        writeln!(
            out,
            "  {kind}: {entries} entries, {}, {seconds:.2} s to compute",
            format_bytes(bytes as usize)
        )?;
    }
    Ok(Exit::Done)
}

fn gc(args: &GcArgs) -> anyhow::Result<Exit> {
    let store = Store::new(folder(&args.dir), args.cache_size as u64);
    let before = store.list();
    if args.all {
        store.clear();
    } else {
        store.evict(store.cap(), &Default::default());
    }
    let after = store.list();
    let bytes = |all: &[StoredFile]| format_bytes(all.iter().map(|l| l.bytes).sum::<u64>() as usize);
    writeln!(
        super::console::stdout(),
        "{}: {} entries, {}; {} entries, {} before",
        store.dir().display(),
        after.len(),
        bytes(&after),
        before.len(),
        bytes(&before)
    )?;
    Ok(Exit::Done)
}

fn why(args: &WhyArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let session = args.engine.apply(args.graph.session(registry)).with_quiet(true);
    let Some(ready) = prepare(&session) else { return Ok(Exit::Wrong) };
    let graph = &ready.graph;
    let dir = args.cache.clone().unwrap_or_else(|| default_dir(&args.graph.graph));
    let memo = Memo::new(dir, u64::MAX, &args.graph.graph);
    // The streams that are cached are known after a run has cached them.
    let has = |n: &GraphNode| has_cacheable_values(&n.ty) || memo.index().get(&n.id).is_some();
    let cacheable: Vec<&str> = graph.nodes.iter().filter(|n| has(n)).map(|n| n.id.as_str()).collect();
    let Some(n) = graph.find(&args.node).filter(|&n| has(&graph.nodes[n])) else {
        let what = match graph.find(&args.node) {
            Some(_) => {
                "has no values that can be cached, and its streams were not expensive enough to be cached"
            }
            None => "is not a node of this graph",
        };
        let list = if cacheable.is_empty() { "none".to_owned() } else { cacheable.join(", ") };
        super::console::print_message(format_args!(
            "`{}` {what}; nodes with results that can be cached: {list}",
            args.node
        ));
        return Ok(Exit::Wrong);
    };
    let cache = RunCache::new(&memo, graph, &ready.plan, &ready.files, ready.seed);
    let Some((key, there)) = cache.status(n) else {
        super::console::print_message(format_args!(
            "`{}` does not run in this graph, or a file that it reads cannot be read",
            args.node
        ));
        return Ok(Exit::Wrong);
    };
    let mut out = super::console::stdout();
    let id = &args.node;
    if there {
        writeln!(out, "{id}: cached; the next run does not compute it")?;
    } else {
        writeln!(out, "{id}: not cached; the next run computes it")?;
    }
    match memo.index().get(id) {
        None => writeln!(out, "no earlier run of this graph has computed it")?,
        Some(trace) if trace.last != key.parts => {
            writeln!(out, "changes since the last run:")?;
            print_changes(&mut out, &trace.last, &key.parts)?;
        }
        Some(trace) => {
            writeln!(out, "nothing that it depends on has changed since the last run")?;
            if !trace.before.is_empty() {
                writeln!(out, "changes that led to its last computation:")?;
                print_changes(&mut out, &trace.before, &trace.last)?;
            }
        }
    }
    Ok(Exit::Done)
}

fn print_changes(out: &mut impl Write, was: &[KeyPart], is: &[KeyPart]) -> io::Result<()> {
    for (name, was, is) in changes(was, is) {
        writeln!(out, "  {name}: {} -> {}", was.unwrap_or("(none)"), is.unwrap_or("(none)"))?;
    }
    Ok(())
}
