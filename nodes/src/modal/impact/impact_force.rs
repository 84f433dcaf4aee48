//! The force of impacts at audio rate, as a node.

use super::event::Impact;
use super::force_ring::ForceRing;
use super::pulse::{LONGEST, Law, PulseShape, SHORTEST, contact_time};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream};
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::core::time::{Rate, seconds, ticks};
use crate::core::unmatched::Unmatched;
use crate::{archive_state, choices, params, ports};

/// Time after an impact within which its micro-collisions start, in s.
const MICRO_SPAN: f64 = 0.015;

choices! {
    /// Law of the contact time over energy and hardness.
    pub enum ForceLaw {
        /// `tau (E / energy_ref)^(-1/10) (h / hardness_ref)^(-2/5)`, as between elastic spheres.
        Hertz,
        /// Always `tau`.
        Fixed,
        /// `tau - slope E`.
        LinearEnergy,
    }
}

choices! { @param PulseShape {
    /// `1 - cos`: smooth at both ends.
    Cosine,
    /// Half a period of a sine, as in most contact models.
    HalfSine,
    /// A Gaussian, cut off at three standard deviations.
    Gaussian,
    /// A single sample, the first one that is not before the impact: for the response of a bank itself.
    Impulse,
} }

params! {
    /// Turns impacts into force at audio rate, one pulse each.
    ///
    /// The integral of a pulse is exactly the impulse of its impact, for any time between two samples. Its length is the duration of
    /// the impact, or follows from energy and hardness, from 0.1 to 20 ms: hard and energetic impacts are short, and so bright.
    /// A pulse of less than four samples becomes a band-limited impulse of eight. Overlapping pulses add up.
    ///
    /// The channels of the output are contact points. An impact on a point beyond the last one goes to the last, and the summary
    /// counts it. The input has no sample rate, so this node has a parameter for it.
    ///
    /// # Randomness
    /// Times and strengths of micro-collisions depend on the seed and the index of the impact only.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 5. They state
    /// that energy and hardness modulate the duration and that the shape matters little; the law is Hertz's.
    pub struct ImpactForceParams {
        /// Law of the contact time over energy and hardness.
        law: ForceLaw = ForceLaw::Hertz;
        /// Contact time at the reference.
        tau: f64 = 0.001, unit "s", range 0.0001..=0.02;
        /// Energy of the reference.
        energy_ref: f64 = 0.1, unit "J", range 0.000000001..=1_000_000.0;
        /// Hardness of the reference: 1 is steel on stone, 0.01 rubber.
        hardness_ref: f64 = 1.0, unit "", range 0.000001..=1000.0;
        /// Decrease of the contact time per energy, for the law `LinearEnergy`.
        slope: f64 = 0.001, unit "s/J", range 0.0..=1000.0;
        /// Shape of a pulse.
        shape: PulseShape = PulseShape::Cosine;
        /// Smaller pulses within 15 ms after each impact, which share its impulse: rough or rattling contacts.
        micro: u16 = 0, unit "pulses", range 0..=4_u16;
        /// Number of the object whose impacts are read; None reads all.
        object: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Contact points, one channel each.
        points: u16 = 1, unit "points", range 1..=64_u16;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct ImpactForcePorts / ImpactForceIo {
        in {
            /// The impacts.
            impacts: Events<Impact>,
        }
        out {
            /// Force in N, one channel per contact point.
            force: Stream<f32>,
        }
    }
}

/// The node `ImpactForce`.
#[derive(Debug)]
pub struct ImpactForce {
    params: ImpactForceParams,
    random: Random,
    ring: ForceRing,
    /// Impacts so far.
    count: u64,
    /// Impacts on points beyond the last one.
    beyond_last: u64,
    /// Smallest and largest magnitude of an impulse, N s.
    impulses: [f32; 2],
    /// Impacts on other objects.
    others: Unmatched<u32>,
}

/// Range of impulses in dB above which the summary warns: impulses that far below the strongest are inaudible beside it.
const WIDE_RANGE: f64 = 80.0;

/// Warning about impulses whose strengths are far apart.
fn range_warning([low, high]: [f32; 2]) -> Option<String> {
    let range = 20.0 * (f64::from(high) / f64::from(low)).log10();
    (low > 0.0 && range > WIDE_RANGE).then(|| {
        format!(
            "impulses are {low:.1e} to {high:.1e} N s, {range:.0} dB apart: the soft ones are inaudible; are all of them in N s?"
        )
    })
}

impl ImpactForce {
    fn law(&self) -> Law {
        match self.params.law {
            ForceLaw::Hertz => Law::Hertz,
            ForceLaw::Fixed => Law::Fixed,
            ForceLaw::LinearEnergy => Law::LinearEnergy(self.params.slope),
        }
    }

    /// Adds the pulses of an impact `early` samples before the next sample.
    fn strike(&mut self, impact: &Impact, early: f64) {
        let p = &self.params;
        let (energy, hardness) = (f64::from(impact.energy), f64::from(impact.hardness) / p.hardness_ref);
        let time = if impact.duration > 0.0 {
            f64::from(impact.duration).clamp(SHORTEST, LONGEST)
        } else {
            contact_time(self.law(), p.tau, energy, p.energy_ref, hardness)
        };
        let uniform = |k: u16, lane| self.random.uniform(k.into(), self.count, lane);
        // The maximum weight halves with each micro-collision.
        let weight = |k: u16| if k == 0 { 1.0 } else { uniform(k, 0) * 0.5_f64.powi(k.into()) };
        let total: f64 = (0..=p.micro).map(weight).sum();
        let impulse = f64::from(impact.impulse);
        for k in 0..=p.micro {
            let delay = if k == 0 { 0.0 } else { uniform(k, 1) * MICRO_SPAN * p.rate.as_f64() };
            self.ring.add(delay - early, impact.point as usize, impulse * weight(k) / total, time, p.shape);
        }
        self.count += 1;
        if impulse != 0.0 {
            let size = impact.impulse.abs();
            let [low, high] = self.impulses;
            self.impulses = [if low == 0.0 { size } else { low.min(size) }, high.max(size)];
        }
        self.beyond_last += u64::from(impact.point >= u32::from(p.points));
    }
}

impl Node for ImpactForce {
    type Params = ImpactForceParams;
    type Ports = ImpactForcePorts;
    const NAME: &'static str = "ImpactForce";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 3.0;

    fn shape(p: &ImpactForceParams, s: &mut Shape<'_, '_, ImpactForcePorts>) -> Result<(), Reject> {
        s.tail(ticks(LONGEST + MICRO_SPAN) + p.rate.span(9));
        s.output(ImpactForcePorts::force, p.rate, Channels(p.points));
        Ok(())
    }

    fn build(p: &ImpactForceParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let ring = ForceRing::new(p.rate.as_f64(), p.points.into(), LONGEST + MICRO_SPAN);
        Ok(Self {
            params: p.clone(),
            random: cx.random,
            ring,
            count: 0,
            beyond_last: 0,
            impulses: [0.0; 2],
            others: Unmatched::default(),
        })
    }

    fn run(&mut self, mut io: ImpactForceIo<'_>) -> Result<(), Fault> {
        let (rate, width) = (io.force.rate(), io.force.width());
        let (mut next, mut out) = (io.force.first(), io.force.items());
        let object = self.params.object;
        for (tick, impact) in io.impacts.events() {
            if object.is_some_and(|o| o != impact.object) {
                self.others.add(impact.object);
                continue;
            }
            if !impact.is_valid() {
                continue;
            }
            let item = rate.first_at(*tick).max(next);
            let frames = ((item - next) as usize).min(out.len() / width);
            let (now, later) = out.split_at_mut(frames * width);
            self.ring.read(now);
            (next, out) = (item, later);
            self.strike(impact, seconds(rate.tick(item) - tick) * rate.as_f64());
        }
        self.ring.read(out);
        Ok(())
    }

    fn finish(&mut self, _: ImpactForceIo<'_>) -> Result<Summary, Fault> {
        let mut summary = vec![("impacts", self.count.into())];
        if self.beyond_last > 0 {
            summary.push(("beyond_the_last_point", self.beyond_last.into()));
        }
        summary.extend(range_warning(self.impulses).map(|text| ("warning", text.into())));
        Ok(summary)
    }

    fn retune(&mut self, new: &ImpactForceParams) -> Retune {
        if (new.points, new.rate) != (self.params.points, self.params.rate) {
            return Retune::Rebuild;
        }
        // Pulses that have started keep their shape.
        self.params = new.clone();
        Retune::Done
    }

    fn silence(&self) -> Option<Silence> {
        match self.count {
            0 => Silence::no_object("impact", self.params.object, self.others),
            _ => (self.impulses[1] == 0.0).then_some(Silence::Because("no impact has an impulse")),
        }
    }

    fn adopt(&mut self, old: &mut Self) {
        self.ring.take_state(&old.ring);
        (self.count, self.beyond_last, self.impulses) = (old.count, old.beyond_last, old.impulses);
        self.others = old.others;
    }

    archive_state!(ring, count, beyond_last, impulses, others);

    fn trial(rng: &mut Rng) -> (ImpactForceParams, MemoryFiles) {
        let params = ImpactForceParams::trial(rng);
        let object = params.object.map(|_| rng.below(3) as u32);
        let points = 1 + rng.below(3) as u16;
        (ImpactForceParams { object, points, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Tick;
    use crate::modal::Body;

    fn params() -> ImpactForceParams {
        ImpactForceParams { rate: Rate::hz(44_100), ..ImpactForceParams::read(&|_| None).unwrap() }
    }

    fn impact(energy: f64) -> Impact {
        Impact::from_energy(energy, Body { mass: 0.1, restitution: 0.5 })
    }

    fn force(p: ImpactForceParams, impacts: Vec<(Tick, Impact)>, window: Tick) -> Vec<f32> {
        let standalone =
            Standalone::new::<ImpactForce>(p).events(ImpactForcePorts::impacts, impacts, ticks(0.1));
        standalone.window(window).run().unwrap().stream(ImpactForcePorts::force)
    }

    fn area(samples: &[f32]) -> f64 {
        samples.iter().map(|f| f64::from(*f)).sum::<f64>() / 44_100.0
    }

    #[test]
    fn impulses_are_conserved_also_in_micro_collisions_and_overlaps() {
        for micro in [0, 4] {
            let impacts = vec![
                (1, impact(0.1)),
                (2, impact(4.0)),
                (ticks(0.05), impact(1e-4)),
                (ticks(0.1) - 1, impact(0.3)),
            ];
            let sum: f64 = impacts.iter().map(|(_, b)| f64::from(b.impulse)).sum();
            let samples = force(ImpactForceParams { micro, ..params() }, impacts, ticks(0.01));
            assert!((area(&samples) / sum - 1.0).abs() < 1e-6, "{} for {sum}", area(&samples));
        }
    }

    #[test]
    fn impulses_far_apart_have_a_warning() {
        let warned = |energies: [f64; 2]| {
            let impacts =
                energies.map(impact).into_iter().enumerate().map(|(k, i)| (ticks(0.01 * k as f64), i));
            let standalone = Standalone::new::<ImpactForce>(params()).events(
                ImpactForcePorts::impacts,
                impacts.collect(),
                ticks(0.1),
            );
            let run = standalone.run().unwrap();
            run.summary.iter().find(|(k, _)| *k == "warning").map(|(_, text)| text.to_string())
        };
        // A thousandth of the impulse is a millionth of the energy.
        assert_eq!(warned([1.0, 1e-6]), None);
        let text = warned([1e6, 1e-6]).unwrap();
        assert!(text.contains("120 dB apart") && text.contains("N s"), "{text}");
    }

    #[test]
    fn micro_collisions_fall_within_15_ms_at_times_from_the_seed() {
        // Pulses of 0.2 ms, so that they stand apart.
        let hit = Impact { duration: 2e-4, ..impact(0.1) };
        let onsets = |micro: u16, seed: u64| {
            let standalone = Standalone::new::<ImpactForce>(ImpactForceParams { micro, ..params() });
            let mut standalone =
                standalone.events(ImpactForcePorts::impacts, vec![(ticks(0.02), hit)], ticks(0.1));
            standalone.seed = seed;
            let force = standalone.run().unwrap().stream(ImpactForcePorts::force);
            let loud = |n: &usize| force[*n] > 1e-3 && force[*n - 1] <= 1e-3;
            (1..force.len()).filter(loud).map(|n| n as f64 / 44_100.0 - 0.02).collect::<Vec<_>>()
        };
        let mut differ = 0;
        for seed in 0..20 {
            for micro in 0..=4 {
                let found = onsets(micro, seed);
                // Two may fall on each other.
                assert!((1..=1 + usize::from(micro)).contains(&found.len()), "{micro}: {found:?}");
                assert!(found.iter().all(|t| (-1e-4..0.0151).contains(t)), "{found:?}");
                assert_eq!(found, onsets(micro, seed));
            }
            differ += usize::from(onsets(4, seed) != onsets(4, seed + 1));
        }
        let max = (0..20).map(|seed| onsets(4, seed).len()).max();
        assert!(differ == 20 && max == Some(5), "{differ} {max:?}");
    }

    #[test]
    fn an_impact_peaks_in_the_middle_of_its_contact() {
        let hit = Impact { duration: 0.002, ..impact(0.1) };
        let samples = force(params(), vec![(ticks(0.05), hit)], ticks(0.01));
        let moment: f64 = samples.iter().enumerate().map(|(n, f)| n as f64 * f64::from(*f)).sum();
        let middle = moment / 44_100.0 / area(&samples) / 44_100.0;
        assert!((middle - 0.051).abs() < 1e-7, "{middle}");
        let peak = samples.iter().copied().fold(0.0, f32::max);
        assert!((f64::from(peak) / (2.0 * f64::from(hit.impulse) / 0.002) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn only_impacts_on_the_object_are_read_and_points_are_channels() {
        let p = ImpactForceParams { object: Some(2), points: 2, ..params() };
        let hits = [(0, 0), (2, 0), (2, 1), (2, 9), (1, 1)];
        let hits = hits.map(|(object, point)| (ticks(0.02), Impact { object, point, ..impact(0.1) }));
        let standalone =
            Standalone::new::<ImpactForce>(p).events(ImpactForcePorts::impacts, hits.to_vec(), ticks(0.1));
        let run = standalone.run().unwrap();
        let samples = run.stream(ImpactForcePorts::force);
        let channel = |c: usize| area(&samples.iter().skip(c).step_by(2).copied().collect::<Vec<_>>());
        assert!((channel(1) / channel(0) - 2.0).abs() < 1e-6);
        assert_eq!(
            format!("{:?}", run.summary),
            r#"[("impacts", Number(3)), ("beyond_the_last_point", Number(1))]"#
        );
    }

    #[test]
    fn impacts_that_are_not_finite_are_skipped() {
        let hit = Impact { impulse: f32::NAN, ..impact(0.1) };
        assert!(force(params(), vec![(0, hit), (5, impact(0.0))], ticks(0.01)).iter().all(|f| *f == 0.0));
    }

    #[test]
    fn a_wrong_object_says_which_ones_there_are() {
        let hit = |object: u32| (ticks(0.02), Impact { object, ..impact(0.1) });
        let p = ImpactForceParams { object: Some(77), ..params() };
        let standalone = Standalone::new::<ImpactForce>(p);
        let run = standalone
            .events(ImpactForcePorts::impacts, vec![hit(1), hit(4), hit(1)], ticks(0.1))
            .run()
            .unwrap();
        let silent = run.summary.iter().find(|(k, _)| *k == "silent").unwrap();
        assert_eq!(silent.1, "no impact has object 77; there are 1, 4");
    }
}
