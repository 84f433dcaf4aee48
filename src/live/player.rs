//! The side that may wait: builds graphs for the callback, and replaces one by another while it plays.

use super::callback::{Act, Callback, Home, Order, Shared, Swap, tick};
use super::crew::{Crew, Gang, Pace};
use super::diff::{Edit, Fate, Side, Stamps, fates};
use super::link::{self, Receiver, Sender};
use super::meter::{Histogram, NodeMeter};
use super::sink::Sink;
use super::union::{Outputs, Union, union};
use crate::diag::Diagnostic;
use crate::graph::{DirFiles, Graph};
use crate::memo::Memo;
use crate::plan::{Draft, Export, Import, LivePlan, Region, Resume, SinksResume, TrackPlan, What, ahead};
use crate::run::{self, DirOutputs, Job, Progress, Site, Values};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::input::Inputs;
use foley_nodes::core::node::{DynNode, Retune, Summary};
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::stage::{Cx, Stage};
use foley_nodes::core::time::Tick;
use foley_nodes::dsp::Dropout;
use rtrb::{Consumer, Producer, RingBuffer};
use std::any::Any;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::Ordering::Acquire;
use std::time::{Duration, Instant};

/// Seconds from sound to silence where none arrives.
const RAMP: f64 = 0.005;

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

/// A graph with all that it needs to play.
pub struct Material {
    /// The graph.
    pub graph: Graph,
    /// Its files.
    pub files: DirFiles,
    /// Seed of its randomness.
    pub seed: u64,
    /// Where values are kept, if at all.
    pub memo: Option<Memo>,
    /// What comes in while it plays.
    pub inputs: Arc<dyn Inputs>,
}

/// A graph that is ready to play but for its place in time.
struct Ready {
    material: Material,
    draft: Draft,
    values: Values,
    stamps: Stamps,
    computed: Vec<String>,
}

impl Ready {
    fn side(&self) -> Side<'_> {
        Side {
            graph: &self.material.graph,
            shapes: &self.draft.prelude.shapes,
            values: &self.values,
            seed: self.material.seed,
            stamps: &self.stamps,
            ahead: ahead(&self.material.graph, &self.draft.nodes),
        }
    }

    fn site(&self, quantum: Tick) -> Site<'_> {
        Site {
            graph: &self.material.graph,
            shapes: &self.draft.prelude.shapes,
            window: quantum,
            files: &self.material.files,
            outputs: &NOWHERE,
            inputs: &*self.material.inputs,
            seed: self.material.seed,
        }
    }
}

/// Where a graph that plays would write.
static NOWHERE: Nowhere = Nowhere;
struct Nowhere;

impl foley_nodes::core::files::Outputs for Nowhere {
    fn create(
        &self,
        path: &str,
    ) -> Result<Box<dyn foley_nodes::core::files::WriteSeek>, foley_nodes::core::files::FileError> {
        let message = format!("a graph that plays writes no files, and not {path:?}");
        Err(foley_nodes::core::files::FileError { code: "F080", message })
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

fn place(plan: &LivePlan, job: What) -> Option<(usize, usize)> {
    plan.regions.iter().enumerate().find_map(|(region, r)| {
        let place = r.nodes.iter().position(|node| node.job == job)?;
        Some((region, place))
    })
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
    /// The outputs that get the past of a cross-fade when the transition is over.
    heirs: Outputs,
    /// An order is on its way to the callback.
    waiting: bool,
    times: BTreeMap<String, Arc<Histogram>>,
    /// The longest time that it took to lay out a swap.
    haste: Duration,
}

/// Stands where a node will be that plays elsewhere until the swap.
struct Empty;

impl DynNode for Empty {
    fn run(&mut self, _: &Cx<'_>) -> Result<(), Fault> {
        Err(Fault::new("F099", "a node was not moved: a defect in foley"))
    }
    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// Shapes a graph and computes its values.
fn ready(material: Material) -> Result<Ready, Vec<Diagnostic>> {
    let draft = Draft::new(&material.graph, &material.files)?;
    let outputs = DirOutputs::new(".");
    let job = Job {
        graph: &material.graph,
        plan: &draft.prelude,
        files: &material.files,
        outputs: &outputs,
        taps: &[],
        threads: std::thread::available_parallelism().map_or(1, usize::from),
        seed: material.seed,
        memo: material.memo.as_ref(),
        progress: Arc::new(Progress::default()),
    };
    let (values, report) = run::values(&job)?;
    let makes_values = |n: &run::NodeReport| {
        let node = material.graph.find(&n.id).map(|k| &material.graph.nodes[k]);
        node.is_some_and(|node| node.ty.eval.is_some())
    };
    let computed = report.nodes.iter().filter(|n| makes_values(n) && n.calls > 0 && !n.cached);
    let computed = computed.map(|n| n.id.clone()).collect();
    let opened = draft.prelude.shapes.iter().flat_map(|s| &s.opened);
    let stamps = opened.map(|path| (path.clone(), material.files.stamp(path))).collect();
    Ok(Ready { material, draft, values, stamps, computed })
}

/// What a layout is made of.
struct Layout<'a> {
    plan: &'a LivePlan,
    ids: &'a [String],
    site: Site<'a>,
    values: &'a Values,
    /// Nodes that are new, as far as they have been built already.
    built: HashMap<usize, Box<dyn DynNode>>,
    /// Where nodes that go on were before.
    moved: &'a HashMap<usize, usize>,
    pace: Pace,
    metered: bool,
}

impl Layout<'_> {
    fn make(&mut self, job: What) -> Result<Box<dyn DynNode>, Diagnostic> {
        match job {
            What::Node(n) if self.moved.contains_key(&n) => Ok(Box::new(Empty)),
            What::Node(n) => match self.built.remove(&n) {
                Some(node) => Ok(node),
                None => self.site.build(n, self.values),
            },
            What::Tap(k) => {
                let link = &self.plan.heard[k].link;
                let width = self.site.shapes[link.node].outputs[link.port].as_ref().map_or(1, |s| s.width);
                Ok(Box::new(Sink::new(width, self.pace.quantum, self.ramp())))
            }
        }
    }

    /// Frames from sound to silence where none arrives.
    fn ramp(&self) -> usize {
        (self.pace.rate.as_f64() * RAMP) as usize
    }

    /// Makes all parts, which begin with window `window`.
    fn parts(
        mut self,
        window: u64,
        times: &mut BTreeMap<String, Arc<Histogram>>,
    ) -> Result<(Act, Vec<Gang>), Vec<Diagnostic>> {
        let mut errors = Vec::new();
        let mut stages = Vec::new();
        for region in &self.plan.regions {
            let values = self.values;
            match run::assemble(region, values, |job| self.make(job)) {
                Ok(mut stage) => {
                    stage.set_timed(self.metered);
                    stages.push(stage);
                }
                Err(e) => errors.extend(e),
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let mut timed = |region: &Region| -> Vec<Arc<Histogram>> {
            let id = |job| match job {
                What::Node(n) => self.ids[n].clone(),
                What::Tap(k) => format!("~heard {k}"),
            };
            let of = |node: &crate::plan::PlanNode| Arc::clone(times.entry(id(node.job)).or_default());
            if self.metered { region.nodes.iter().map(of).collect() } else { Vec::new() }
        };
        let callback = self.plan.callback();
        let mut links: Vec<Option<Receiver>> = callback.imports.iter().map(|_| None).collect();
        let act_stage = stages.pop();
        let mut gangs = Vec::new();
        for ((region, plan), stage) in self.plan.ahead().iter().enumerate().zip(stages) {
            let mut senders = Vec::new();
            for export in &plan.exports {
                let to = callback.imports.iter().position(|i| i.link == export.link);
                let Some(to) = to else { continue };
                let (sender, receiver) = self.link(&stage, plan, export, &callback.imports[to]);
                senders.push(sender);
                links[to] = Some(receiver);
            }
            let times = timed(plan);
            gangs.push(Gang { region, stage, links: senders, window, times, fault: None });
        }
        let is_sink = |node: &crate::plan::PlanNode| matches!(node.job, What::Tap(_));
        let sinks = (0..callback.nodes.len()).filter(|&k| is_sink(&callback.nodes[k])).collect();
        let Some(stage) = act_stage else { return Err(Vec::new()) };
        let times = timed(callback);
        Ok((Act { stage, links: links.into_iter().flatten().collect(), sinks, times }, gangs))
    }

    fn link(&self, stage: &Stage, plan: &Region, export: &Export, import: &Import) -> (Sender, Receiver) {
        let (node, port) = plan.origins[export.track];
        let stream = self.site.shapes[node].outputs[port].as_ref().filter(|s| s.item.wave);
        let bridge = stream.map(|s| Dropout::new(s.width, self.ramp()));
        let (from, to) = ((export.track, export.clock), (import.track, import.clock));
        link::link(self.pace.depth as usize + 2, from, to, bridge, || {
            stage.with_track(export.track, |track| track.sibling(export.items))
        })
    }
}

impl Player {
    /// Makes both sides of a player.
    ///
    /// # Errors
    /// All that is wrong with the graph, as far as it has to play.
    pub fn start(material: Material, options: Options) -> Result<(Self, Callback), Vec<Diagnostic>> {
        let ready = ready(material)?;
        let rate = ready.draft.rate;
        let quantum = options.quantum.max(1);
        let depth = (options.lead * rate.as_f64() / quantum as f64).ceil().max(2.0) as u64;
        let pace = Pace { rate, quantum, depth };
        let shared = Arc::new(Shared::default());
        let window = tick(rate, quantum, 1);
        let graph = &ready.material.graph;
        let draft = Draft::of_shapes(graph, ready.draft.prelude.shapes.clone())?;
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
            waiting: false,
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
        self.waiting || self.fading.is_some()
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
        let next = ready(material)?;
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
        if !in_callback.is_empty() && self.orders.push(Order::Retune(in_callback)).is_ok() {
            self.waiting = true;
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
            let furthest = halted.iter().map(|g| g.window).filter(|w| *w != u64::MAX).max().unwrap_or(0);
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
        // Where nothing goes on, the callback may still play something older than what was laid out last.
        let afresh = moved.is_empty();
        let moves = Moves { old: &self.playing.plan, new: &plan, moved: &moved };
        let mut links = Vec::new();
        match gangs {
            None => links = moves.links(),
            Some(mut halted) => {
                for gang in &mut new_gangs {
                    for old in halted.iter_mut().filter(|_| !afresh) {
                        let was = &self.playing.plan.regions[old.region];
                        let own = &plan.regions[gang.region];
                        let (nodes, tracks) = moves.between(old.region, gang.region);
                        let stage = &mut gang.stage;
                        pairs(was, own, &seeds).iter().for_each(|&(a, b)| stage.seed(&mut old.stage, a, b));
                        stage.take_over(&mut old.stage, &nodes, &tracks);
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
        let (nodes, tracks) = if afresh { Default::default() } else { moves.between(old_last, last) };
        let (in_callback, in_crew): (Vec<_>, Vec<_>) = retunes
            .into_iter()
            .filter_map(|(n, params)| Some((place(&plan, What::Node(n))?, params)))
            .partition(|((region, _), _)| *region == last);
        if !links.is_empty() || self.playing.plan.regions.len() == 1 {
            in_crew.into_iter().for_each(|((region, place), params)| self.crew.retune(region, place, params));
        }
        let adopts = moves.adopts(last, &adopts);
        let retunes = in_callback.into_iter().map(|((_, place), params)| (place, params)).collect();
        let own = plan.callback();
        let was = self.playing.plan.callback();
        let (seeds, heirs) =
            if afresh { Default::default() } else { (pairs(was, own, &seeds), pairs(was, own, &heirs)) };
        let swap = Swap { at, act, nodes, tracks, seeds, heirs, links, adopts, retunes, late: false };
        // The ring is emptied before each load.
        let _ = self.orders.push(Order::Swap(Box::new(swap)));
        self.waiting = true;
        let windows = |over: Tick| {
            let one = window.max(1);
            (over / one) as u64 + 2
        };
        self.fading = over.map(windows);
        self.heirs = union.as_ref().map(Union::heirs).unwrap_or_default();
        self.playing.plan = plan;
        self.playing.ids = ids;
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
        Draft::of_shapes(graph, shapes)?.plan(graph, window, &resume, &sinks)
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
                was == Some(jobs(a)) && a.exports.len() == b.exports.len() && a.tracks.len() == b.tracks.len()
            })
            && moves.links().len() == plan.callback().imports.len()
            && old.callback().imports.len() == plan.callback().imports.len()
    }

    /// Takes what has come home, and goes on with a transition that is due.
    pub fn tick(&mut self) -> Vec<Told> {
        let mut told = Vec::new();
        while let Ok(home) = self.home.pop() {
            match home {
                Home::Retuned(_) => {
                    self.waiting = false;
                    told.push(Told::Heard);
                }
                Home::Swap(swap) if swap.late => {
                    drop(swap);
                    self.waiting = false;
                    self.start_over();
                }
                Home::Swap(swap) => {
                    drop(swap);
                    self.waiting = false;
                    told.push(Told::Heard);
                    if self.fading.is_none() {
                        told.push(Told::Settled);
                    }
                }
                Home::Fault(place, fault) => {
                    let region = self.playing.plan.regions.len() - 1;
                    told.push(Told::Failed(Box::new(self.describe(region, place, fault))));
                }
            }
        }
        while let Some((region, place, fault)) = self.crew.fault() {
            told.push(Told::Failed(Box::new(self.describe(region, place, fault))));
        }
        let played = self.shared.window.load(Acquire);
        if !self.waiting && self.fading.is_some_and(|over| played >= over) {
            self.settle();
            if self.fading.is_none() && !self.waiting {
                told.push(Told::Settled);
            }
        }
        told
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

    /// Begins the graph anew, where the callback had gone on before a swap arrived.
    fn start_over(&mut self) {
        self.fading = None;
        self.haste = (self.haste * 4).min(Duration::from_millis(200));
        let Some(ready) = self.playing.ready.take() else { return };
        let _ = self.swap(&ready, None, HashMap::new(), HashMap::new(), Vec::new());
        self.playing.ready = Some(ready);
    }

    fn describe(&self, region: usize, place: usize, fault: Fault) -> Diagnostic {
        let job = self.playing.plan.regions.get(region).and_then(|r| r.nodes.get(place)).map(|n| n.job);
        let id = match job {
            Some(What::Node(n)) => self.playing.ids.get(n).map(|id| id.trim_start_matches('~')),
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

/// What goes where when one layout takes over from another.
struct Moves<'a> {
    old: &'a LivePlan,
    new: &'a LivePlan,
    moved: &'a HashMap<usize, usize>,
}

type Pairs = Vec<(usize, usize)>;

fn pad(track: &TrackPlan) -> Option<foley_nodes::core::track::Pad> {
    match track {
        TrackPlan::Items { pad, .. } => Some(*pad),
        TrackPlan::Events { .. } => None,
    }
}

/// The buffers of pairs of outputs, as far as both have one.
fn pairs(from: &Region, to: &Region, outputs: &Outputs) -> Pairs {
    let mut pairs = Pairs::new();
    for (a, b) in outputs {
        let Some(source) = from.origins.iter().position(|o| o == a) else { continue };
        let own = |t: &usize| to.origins[*t] == *b;
        pairs.extend((0..to.origins.len()).filter(own).map(|t| (source, t)));
    }
    pairs
}

impl Moves<'_> {
    /// The job in the old layout that a job of the new one goes on from.
    fn before(&self, job: What) -> Option<What> {
        match job {
            What::Node(n) => self.moved.get(&n).map(|&m| What::Node(m)),
            What::Tap(k) => {
                let old = self.old.heard.iter().position(|h| h.id == self.new.heard[k].id)?;
                let width = |plan: &LivePlan, k: usize| {
                    let link = &plan.heard[k].link;
                    plan.prelude.shapes[link.node].outputs[link.port].as_ref().map(|s| s.width)
                };
                (width(self.old, old) == width(self.new, k)).then_some(What::Tap(old))
            }
        }
    }

    /// Nodes and buffers that go from one part to another.
    fn between(&self, from: usize, to: usize) -> (Pairs, Pairs) {
        let (old, new) = (&self.old.regions[from], &self.new.regions[to]);
        let places: HashMap<What, usize> = (0..).zip(&old.nodes).map(|(k, n)| (n.job, k)).collect();
        let nodes = (0..)
            .zip(&new.nodes)
            .filter_map(|(k, node): (usize, _)| Some((*places.get(&self.before(node.job)?)?, k)));
        (nodes.collect(), self.tracks(old, new))
    }

    fn tracks(&self, old: &Region, new: &Region) -> Pairs {
        let key = |region: &Region, t: usize| (region.origins[t], pad(&region.tracks[t]));
        let places: HashMap<_, usize> = (0..old.tracks.len()).map(|t| (key(old, t), t)).collect();
        let pair = |t: usize| {
            let ((node, port), pad) = key(new, t);
            let was = (*self.moved.get(&node)?, port);
            Some((*places.get(&(was, pad))?, t))
        };
        (0..new.tracks.len()).filter_map(pair).collect()
    }

    /// Links into the callback that go on.
    fn links(&self) -> Pairs {
        let (old, new) = (self.old.callback(), self.new.callback());
        let tracks: HashMap<usize, usize> = self.tracks(old, new).into_iter().map(|(a, b)| (b, a)).collect();
        let pair = |(k, import): (usize, &Import)| {
            let was = tracks.get(&import.track)?;
            Some((old.imports.iter().position(|i| i.track == *was)?, k))
        };
        (0..).zip(&new.imports).filter_map(pair).collect()
    }

    /// Pairs of nodes in a part, by their places, of which the second takes over what fits from the first.
    fn adopts(&self, region: usize, adopts: &[(usize, usize)]) -> Pairs {
        let find = |n: usize| self.new.regions[region].nodes.iter().position(|p| p.job == What::Node(n));
        adopts.iter().filter_map(|&(a, b)| find(a).zip(find(b))).collect()
    }
}

/// Builds what is new, and finds out which nodes can take their new parameters.
fn build(
    old: &Side<'_>,
    next: &Ready,
    window: Tick,
    fates: &mut HashMap<usize, Fate>,
) -> Result<HashMap<usize, Box<dyn DynNode>>, Vec<Diagnostic>> {
    let site = next.site(window);
    let (mut built, mut errors) = (HashMap::new(), Vec::new());
    for &n in &next.draft.nodes {
        let mut make = || site.build(n, &next.values).map_err(|e| errors.push(e)).ok();
        match fates.get(&n) {
            Some(Fate::Retuned(m, _)) => {
                // Whether a node can go from one set of parameters to another is the same the other way round, so a
                // trial of the new node tells it of the one that plays.
                let was = &old.graph.nodes[*m].params;
                let takes = make().is_none_or(|mut trial| trial.retune(&**was) == Retune::Done);
                if takes {
                    continue;
                }
            }
            Some(Fate::New) => {}
            Some(Fate::Same(_)) | None => continue,
        }
        fates.insert(n, Fate::New);
        if let Some(node) = make() {
            built.insert(n, node);
        }
    }
    if errors.is_empty() { Ok(built) } else { Err(errors) }
}

fn edit(old: &Side<'_>, old_plays: &[usize], next: &Ready, fates: &HashMap<usize, Fate>) -> Edit {
    let graph = &next.material.graph;
    let mut edit = Edit { computed: next.computed.clone(), ..Edit::default() };
    for &n in &next.draft.nodes {
        let id = graph.nodes[n].id.clone();
        match fates.get(&n) {
            Some(Fate::Same(_)) => edit.kept += 1,
            Some(Fate::Retuned(..)) => {
                edit.kept += 1;
                edit.retuned.push(id);
            }
            _ if old_plays.iter().any(|&m| old.graph.nodes[m].id == id) => edit.rebuilt.push(id),
            _ => edit.added.push(id),
        }
    }
    let stays = |id: &str| next.draft.nodes.iter().any(|&n| graph.nodes[n].id == id);
    let gone = old_plays.iter().map(|&m| &old.graph.nodes[m].id).filter(|id| !stays(id));
    edit.removed = gone.cloned().collect();
    edit
}
