//! Keys of cached results: all that a result depends on, by name, and the hash of it.

use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::files::Files;
use foley_nodes::core::params::{Datum, ParamKind};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::time::Tick;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// Version of the composition of keys.
const KEY_FORMAT: &[u8] = b"foley memo 1";

/// One item that a result depends on: its name and its content.
pub type KeyPart = (String, String);

/// All dependencies of a result.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// The parts by name; files and values are represented by content hashes.
    pub parts: Vec<KeyPart>,
    /// The hash of the parts; `None` while the value of an input is not known.
    pub hash: Option<blake3::Hash>,
}

/// Content of a part whose value is not known.
const UNKNOWN: &str = "not known before it is computed";

/// Makes the keys of the nodes of one graph.
///
/// The key of a value node consists of its type and version, its parameters, the content of its files, its id and the
/// seed, and the content hashes of the values that it reads. A fold depends on streams, whose content is not known before
/// they run; its key contains the same parts of every node upstream instead, up to the next values. It lists these nodes
/// rather than their keys, so that feedback loops need no special case.
///
/// Window and threads are not in a key, since no result depends on them. The length of a stream is, where `--until` or the
/// longest node of its phase truncates it.
pub struct Keys<'a> {
    graph: &'a Graph,
    plan: &'a Plan,
    files: &'a dyn Files,
    seed: u64,
    /// Content hashes of files read so far; `None` for files that cannot be read.
    contents: RefCell<HashMap<String, Option<blake3::Hash>>>,
}

impl<'a> Keys<'a> {
    /// Keys of a planned graph; each file is read once.
    #[must_use]
    pub fn new(graph: &'a Graph, plan: &'a Plan, files: &'a dyn Files, seed: u64) -> Self {
        Self { graph, plan, files, seed, contents: RefCell::default() }
    }

    /// Makes the key of a node from the content hashes of values by node and port; `None` if a file cannot be read.
    ///
    /// # Complexity
    /// O(nodes and links upstream), and each file is read once.
    #[must_use]
    pub fn key(&self, n: usize, values: &dyn Fn(usize, usize) -> Option<[u8; 32]>) -> Option<Key> {
        let duration = self.plan.phases.iter().find(|p| p.nodes.contains(&n)).map(|p| p.duration);
        self.key_within(n, duration, values)
    }

    /// Makes the key of the streams of a node that ends; the duration of endless nodes upstream does not count.
    #[must_use]
    pub fn stream_key(&self, n: usize, values: &dyn Fn(usize, usize) -> Option<[u8; 32]>) -> Option<Key> {
        self.key_within(n, None, values)
    }

    fn key_within(
        &self,
        n: usize,
        duration: Option<Tick>,
        values: &dyn Fn(usize, usize) -> Option<[u8; 32]>,
    ) -> Option<Key> {
        let mut parts = vec![
            ("foley".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("machine".to_owned(), format!("{} {}", std::env::consts::ARCH, std::env::consts::OS)),
            ("seed".to_owned(), self.seed.to_string()),
            ("node id".to_owned(), self.graph.nodes[n].id.clone()),
        ];
        let mut known = true;
        self.add_parts(n, "", duration, values, &mut parts, &mut known)?;
        let upstream: BTreeMap<&str, usize> =
            self.upstream(n).into_iter().map(|m| (self.graph.nodes[m].id.as_str(), m)).collect();
        for (id, m) in upstream {
            self.add_parts(m, &format!("{id}."), duration, values, &mut parts, &mut known)?;
        }
        let hash = known.then(|| {
            let mut hasher = blake3::Hasher::new();
            hasher.update(KEY_FORMAT);
            for text in parts.iter().flat_map(|(name, content)| [name, content]) {
                hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
            }
            hasher.finalize()
        });
        Some(Key { parts, hash })
    }

    /// Retains the nodes whose keys are unchanged when all files are read again.
    pub fn retain_unchanged(&self, nodes: &mut Vec<usize>) {
        let fresh = Self::new(self.graph, self.plan, self.files, self.seed);
        let any = |_, _| Some([0; 32]);
        nodes.retain(|&n| self.key(n, &any) == fresh.key(n, &any));
    }

    /// Returns all other nodes whose streams a node depends on.
    #[must_use]
    pub fn upstream(&self, n: usize) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        let mut stack = vec![n];
        while let Some(v) = stack.pop() {
            let node = &self.graph.nodes[v];
            for (spec, links) in node.ty.inputs.iter().zip(&node.links) {
                if !matches!(spec.kind, PortKind::Value(_)) {
                    stack.extend(links.iter().map(|l| l.node).filter(|&u| u != n && found.insert(u)));
                }
            }
        }
        found
    }

    /// Adds the parts of one node.
    fn add_parts(
        &self,
        n: usize,
        prefix: &str,
        duration: Option<Tick>,
        values: &dyn Fn(usize, usize) -> Option<[u8; 32]>,
        parts: &mut Vec<KeyPart>,
        known: &mut bool,
    ) -> Option<()> {
        let node = &self.graph.nodes[n];
        let shape = &self.plan.shapes[n];
        parts.push((format!("{prefix}node type"), format!("{} {}", node.ty.name, node.ty.version)));
        if node.ty.eval.is_none() {
            let length = shape.end.or(duration).unwrap_or(0);
            parts.push((format!("{prefix}node length"), format!("{length} ticks")));
        }
        let mut named = BTreeSet::new();
        let specs = (node.ty.params)();
        for (name, datum) in node.params.write() {
            let kind = specs.iter().find(|s| s.name == name).map(|s| *s.kind.innermost());
            let content = match kind {
                Some(ParamKind::Output) => continue,
                Some(ParamKind::Asset) => self.asset(&datum, node.ty.exposes_paths, &mut named)?,
                Some(ParamKind::Folder) => self.folder(&datum, &mut named)?,
                _ => datum.to_string(),
            };
            parts.push((format!("{prefix}{name}"), content));
        }
        // Files that other files name, such as the buffers of a glTF scene.
        let others: BTreeSet<&String> = shape.opened.iter().filter(|path| !named.contains(*path)).collect();
        for (k, path) in others.into_iter().enumerate() {
            parts.push((format!("{prefix}file {k}"), self.content(path)?.to_string()));
        }
        for (spec, links) in node.ty.inputs.iter().zip(&node.links) {
            for (k, link) in links.iter().enumerate() {
                let name = match links.len() {
                    1 => format!("{prefix}{}", spec.name),
                    _ => format!("{prefix}{}[{k}]", spec.name),
                };
                let from = &self.graph.nodes[link.node];
                let content = match (spec.kind, values(link.node, link.port)) {
                    (PortKind::Value(_), Some(hash)) => blake3::Hash::from_bytes(hash).to_string(),
                    (PortKind::Value(_), None) => {
                        *known = false;
                        UNKNOWN.to_owned()
                    }
                    _ => format!("{}.{}", from.id, from.ty.outputs[link.port].name),
                };
                parts.push((name, content));
            }
        }
        Some(())
    }

    /// Content hashes of the files of a parameter, with their extensions, by which readers choose the format.
    fn asset(&self, datum: &Datum, exposes_paths: bool, named: &mut BTreeSet<String>) -> Option<String> {
        match datum {
            Datum::Text(path) => {
                named.insert(path.clone());
                let content = match path.contains('#') {
                    true => self.sequence(path, named)?,
                    false => self.content(path)?,
                };
                let ending = Path::new(path).extension().unwrap_or_default().to_string_lossy().to_lowercase();
                let path = if exposes_paths { format!(" {path:?}") } else { String::new() };
                Some(format!("{content} .{ending}{path}"))
            }
            Datum::List(items) => {
                let items: Option<Vec<String>> =
                    items.iter().map(|item| self.asset(item, exposes_paths, named)).collect();
                Some(format!("[{}]", items?.join(", ")))
            }
            other => Some(other.to_string()),
        }
    }

    fn sequence(&self, pattern: &str, named: &mut BTreeSet<String>) -> Option<blake3::Hash> {
        let mut hasher = blake3::Hasher::new();
        for (number, path) in self.files.sequence(pattern).ok()? {
            hasher.update(&number.to_le_bytes()).update(self.content(&path)?.as_bytes());
            named.insert(path);
        }
        Some(hasher.finalize())
    }

    /// Hash of the names and contents of the files in a folder.
    fn folder(&self, datum: &Datum, named: &mut BTreeSet<String>) -> Option<String> {
        let Datum::Text(folder) = datum else { return Some(datum.to_string()) };
        let mut hasher = blake3::Hasher::new();
        for path in self.files.folder(folder).ok()? {
            hasher.update(path.as_bytes()).update(b"\0").update(self.content(&path)?.as_bytes());
            named.insert(path);
        }
        Some(hasher.finalize().to_string())
    }

    fn content(&self, path: &str) -> Option<blake3::Hash> {
        if let Some(known) = self.contents.borrow().get(path) {
            return *known;
        }
        let read = || {
            let mut hasher = blake3::Hasher::new();
            hasher.update_reader(self.files.open(path).ok()?).ok()?;
            Some(hasher.finalize())
        };
        let content = read();
        self.contents.borrow_mut().insert(path.to_owned(), content);
        content
    }
}

/// Returns the differences of two lists of parts: name, old and new content.
#[must_use]
pub fn changes<'p>(
    old: &'p [KeyPart],
    new: &'p [KeyPart],
) -> Vec<(&'p str, Option<&'p str>, Option<&'p str>)> {
    let get = |parts: &'p [KeyPart]| -> BTreeMap<&'p str, &'p str> {
        parts.iter().map(|(name, content)| (name.as_str(), content.as_str())).collect()
    };
    let (old, new) = (get(old), get(new));
    let names: BTreeSet<&str> = old.keys().chain(new.keys()).copied().collect();
    let both = names.into_iter().map(|name| (name, old.get(name).copied(), new.get(name).copied()));
    both.filter(|(_, old, new)| old != new).collect()
}
