//! The node `TreeStep`.

use super::rules::SynthesisRules;
use super::step::predecessor;
use super::synthesizer::Synthesizer;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::plot::{Chart, Line};
use crate::soundtrack::wavelet::{TextureModel, WaveletTree};
use crate::table::ResultTable;
use crate::{params, ports};
use std::sync::Arc;

params! {
    /// Shows one step of the synthesis of a texture: the choice of the children of a node of the output.
    ///
    /// `table` has a row for each node that is involved. In the output these are the node, its ancestors, predecessors and children. In the
    /// recordings they are the candidates that match most ancestors, those of them that match most predecessors, and the one that was drawn with
    /// its ancestors, predecessors and children, which become those of the node. Tapped as SVG it draws both trees over time.
    ///
    /// # Randomness
    /// As in `TextureSynthesis` without a score.
    ///
    /// # Source
    /// Figure 2 of Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003).
    pub struct TreeStepParams {
        /// Time of the node in the output.
        time: f64 = 2.0, unit "s", range 0.0..=600.0;
        /// Level of the node, 0 for a root.
        level: usize = 4, unit "", range 0..=30;
        /// Number of predecessors that are compared.
        predecessors: usize = 5, unit "", range 0..=64;
    }
}
ports! {
    pub struct TreeStepPorts / TreeStepIo {
        in {
            /// The model.
            model: Value<TextureModel>,
        }
        out {
            /// The nodes that count.
            table: Value<ResultTable>,
        }
    }
}

/// Most candidates that are listed.
const MAX_LISTED: usize = 10_000;

/// Nodes of one role, of the output or of the recordings.
struct Role {
    name: &'static str,
    is_output: bool,
    /// True if each is the parent of the one before it.
    is_path: bool,
    /// Levels and nodes.
    nodes: Vec<(usize, i64)>,
}

/// Time of the middle of a node from the start of its recording, or of the output, s.
fn middle(tree: &WaveletTree, first: i64, level: usize, node: i64) -> f64 {
    ((node - (first << level)) as f64 + 0.5) * tree.span(level) as f64 / tree.rate
}

fn ancestors(level: usize, node: i64) -> Vec<(usize, i64)> {
    (1..=level).map(|up| (level - up, node >> up)).collect()
}

fn children(level: usize, node: i64) -> Vec<(usize, i64)> {
    vec![(level + 1, 2 * node), (level + 1, 2 * node + 1)]
}

/// The roles of the nodes of a step whose node of the output is `node`: four of the output, and then those of the recordings.
fn roles(s: &mut Synthesizer, model: &TextureModel, p: &TreeStepParams, node: i64) -> Vec<Role> {
    let level = p.level;
    let within = node as usize & ((1 << level) - 1);
    let (all, best) = s.candidates(level, within).unwrap_or_default();
    let drawn = s.pick(level + 1, 2 * within) / 2;
    let before = |j: usize| predecessor(model, level, drawn, j as u32).map(|m| (level, i64::from(m)));
    let of_drawn = (1..=p.predecessors).map_while(before).collect();
    let of_node = (1..=p.predecessors as i64).map(|j| (level, node - j)).filter(|(_, n)| *n >= 0).collect();
    let drawn = i64::from(drawn);
    let listed = |nodes: &[u32]| nodes.iter().take(MAX_LISTED).map(|m| (level, i64::from(*m))).collect();
    let output = |name, nodes| Role { name, is_output: true, is_path: name == "ancestors", nodes };
    let recording = |name, nodes| Role { name, is_output: false, is_path: name == "its ancestors", nodes };
    vec![
        output("ancestors", ancestors(level, node)),
        output("predecessors", of_node),
        output("node", vec![(level, node)]),
        output("children", children(level, node)),
        recording("by ancestors", listed(&all)),
        recording("by predecessors", listed(&best.nodes)),
        recording("its ancestors", ancestors(level, drawn)),
        recording("its predecessors", of_drawn),
        recording("drawn", vec![(level, drawn)]),
        recording("its children", children(level, drawn)),
    ]
}

/// The table of roles, with a chart of each tree.
fn table(s: &Synthesizer, tree: &WaveletTree, roles: &[Role], finest: usize) -> ResultTable {
    let seconds = |level: usize| tree.span(level) as f64 / tree.rate;
    let mut table = ResultTable::new(&["tree", "role", "level", "node", "time_s", "value"]);
    let mut lines: [Vec<Line>; 2] = [Vec::new(), Vec::new()];
    for role in roles {
        let mut points = Vec::with_capacity(role.nodes.len());
        for (level, node) in role.nodes.iter().copied() {
            let source = tree.sources.get(tree.source_of((node >> level) as u32)).filter(|_| !role.is_output);
            let (name, first) = source.map_or(("output", 0), |s| (s.name.as_str(), i64::from(s.first)));
            let time = middle(tree, first, level, node);
            let value = match role.is_output {
                true => s.value(level, node),
                false => tree.details[level].get(node as usize * tree.channels).copied(),
            };
            let value = value.map(f64::from);
            table.push([
                name.into(),
                role.name.into(),
                level.into(),
                (node as f64).into(),
                time.into(),
                value.into(),
            ]);
            points.push([time, seconds(level)]);
        }
        let line = if role.is_path { Line::new(role.name, points) } else { Line::dots(role.name, points) };
        lines[usize::from(!role.is_output)].push(line);
    }
    for (title, lines) in ["output", "recordings"].into_iter().zip(lines) {
        let mut chart = Chart::of(title, ("time, s", false), ("span of a node, s", true), lines);
        chart.y.range[0] = seconds(finest) / 1.5;
        table.charts.push(chart);
    }
    table
}

/// The node over [`Synthesizer::candidates`].
#[derive(Debug)]
pub struct TreeStep;

impl Func for TreeStep {
    type Params = TreeStepParams;
    type Ports = TreeStepPorts;
    const NAME: &'static str = "TreeStep";
    const VERSION: u32 = 6;

    fn eval(p: &TreeStepParams, cx: &Build<'_>, mut io: TreeStepIo<'_>) -> Result<Summary, Fault> {
        let model = cx.value(TreeStepPorts::model);
        let tree = &model.tree;
        let deepest = (tree.depth as usize).saturating_sub(2);
        if p.level > deepest {
            let message =
                format!("`level` is {}, and the children of level {deepest} are the leaves", p.level);
            return Err(Fault::new("F155", message)
                .at("level")
                .help(format!("give a level up to {deepest}")));
        }
        let rules = SynthesisRules { predecessors: p.predecessors, ..SynthesisRules::default() };
        let reach = tree.wavelet.reach() as i64 + 1;
        let mut s = Synthesizer::new(Arc::clone(&model), Arc::default(), rules, cx.random, -reach, None);
        let sample = (p.time * tree.rate) as i64;
        let last = sample >> tree.depth;
        for root in -reach..=last {
            if (cx.monitor)((root + reach) as f64 / (last + reach + 1) as f64) {
                return Err(Fault::stopped());
            }
            s.advance(None);
        }
        let node = sample / tree.span(p.level) as i64;
        let roles = roles(&mut s, &model, p, node);
        let count = |k: usize| roles.get(k).map_or(0, |role| role.nodes.len());
        io.table.set(table(&s, tree, &roles, p.level + 1));
        Ok(vec![("match_ancestors", count(4).into()), ("match_predecessors", count(5).into())])
    }

    fn trial(rng: &mut Rng) -> (TreeStepParams, MemoryFiles) {
        let p =
            TreeStepParams { time: rng.between(0.0, 0.5), level: rng.below(4), ..TreeStepParams::trial(rng) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::standalone::Standalone;

    fn step(p: TreeStepParams) -> Result<ResultTable, Fault> {
        let run = Standalone::func::<TreeStep>(p)
            .value(TreeStepPorts::model, TextureModel::trial(&mut Rng::new(3)))
            .run()?;
        Ok(run.value(0).unwrap().get::<ResultTable>().unwrap().clone())
    }

    #[test]
    fn the_children_are_those_of_a_candidate() {
        let p = TreeStepParams { time: 0.3, level: 3, ..TreeStepParams::read(&|_| None).unwrap() };
        let found = step(p).unwrap();
        let rows = |role: &str| -> Vec<(f64, f64)> {
            let own = found.rows.iter().filter(|row| row[1].text() == role);
            own.map(|row| (row[3].text().parse().unwrap(), row[5].text().parse().unwrap())).collect()
        };
        let (all, best) = (rows("by ancestors"), rows("by predecessors"));
        let drawn = rows("drawn")[0];
        assert!(
            best.iter().all(|one| all.contains(one)) && best.contains(&drawn),
            "{all:?} {best:?} {drawn:?}"
        );
        let (children, copied) = (rows("children"), rows("its children"));
        assert_eq!(
            children.iter().map(|c| c.1).collect::<Vec<_>>(),
            copied.iter().map(|c| c.1).collect::<Vec<_>>()
        );
        assert_eq!(copied[0].0, 2.0 * drawn.0);
        assert_eq!((rows("ancestors").len(), rows("predecessors").len()), (3, 5));
        assert!(found.plot().unwrap().matches("<circle").count() > 10);
        let leaf = TreeStepParams { level: 30, ..TreeStepParams::read(&|_| None).unwrap() };
        assert_eq!(step(leaf).unwrap_err().field.as_deref(), Some("level"));
    }
}
