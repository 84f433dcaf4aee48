//! The side that may wait: builds graphs for the callback, and replaces one by another while it plays.

use super::callback::{Callback, Home, Order, Shared, Swap, tick};
use super::crew::{Crew, Pace};
use super::diff::{Edit, Fate, fates};
use super::layout::{Empty, Layout};
use super::meter::{Histogram, NodeMeter};
use super::moves::{Moves, pairs, place};
use super::ready::{Material, Ready, build, edit};
use super::union::{Outputs, Union, union};
use crate::diag::Diagnostic;
use crate::graph::Graph;
use crate::plan::{Draft, LivePlan, Region, Resume, SinksResume, What};
use crate::run::Site;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::time::Tick;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::Ordering::Acquire;
use std::time::{Duration, Instant};

/// Orders and answers that fit on their way.
const ROOM: usize = 64;

/// How to play.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Frames per window.
    pub quantum: usize,
    /// Seconds by which workers are ahead of the callback.
    pub lead: f64,
    /// Threads of workers; 0 leaves the work to [`Player::pump`].
    pub threads: usize,
    /// Whether the time in each node is measured.
    pub metered: bool,
    /// Channels of the device; as many as the graph has where it is `None`.
    pub channels: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self { quantum: 128, lead: 0.08, threads: 1, metered: false, channels: None }
    }
}

/// What plays, as far as this side knows it.
struct Playing {
    /// The graph of the last load; away only while it is being replaced.
    ready: Option<Ready>,
    /// Its layout, or that of the transition to it.
    plan: LivePlan,
    /// Ids by place in the graph that is laid out.
    ids: Vec<String>,
}

impl Playing {
    /// The part and the place in it where a node of the layout runs.
    fn place(&self, n: usize) -> Option<(usize, usize)> {
        place(&self.plan, What::Node(n))
    }
}

/// What a load came to.
#[derive(Debug)]
pub enum Reloaded {
    /// Nothing that plays is different.
    Nothing,
    /// The new graph takes over.
    Edit(Edit),
}

/// What the player has to say between loads.
#[derive(Debug)]
pub enum Told {
    /// The new graph has taken over; it is heard from here on.
    Heard,
    /// The transition is over.
    Settled,
    /// A node failed, and there is silence until the next load.
    Failed(Box<Diagnostic>),
}

/// A swap that the callback has not taken yet, with all that it takes to try again.
struct Sent {
    /// What the callback plays until then.
    plan: LivePlan,
    ids: Vec<String>,
    heirs: Outputs,
    union: Option<Union>,
    moved: HashMap<usize, usize>,
    /// Whether the workers play it already.
    crew: bool,
}

/// Plays a graph: see [`Callback`] for the other side.
pub struct Player {
    options: Options,
    pace: Pace,
    shared: Arc<Shared>,
    orders: Producer<Order>,
    home: Consumer<Home>,
    crew: Crew,
    playing: Playing,
    /// The window from which on the new graph alone will do, while a transition is under way.
    fading: Option<u64>,
    /// The outputs that get the history of a cross-fade when the transition is over.
    heirs: Outputs,
    /// A retune is on its way to the callback.
    retuning: bool,
    /// The swap that is on its way to the callback.
    sent: Option<Sent>,
    /// A node has failed: nothing that plays can go on.
    failed: bool,
    /// What is still to be told.
    told: Vec<Told>,
    times: BTreeMap<String, Arc<Histogram>>,
    /// The longest time that it took to lay out a swap.
    haste: Duration,
}

impl Player {
    /// Makes both sides of a player.
    ///
    /// # Errors
    /// All that is wrong with the graph, as far as it has to play.
    pub fn start(material: Material, options: Options) -> Result<(Self, Callback), Vec<Diagnostic>> {
        let ready = Ready::new(material)?;
        let rate = ready.draft.rate;
        let quantum = options.quantum.max(1);
        let depth = (options.lead * rate.as_f64() / quantum as f64).ceil().max(2.0) as u64;
        let pace = Pace { rate, quantum, depth };
        let shared = Arc::new(Shared::default());
        let window = tick(rate, quantum, 1);
        let graph = &ready.material.graph;
        let draft = Draft::of_shapes(graph, ready.draft.prelude.shapes.clone(), ready.draft.prelude.limit)?;
        let plan = draft.plan(graph, window, &Resume::default(), &SinksResume::default())?;
        let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
        let channels = options.channels.unwrap_or(plan.channels);
        let mut times = BTreeMap::new();
        let layout = Layout {
            plan: &plan,
            ids: &ids,
            site: ready.site(window),
            values: &ready.values,
            built: HashMap::new(),
            moved: &HashMap::new(),
            pace,
            metered: options.metered,
        };
        let (act, mut gangs) = layout.parts(0, &mut times)?;
        for gang in &mut gangs {
            while gang.step(&pace, 0) {}
        }
        let mut crew = Crew::new(pace, Arc::clone(&shared), options.threads);
        crew.take(gangs);
        let (orders, taken) = RingBuffer::new(ROOM);
        let (sent, home) = RingBuffer::new(ROOM);
        let callback = Callback::new(act, (taken, sent), Arc::clone(&shared), rate, quantum, channels);
        let player = Self {
            options,
            pace,
            shared,
            orders,
            home,
            crew,
            playing: Playing { ready: Some(ready), plan, ids },
            fading: None,
            heirs: Outputs::new(),
            retuning: false,
            sent: None,
            failed: false,
            told: Vec::new(),
            times,
            haste: Duration::from_millis(1),
        };
        Ok((player, callback))
    }

    /// How it plays.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Windows by which workers are ahead of the callback.
    #[must_use]
    pub fn depth(&self) -> u64 {
        self.pace.depth
    }

    /// What both sides can see.
    #[must_use]
    pub fn shared(&self) -> &Arc<Shared> {
        &self.shared
    }

    /// The layout that plays.
    #[must_use]
    pub fn plan(&self) -> &LivePlan {
        &self.playing.plan
    }

    /// The graph of the last load.
    #[must_use]
    pub fn graph(&self) -> Option<&Graph> {
        self.playing.ready.as_ref().map(|ready| &ready.material.graph)
    }

    /// Times of the nodes, where they are measured.
    #[must_use]
    pub fn node_meters(&self) -> Vec<NodeMeter> {
        let known = self.times.iter().filter(|(id, times)| !id.starts_with('~') && times.calls() > 0);
        known.map(|(id, times)| NodeMeter::of(id, times)).collect()
    }

    /// Whether a transition is under way; a load has to wait until it is over.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.retuning || self.sent.is_some() || self.fading.is_some()
    }

    /// Whether the piece has been heard to its end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let played = tick(self.pace.rate, self.pace.quantum, self.shared.window.load(Acquire));
        !self.is_busy() && self.playing.plan.end.is_some_and(|end| played >= end)
    }

    /// Runs the workers, where they have no threads.
    pub fn pump(&mut self) {
        self.crew.pump();
    }

    /// Goes over to another graph, or to other parameters, while it plays.
    ///
    /// # Errors
    /// All that is wrong with it; what plays goes on then. Also while a transition is under way: see [`Player::is_busy`].
    pub fn load(&mut self, material: Material) -> Result<Reloaded, Vec<Diagnostic>> {
        if self.is_busy() {
            return Err(vec![Diagnostic::general("F091", "the transition before is not over")]);
        }
        let next = Ready::new(material)?;
        if next.draft.rate != self.pace.rate {
            let (found, wanted) = (next.draft.rate, self.pace.rate);
            let message = format!("the device plays at {wanted}, the graph is now at {found}");
            let found = Diagnostic::general("F045", message);
            return Err(vec![found.help("put Resample before the WavOut, or start foley live again")]);
        }
        let Some(current) = self.playing.ready.take() else {
            return Err(vec![Diagnostic::general("F099", "nothing plays: a defect in foley")]);
        };
        match self.go_over(&current, &next) {
            Ok(told) => {
                self.playing.ready = Some(next);
                Ok(told)
            }
            Err(errors) => {
                self.playing.ready = Some(current);
                Err(errors)
            }
        }
    }

    fn go_over(&mut self, current: &Ready, next: &Ready) -> Result<Reloaded, Vec<Diagnostic>> {
        let window = tick(self.pace.rate, self.pace.quantum, 1);
        let (old, new) = (current.side(), next.side());
        let plays = &current.draft.nodes;
        let mut fates = fates(&old, plays, &new, &next.draft);
        let built = build(&old, next, window, &mut fates)?;
        let edit = edit(&old, plays, next, &fates);
        let kept = fates.iter().filter_map(|(&n, fate)| match fate {
            Fate::Same(m) | Fate::Retuned(m, _) => Some((n, *m)),
            Fate::New => None,
        });
        let kept: HashMap<usize, usize> = kept.collect();
        if self.failed {
            self.swap(next, None, HashMap::new(), built, Vec::new())?;
            return Ok(Reloaded::Edit(edit));
        }
        let union = union(&old, &new, &fates, (&current.draft.heard, &next.draft.heard));
        let retunes = fates.into_iter().filter_map(|(n, fate)| match fate {
            Fate::Retuned(_, params) => Some((n, params)),
            _ => None,
        });
        let retunes: Vec<(usize, Box<dyn AnyParams>)> = retunes.collect();
        let fed = union.fed.iter().map(|&n| next.material.graph.nodes[n].id.clone()).collect();
        let edit = Edit { fed, ..edit };
        let same =
            union.is_plain() && edit.rebuilt.is_empty() && edit.added.is_empty() && edit.fed.is_empty();
        let ids = next.material.graph.nodes.iter().map(|n| &n.id);
        if same && edit.removed.is_empty() && ids.eq(&self.playing.ids) {
            return Ok(self.retune(retunes, edit));
        }
        let union = (!union.is_plain()).then_some(union);
        let moved = match &union {
            Some(union) => union.moved.clone(),
            None => kept,
        };
        self.swap(next, union, moved, built, retunes)?;
        Ok(Reloaded::Edit(edit))
    }

    /// Gives new parameters to nodes that play; nothing else is different.
    fn retune(&mut self, retunes: Vec<(usize, Box<dyn AnyParams>)>, edit: Edit) -> Reloaded {
        let told = if retunes.is_empty() { Reloaded::Nothing } else { Reloaded::Edit(edit) };
        let last = self.playing.plan.regions.len() - 1;
        let mut in_callback = Vec::new();
        for (n, params) in retunes {
            match self.playing.place(n) {
                Some((region, place)) if region == last => in_callback.push((place, params)),
                Some((region, place)) => self.crew.retune(region, place, params),
                None => {}
            }
        }
        if !in_callback.is_empty() {
            self.retuning = self.orders.push(Order::Retune(in_callback)).is_ok();
        } else if matches!(told, Reloaded::Edit(_)) {
            self.told.push(Told::Heard);
        }
        told
    }

    /// The window before which a swap that is laid out now can be done, at most `most` windows from now.
    fn soon(&self, most: u64) -> u64 {
        let one = self.pace.quantum as f64 / self.pace.rate.as_f64();
        let margin = (3.0 * self.haste.as_secs_f64() / one).ceil() as u64 + 2;
        self.shared.window.load(Acquire) + margin.min(most)
    }

    /// Lays out `next`, or the transition to it, and sends it to the callback.
    ///
    /// What does not depend on the time has been done before: from here on the callback runs towards the swap.
    fn swap(
        &mut self,
        next: &Ready,
        mut union: Option<Union>,
        moved: HashMap<usize, usize>,
        built: HashMap<usize, Box<dyn DynNode>>,
        retunes: Vec<(usize, Box<dyn AnyParams>)>,
    ) -> Result<(), Vec<Diagnostic>> {
        let start = Instant::now();
        let window = tick(self.pace.rate, self.pace.quantum, 1);
        let mut at = self.soon(u64::MAX);
        let mut plan = self.plan_at(next, union.as_ref(), &moved, at, window)?;
        let mut gangs = None;
        if !self.crew_goes_on(&plan, &moved) {
            let mut halted = self.crew.halt();
            let furthest = halted.iter().map(|g| g.window).max().unwrap_or(0);
            if moved.is_empty() {
                at = self.soon(u64::MAX);
            } else {
                // Workers cannot be further ahead than this, or there is no room for what they send.
                at = self.soon(self.pace.depth).max(furthest);
                self.crew.align(&mut halted, at);
            }
            plan = self.plan_at(next, union.as_ref(), &moved, at, window)?;
            gangs = Some(halted);
        }
        let time = tick(self.pace.rate, self.pace.quantum, at);
        let over = union.as_mut().map(|union| union.set_fades(&plan.delays, time));
        let adopts = union.as_ref().map(|u| u.adopts.clone()).unwrap_or_default();
        let seeds = union.as_ref().map(Union::seeds).unwrap_or_default();
        let heirs = std::mem::take(&mut self.heirs);
        let graph = union.as_ref().map_or(&next.material.graph, |u| &u.graph);
        let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
        let site = Site { graph, shapes: &plan.prelude.shapes, ..next.site(window) };
        let values = union.as_ref().map_or(&next.values, |u| &u.values);
        let layout = Layout {
            plan: &plan,
            ids: &ids,
            site,
            values,
            built,
            moved: &moved,
            pace: self.pace,
            metered: self.options.metered,
        };
        let (act, mut new_gangs) = match layout.parts(at, &mut self.times) {
            Ok(parts) => parts,
            Err(errors) => {
                self.crew.take(gangs.unwrap_or_default());
                return Err(errors);
            }
        };
        let moves = Moves { old: &self.playing.plan, new: &plan, moved: &moved };
        let (crew, mut links) = (gangs.is_some(), Vec::new());
        match gangs {
            None => links = moves.links(),
            Some(mut halted) => {
                for gang in &mut new_gangs {
                    for old in &mut halted {
                        let was = &self.playing.plan.regions[old.region];
                        let own = &plan.regions[gang.region];
                        let (nodes, buffers) = moves.between(old.region, gang.region);
                        let stage = &mut gang.stage;
                        pairs(was, own, &seeds).iter().for_each(|&(a, b)| stage.seed(&mut old.stage, a, b));
                        stage.take_over(&mut old.stage, &nodes, &buffers);
                        pairs(was, own, &heirs).iter().for_each(|&(a, b)| stage.seed(&mut old.stage, a, b));
                    }
                    moves.adopts(gang.region, &adopts).iter().for_each(|&(a, b)| gang.stage.adopt(a, b));
                    for (n, params) in &retunes {
                        if let Some((region, place)) = place(&plan, What::Node(*n))
                            && region == gang.region
                        {
                            gang.stage.nodes_mut()[place].node.retune(&**params);
                        }
                    }
                }
                self.crew.take(new_gangs);
            }
        }
        let last = plan.regions.len() - 1;
        let old_last = self.playing.plan.regions.len() - 1;
        let (nodes, buffers) = moves.between(old_last, last);
        let (in_callback, in_crew): (Vec<_>, Vec<_>) = retunes
            .into_iter()
            .filter_map(|(n, params)| Some((place(&plan, What::Node(n))?, params)))
            .partition(|((region, _), _)| *region == last);
        if !crew {
            in_crew.into_iter().for_each(|((region, place), params)| self.crew.retune(region, place, params));
        }
        let adopts = moves.adopts(last, &adopts);
        let retunes = in_callback.into_iter().map(|((_, place), params)| (place, params)).collect();
        let own = plan.callback();
        let was = self.playing.plan.callback();
        let (seeds, was_heirs) = (pairs(was, own, &seeds), pairs(was, own, &heirs));
        let cut = moved.is_empty();
        let swap = Swap {
            at,
            act,
            nodes,
            buffers,
            seeds,
            heirs: was_heirs,
            links,
            adopts,
            retunes,
            cut,
            late: false,
        };
        // The ring is emptied before each load.
        let _ = self.orders.push(Order::Swap(Box::new(swap)));
        self.failed = false;
        let windows = |over: Tick| (over / window.max(1)) as u64 + 2;
        self.fading = over.map(windows);
        self.heirs = union.as_ref().map(Union::heirs).unwrap_or_default();
        let plan = std::mem::replace(&mut self.playing.plan, plan);
        let ids = std::mem::replace(&mut self.playing.ids, ids);
        self.sent = Some(Sent { plan, ids, heirs, union, moved, crew });
        self.haste = (self.haste / 2).max(start.elapsed()).min(Duration::from_millis(200));
        Ok(())
    }

    fn plan_at(
        &self,
        next: &Ready,
        union: Option<&Union>,
        moved: &HashMap<usize, usize>,
        at: u64,
        window: Tick,
    ) -> Result<LivePlan, Vec<Diagnostic>> {
        let time = tick(self.pace.rate, self.pace.quantum, at);
        let (graph, shapes) = match union {
            Some(union) => (&union.graph, union.shapes.clone()),
            None => (&next.material.graph, next.draft.prelude.shapes.clone()),
        };
        let old = &self.playing.plan;
        let reached = |delay: Tick, from: Tick| from.max(time - delay);
        let kept = moved.iter().map(|(&n, &m)| {
            let (delay, from) = (old.delays.of[m], old.delays.from[m]);
            (n, (delay, reached(delay, from)))
        });
        let resume = Resume { at: time, kept: kept.collect() };
        let sinks = old.heard.iter().zip(&old.taps);
        let sinks = SinksResume {
            delay: old.taps.iter().map(|t| t.delay).max().unwrap_or(0),
            kept: sinks.map(|(h, t)| (h.id.clone(), reached(t.delay, t.from))).collect(),
        };
        Draft::of_shapes(graph, shapes, next.draft.prelude.limit)?.plan(graph, window, &resume, &sinks)
    }

    /// Whether all that runs ahead of the callback can go on as it is.
    fn crew_goes_on(&self, plan: &LivePlan, moved: &HashMap<usize, usize>) -> bool {
        let old = &self.playing.plan;
        let moves = Moves { old, new: plan, moved };
        old.regions.len() == plan.regions.len()
            && old.ahead().iter().zip(plan.ahead()).all(|(a, b)| {
                let jobs = |r: &Region| r.nodes.iter().map(|n| n.job).collect::<Vec<_>>();
                let before = |job: &What| match job {
                    What::Node(n) => moved.get(n).map(|&m| What::Node(m)),
                    What::Tap(_) => None,
                };
                let was: Option<Vec<What>> = jobs(b).iter().map(before).collect();
                was == Some(jobs(a))
                    && a.exports.len() == b.exports.len()
                    && a.buffers.len() == b.buffers.len()
            })
            && moves.links().len() == plan.callback().imports.len()
            && old.callback().imports.len() == plan.callback().imports.len()
    }

    /// Takes what has come home, and goes on with a transition that is due.
    pub fn tick(&mut self) -> Vec<Told> {
        while let Ok(home) = self.home.pop() {
            match home {
                Home::Retuned(_) => {
                    self.retuning = false;
                    self.told.push(Told::Heard);
                }
                Home::Swap(swap) if swap.late => self.try_again(*swap),
                // What played before is dropped here.
                Home::Swap(_) => {
                    self.sent = None;
                    self.told.push(Told::Heard);
                    if self.fading.is_none() {
                        self.told.push(Told::Settled);
                    }
                }
                Home::Fault(place, fault) => self.fail(None, place, fault),
            }
        }
        while let Some((region, place, fault)) = self.crew.fault() {
            self.fail(Some(region), place, fault);
        }
        let played = self.shared.window.load(Acquire);
        if self.sent.is_none() && self.fading.is_some_and(|over| played >= over) {
            self.settle();
        }
        std::mem::take(&mut self.told)
    }

    fn fail(&mut self, region: Option<usize>, place: usize, fault: Fault) {
        self.failed = true;
        // What has stopped has nothing to fade.
        self.fading = None;
        let fault = self.describe(region, place, fault);
        self.told.push(Told::Failed(Box::new(fault)));
    }

    /// Leaves the transition behind: the new graph alone.
    fn settle(&mut self) {
        self.fading = None;
        let Some(ready) = self.playing.ready.take() else { return };
        // The nodes of the new graph stand first in the transition, in their own order.
        let moved = ready.draft.nodes.iter().map(|&n| (n, n)).collect();
        // A layout that could be planned with its fades can be planned without.
        let _ = self.swap(&ready, None, moved, HashMap::new(), Vec::new());
        self.playing.ready = Some(ready);
    }

    /// Lays out a swap once more that came when the callback was behind its place.
    ///
    /// Where the workers have gone over to it already, and cannot go back, the graph begins anew.
    fn try_again(&mut self, mut late: Swap) {
        self.haste = (self.haste * 4).clamp(Duration::from_millis(2), Duration::from_millis(200));
        let (Some(sent), Some(ready)) = (self.sent.take(), self.playing.ready.take()) else { return };
        let laid_out = std::mem::replace(&mut self.playing.plan, sent.plan);
        (self.playing.ids, self.heirs, self.fading) = (sent.ids, sent.heirs, None);
        let result = if sent.crew || self.failed {
            self.heirs = Outputs::new();
            self.swap(&ready, None, HashMap::new(), HashMap::new(), Vec::new())
        } else {
            let node_at = |place: usize| match laid_out.callback().nodes.get(place).map(|n| n.job) {
                Some(What::Node(n)) => Some(n),
                _ => None,
            };
            let retunes = std::mem::take(&mut late.retunes).into_iter();
            let retunes = retunes.filter_map(|(place, params)| Some((node_at(place)?, params))).collect();
            let mut built = HashMap::new();
            for (place, node) in late.act.stage.nodes_mut().iter_mut().enumerate() {
                if let Some(n) = node_at(place).filter(|n| !sent.moved.contains_key(n)) {
                    built.insert(n, std::mem::replace(&mut node.node, Box::new(Empty)));
                }
            }
            // Fades begin at another time.
            let fades = sent.union.as_ref().map(Union::fade_nodes).unwrap_or_default();
            fades.iter().for_each(|n| drop(built.remove(n)));
            self.swap(&ready, sent.union, sent.moved, built, retunes)
        };
        if let Err(errors) = result {
            self.told.extend(errors.into_iter().map(|e| Told::Failed(Box::new(e))));
            self.failed = true;
        }
        self.playing.ready = Some(ready);
    }

    fn describe(&self, region: Option<usize>, place: usize, fault: Fault) -> Diagnostic {
        let (plan, ids) = match &self.sent {
            Some(sent) if !sent.crew => (&sent.plan, &sent.ids),
            _ => (&self.playing.plan, &self.playing.ids),
        };
        let region = region.unwrap_or(plan.regions.len() - 1);
        let job = plan.regions.get(region).and_then(|r| r.nodes.get(place)).map(|n| n.job);
        let id = match job {
            Some(What::Node(n)) => ids.get(n).map(|id| id.trim_start_matches('~')),
            _ => None,
        };
        match self.graph().zip(id).and_then(|(graph, id)| Some((graph, graph.find(id)?))) {
            Some((graph, n)) => {
                let at = graph.place(n, fault.field.as_deref());
                Diagnostic::of_fault(fault, at, &graph.nodes[n].id)
            }
            None => Diagnostic::general(fault.code, fault.message),
        }
    }
}
