//! The synthesis by comparing every node of a model, for comparison with the search.

use super::*;
use std::cell::RefCell;
use std::collections::HashSet;

/// The same by comparing each node of the model, level by level over the whole output.
pub(super) fn naive(
    model: &TextureModel,
    constraints: &Constraints,
    rules: &SynthesisRules,
    roots: usize,
    seed: u64,
) -> Vec<Vec<u32>> {
    let random = Random::new(seed, "texture");
    let depth = model.tree.depth as usize;
    let mut picks: Vec<Vec<u32>> = (0..depth).map(|l| vec![NONE; roots << l]).collect();
    // The candidates that are left of each node.
    let mut remaining: Vec<Vec<Vec<u32>>> = (0..depth).map(|l| vec![Vec::new(); roots << l]).collect();
    let passes = (0..roots).flat_map(|root| (0..depth).map(move |pass| (root, pass)));
    for (root, pass) in passes {
        let level = pass.saturating_sub(1);
        for node in root << level..(root + 1) << level {
            let parents = if level > 0 { &remaining[level - 1][node / 2][..] } else { &[] };
            let (pick, left) =
                naive_choice(model, constraints, rules, &random, &picks, parents, level, node, pass == 0);
            remaining[level][node] = left;
            if pass == 0 {
                picks[0][node] = pick;
            } else {
                picks[level + 1][2 * node] = 2 * pick;
                picks[level + 1][2 * node + 1] = 2 * pick + 1;
            }
        }
    }
    picks
}

#[allow(clippy::too_many_arguments)]
fn naive_choice(
    model: &TextureModel,
    constraints: &Constraints,
    rules: &SynthesisRules,
    random: &Random,
    picks: &[Vec<u32>],
    parents: &[u32],
    level: usize,
    node: usize,
    is_root: bool,
) -> (u32, Vec<u32>) {
    let left = RefCell::new(Vec::new());
    let similar = |level: usize, a: u32, b: u32| {
        let (a, b) = (source_value(model, level, a), source_value(model, level, b));
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= model.thresholds[level])
    };
    let ancestors = |c: u32| {
        if is_root {
            return 1;
        }
        let mut sum = 0.0;
        let each: Vec<bool> = (0..=level)
            .map(|up| match rules.criterion {
                MatchCriterion::PerCoefficient => similar(level - up, c >> up, picks[level - up][node >> up]),
                MatchCriterion::RunningMean => {
                    let [a, b] =
                        [c >> up, picks[level - up][node >> up]].map(|m| source_value(model, level - up, m));
                    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    sum += f64::from(difference) / f64::from(model.thresholds[level - up]);
                    sum / (up + 1) as f64 <= 0.5
                }
            })
            .collect();
        match rules.count {
            _ if !each[0] => 0,
            MatchCount::Consecutive => each.iter().take_while(|is| **is).count(),
            MatchCount::Total => each.iter().filter(|is| **is).count(),
        }
    };
    let predecessors = |c: u32| {
        let k = if level == 0 { rules.root_predecessors } else { rules.predecessors };
        let ok = |j: &usize| {
            *j <= node
                && predecessor(model, level, c, *j as u32)
                    .is_some_and(|m| similar(level, m, picks[level][node - j]))
        };
        match rules.count {
            MatchCount::Consecutive => (1..=k).take_while(ok).count(),
            MatchCount::Total => (1..=k).filter(ok).count(),
        }
    };
    let finest = picks.len() - 1;
    let root_before = |root: usize| picks[finest][(root << finest) - 1] >> finest;
    let too_long = |c: u32| {
        let (at, first, node, count) =
            if is_root { (0, c, node, 1) } else { (level + 1, 2 * c, 2 * node, 2) };
        let Some(longest) = rules.max_run else { return false };
        let (mut run, n0) = (count, node);
        let (mut m, mut n) = (first, node);
        while n > 0 && predecessor(model, at, m, 1) == Some(picks[at][n - 1]) {
            (m, n, run) = (picks[at][n - 1], n - 1, run + 1);
        }
        let root = if is_root { n0 } else { n0 >> (level + 1) } as u64;
        let before = (root > 0).then(|| model.envelopes.borders(root_before(root as usize))[1]);
        let (span, longest) = (model.tree.span(0) as f64, longest * model.tree.rate);
        let uniform = random.uniform(0, root, 2);
        let draw = if longest >= 3.0 * span { uniform.powf(1.75) } else { uniform };
        // Of recordings with borders before loud ones no stretch is shorter than a root, if two fit.
        let avoids = |before: u32| {
            let source = &model.tree.sources[model.tree.source_of(before)];
            let mut ends = (source.first..source.first + source.roots).map(|m| model.envelopes.borders(m)[1]);
            ends.any(|border| border.kind == BorderKind::BeforeLoud)
        };
        let is_whole = longest >= 2.0 * span && root > 0 && avoids(root_before(root as usize));
        let least = if is_whole { span.max(0.25 * longest) } else { 0.25 * longest };
        let drawn = least + (longest - least) * draw;
        let length = f64::from(run) * model.tree.span(at) as f64;
        run > count
            && match before.map(|border| border.kind) {
                Some(BorderKind::BeforeLoud) if level == 0 => length > drawn || length + span > longest,
                Some(BorderKind::Loud) => length > longest,
                _ => length > drawn,
            }
    };
    let not_alike = |c: u32| {
        let borders = |m: u32| model.envelopes.borders(m);
        let joins =
            |before: u32| predecessor(model, 0, c, 1) != Some(before) && borders(before)[1] != borders(c)[0];
        level == 0 && rules.max_run.is_some() && node > 0 && joins(root_before(node))
    };
    // One root that does not go on is no choice.
    let is_choice = |best: &Best| {
        !is_root || rules.max_run.is_none() || node == 0 || best.predecessors > 0 || best.nodes.len() > 1
    };
    let best_of = |nodes: Vec<u32>, admits: &dyn Fn(u32) -> bool| {
        let mut found: Option<Best> = None;
        for c in nodes
            .into_iter()
            .filter(|c| admits(*c) && !model.tree.is_masked(level, *c) && !model.is_redundant(level, *c))
        {
            let (a, b) =
                (ancestors(c), if is_root && rules.continuity.is_some() { 0 } else { predecessors(c) });
            if a == 0 {
                continue;
            }
            match &mut found {
                Some(best) if (a, b) == (best.ancestors, best.predecessors) => best.nodes.push(c),
                Some(best) if (a, b) < (best.ancestors, best.predecessors) => {}
                _ => found = Some(Best { ancestors: a, predecessors: b, nodes: vec![c] }),
            }
        }
        found
    };
    let weight = |c: u32| match rules.continuity {
        Some(scale) if is_root && node > 0 => predecessor(model, 0, c, 1).map_or(0.0, |m| {
            let difference = model.envelopes.relative_difference(m, picks[0][node - 1]);
            1.0 / (1.0 + (difference / scale).powi(8))
        }),
        _ => 1.0,
    };
    let children = || parents.iter().flat_map(|m| [2 * m, 2 * m + 1]).collect();
    let any = |admits: &dyn Fn(u32) -> bool| {
        let narrow = (rules.search == CandidateSearch::Narrow).then(|| best_of(children(), admits)).flatten();
        narrow.or_else(|| best_of((0..model.tree.nodes(level) as u32).collect(), admits))
    };
    let best = |admits: &dyn Fn(u32) -> bool| {
        let within = any(&|c| admits(c) && !too_long(c) && !not_alike(c)).filter(is_choice);
        within.or_else(|| any(&|c| admits(c) && !too_long(c))).or_else(|| any(admits))
    };
    let span = model.tree.span(level) as f64;
    let at = |node: f64| (node * span / RATE, (node + 1.0) * span / RATE);
    let mut forbidden = Vec::new();
    let (from, to) = at(node as f64);
    let own = constraints.at(from, to, Some(&mut forbidden)).greatest();
    let distance = (rules.look_ahead * RATE / span).round();
    let (from, to) = at(node as f64 + distance);
    let later = constraints
        .at(from, to, None)
        .greatest()
        .filter(|c| distance > 0.0 && own.is_none_or(|own: Constraint| own.set != c.set));
    let inside = |c: Constraint, m: u32| {
        let set = &constraints.sets[c.set];
        if !c.is_hard {
            set.centred[level].contains(m) == (c.weight > 0.0)
        } else if c.weight > 0.0 {
            set.included[level].contains(m)
        } else {
            !set.excluded[level].contains(m)
        }
    };
    let after = |c: u32| {
        let source = &model.tree.sources[model.tree.source_of(c >> level)];
        let m = c + distance as u32;
        (m < (source.first + source.roots) << level).then_some(m)
    };
    let allowed = |c: u32| !forbidden.iter().any(|set| constraints.sets[*set].excluded[level].contains(c));
    let now = |c: u32| own.is_none_or(|own| inside(own, c));
    let then = |c: u32| later.is_none_or(|later| after(c).is_some_and(|m| inside(later, m)));
    let index = node as u64;
    let entity = if is_root { 0 } else { level as u32 + 1 };
    let pick = |best: Best| {
        if !is_root {
            left.borrow_mut().clone_from(&best.nodes);
        }
        // What was heard of each root since other sounds were wanted: two halves.
        let root = node >> level;
        let wanted = |root: usize| {
            let [from, to] = [root, root + 1].map(|root| (root * model.tree.span(0)) as f64 / RATE);
            let mut forbidden = Vec::new();
            let set = constraints.at(from, to, Some(&mut forbidden)).greatest().map(|c| c.set);
            (set, forbidden.into_iter().collect::<HashSet<usize>>())
        };
        let begin = (0..root).rev().take_while(|r| wanted(*r) == wanted(root)).last().unwrap_or(root);
        let leaves = 1 << finest;
        let half = |h: usize| picks[finest][h / 2 * leaves + (leaves / 4) * (1 + 2 * (h % 2))] >> finest;
        let heard: Vec<u32> = ((2 * begin).max((2 * root).saturating_sub(2 * model.tree.roots()))..2 * root)
            .map(half)
            .collect();
        let class = |m: u32| model.envelopes.loudness(m);
        let all = 0..model.tree.roots() as u32;
        let preference = |m: u32| {
            let times = heard.iter().filter(|root| **root == m).count() as f64;
            let alike = heard.iter().filter(|root| class(**root) == class(m)).count() as f64;
            let share = all.clone().filter(|root| class(*root) == class(m)).count() as f64 / all.len() as f64;
            -times - 0.5 * (alike - share * heard.len() as f64)
        };
        let is_block = is_root || level == 0;
        let most = best.nodes.iter().map(|m| preference(*m)).fold(f64::NEG_INFINITY, f64::max);
        let preferred = |m: u32| weight(m) * if is_block { 10_f64.powf(preference(m) - most) } else { 1.0 };
        draw(&best.nodes, preferred, random.uniform(entity, index, 0)).unwrap()
    };
    // The node that differs least.
    let least = |admits: &dyn Fn(u32) -> bool| {
        let between = |level: usize, a: u32, b: u32| {
            let pairs = source_value(model, level, a).iter().zip(source_value(model, level, b));
            f64::from(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max))
        };
        let difference = |c: u32| {
            let up = 0..APPROXIMATE_ANCESTORS.min(level + 1);
            let above: f64 = up.map(|up| between(level - up, c >> up, picks[level - up][node >> up])).sum();
            let left = 1..=rules.predecessors.min(node);
            let before = left.map(|j| {
                between(level, predecessor(model, level, c, j as u32).unwrap(), picks[level][node - j])
            });
            before.fold(if is_root { 0.0 } else { above }, |sum, x| sum + x)
        };
        let nodes = || {
            (0..model.tree.nodes(level) as u32)
                .filter(|c| admits(*c) && !too_long(*c) && !model.is_redundant(level, *c))
        };
        let least = |a: &u32, b: &u32| difference(*a).total_cmp(&difference(*b));
        nodes().filter(|c| !not_alike(*c)).min_by(least).or_else(|| nodes().min_by(least)).unwrap()
    };
    let Some(main) = own.or(later) else {
        let picked = best(&allowed).map_or_else(|| least(&allowed), pick);
        return (picked, left.into_inner());
    };
    if main.is_hard && own.is_some() {
        let own = best(&|c| allowed(c) && now(c));
        // The first that matches well enough: without those that are too long, or with them.
        let is_enough = |w: &Best| own.as_ref().is_some_and(|own| !is_discarded(w, own, rules.percent()));
        let prepared = |c: u32| allowed(c) && now(c) && then(c) && later.is_some();
        let prepared = any(&|c| prepared(c) && !too_long(c) && !not_alike(c))
            .filter(|best| is_enough(best) && is_choice(best))
            .or_else(|| any(&|c| prepared(c) && !too_long(c)).filter(is_enough))
            .or_else(|| any(&prepared).filter(|w| rules.max_run.is_some() && is_enough(w)));
        let picked = prepared.or(own).map_or_else(|| least(&|c| allowed(c) && now(c)), pick);
        return (picked, left.into_inner());
    }
    let pair = |is_wanted: &dyn Fn(u32) -> bool| {
        let of = |limited: bool, alike: bool| {
            let kind = |kind: bool| {
                let is_within = |c: u32| !(limited && too_long(c) || alike && not_alike(c));
                any(&|c| allowed(c) && is_wanted(c) == kind && is_within(c))
            };
            match (kind(true), kind(false)) {
                (Some(w), Some(v)) if !is_root && is_discarded(&w, &v, rules.percent()) => (None, Some(v)),
                (Some(w), Some(v)) if !is_root && is_discarded(&v, &w, rules.percent()) => (Some(w), None),
                both => both,
            }
        };
        match of(true, true) {
            (Some(w), Some(v)) if is_choice(&w) && is_choice(&v) => (Some(w), Some(v)),
            _ if of(true, false) == (None, None) => of(false, false),
            _ => of(true, false),
        }
    };
    let mut both = pair(&|c| now(c) && then(c));
    if both.0.is_none() && own.is_some() && later.is_some() {
        both = pair(&now);
    }
    let picked = match both {
        (Some(w), Some(v)) => {
            let sets = &constraints.sets;
            let left: Vec<u32> = (0..model.tree.nodes(finest) as u32)
                .filter(|m| !forbidden.iter().any(|set| sets[*set].excluded[finest].contains(*m)))
                .collect();
            let own = left.iter().filter(|m| sets[main.set].centred[finest].contains(**m)).count() as f64;
            let all = left.len() as f64;
            let [of_w, of_v] = match rules.bias {
                WeightBias::Probability if main.weight > 0.0 => [own / all, 1.0 - own / all],
                WeightBias::Probability => [1.0 - own / all, own / all],
                _ => [&w, &v].map(|best| best.nodes.iter().map(|m| weight(*m)).sum()),
            };
            let p = probability(rules, main.weight, of_w, of_v);
            pick(if random.uniform(0, (node >> level) as u64, 1) < p { w } else { v })
        }
        (Some(w), None) => pick(w),
        (None, Some(v)) => pick(v),
        (None, None) => least(&allowed),
    };
    (picked, left.into_inner())
}
