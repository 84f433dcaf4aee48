//! What a value depends on, by name, and the hash of it all.

use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::files::Files;
use foley_nodes::core::params::{Datum, ParamKind};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::time::Tick;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// Goes up when keys are made in another way.
const RECIPE: &[u8] = b"foley memo 1";

/// One thing that a value depends on: its name and what it is.
pub type Part = (String, String);

/// All that a value depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// The parts by name; content hashes stand for files and for values.
    pub parts: Vec<Part>,
    /// The hash of the parts; `None` while an input is not known.
    pub hash: Option<blake3::Hash>,
}

/// What a part says of an input that is not known.
const UNKNOWN: &str = "not known before it is computed";

/// Makes the keys of the nodes of one graph.
///
/// The key of a value node is made of its type and version, its parameters, the content of its files, its id and the
/// seed, and the content hashes of the values that it reads. A fold depends on streams, which have no content to hash
/// before they run; in their place stand the same parts of every node above it, up to the next values. The whole set of
/// these nodes is taken rather than a key of keys, so that a feedback loop is nothing special.
///
/// Window and threads are not in a key, since no result depends on them. Where a stream is cut, by `--until` or by the
/// longest node of its phase, the length is.
pub struct Keys<'a> {
    graph: &'a Graph,
    plan: &'a Plan,
    files: &'a dyn Files,
    seed: u64,
    /// Content of the files seen so far; `None` for those that cannot be read.
    contents: RefCell<HashMap<String, Option<blake3::Hash>>>,
}

impl<'a> Keys<'a> {
    /// Keys of a planned graph. A file is read once, however many nodes use it.
    #[must_use]
    pub fn new(graph: &'a Graph, plan: &'a Plan, files: &'a dyn Files, seed: u64) -> Self {
        Self { graph, plan, files, seed, contents: RefCell::default() }
    }

    /// The key of a node, given the content hashes of the values by node and port; `None` where a file cannot be read.
    ///
    /// # Complexity
    /// O(nodes and links above), and each file is read once.
    #[must_use]
    pub fn key(&self, n: usize, values: &dyn Fn(usize, usize) -> Option<[u8; 32]>) -> Option<Key> {
        let duration = self.plan.phases.iter().find(|p| p.nodes.contains(&n)).map(|p| p.duration);
        self.key_within(n, duration, values)
    }

    /// The key of the streams of a node that ends: until then it does not count how long an endless node above it runs.
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
        self.parts(n, "", duration, values, &mut parts, &mut known)?;
        let above: BTreeMap<&str, usize> =
            self.above(n).into_iter().map(|m| (self.graph.nodes[m].id.as_str(), m)).collect();
        for (id, m) in above {
            self.parts(m, &format!("{id}."), duration, values, &mut parts, &mut known)?;
        }
        let hash = known.then(|| {
            let mut hasher = blake3::Hasher::new();
            hasher.update(RECIPE);
            for text in parts.iter().flat_map(|(name, what)| [name, what]) {
                hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
            }
            hasher.finalize()
        });
        Some(Key { parts, hash })
    }

    /// Of some nodes those for which every file behind them still has the content that their keys were made of.
    pub fn still(&self, nodes: &mut Vec<usize>) {
        let fresh = Self::new(self.graph, self.plan, self.files, self.seed);
        let any = |_, _| Some([0; 32]);
        nodes.retain(|&n| self.key(n, &any) == fresh.key(n, &any));
    }

    /// All nodes whose streams a node depends on, without itself.
    #[must_use]
    pub fn above(&self, n: usize) -> BTreeSet<usize> {
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

    fn parts(
        &self,
        n: usize,
        prefix: &str,
        duration: Option<Tick>,
        values: &dyn Fn(usize, usize) -> Option<[u8; 32]>,
        parts: &mut Vec<Part>,
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
            let what = match kind {
                Some(ParamKind::Output) => continue,
                Some(ParamKind::Asset) => self.asset(&datum, node.ty.exposes_paths, &mut named)?,
                _ => datum.to_string(),
            };
            parts.push((format!("{prefix}{name}"), what));
        }
        // Files that are named by other files, such as the buffers of a glTF scene.
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
                let what = match (spec.kind, values(link.node, link.port)) {
                    (PortKind::Value(_), Some(hash)) => blake3::Hash::from_bytes(hash).to_string(),
                    (PortKind::Value(_), None) => {
                        *known = false;
                        UNKNOWN.to_owned()
                    }
                    _ => format!("{}.{}", from.id, from.ty.outputs[link.port].name),
                };
                parts.push((name, what));
            }
        }
        Some(())
    }

    /// What the files of a parameter hold. The ending counts too, since readers go by it.
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

/// How two lists of parts differ: name, what it was, what it is.
#[must_use]
pub fn changes<'p>(was: &'p [Part], is: &'p [Part]) -> Vec<(&'p str, Option<&'p str>, Option<&'p str>)> {
    let get = |parts: &'p [Part]| -> BTreeMap<&'p str, &'p str> {
        parts.iter().map(|(name, what)| (name.as_str(), what.as_str())).collect()
    };
    let (was, is) = (get(was), get(is));
    let names: BTreeSet<&str> = was.keys().chain(is.keys()).copied().collect();
    let both = names.into_iter().map(|name| (name, was.get(name).copied(), is.get(name).copied()));
    both.filter(|(_, was, is)| was != is).collect()
}
