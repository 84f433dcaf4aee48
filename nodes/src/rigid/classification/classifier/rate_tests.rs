//! Motions of closed form, logged at several rates: states, levels and impacts follow from the motion.

use super::*;
use crate::contact::vector::{add, cross};
use crate::rigid::{ImpactObjects, LogOptions, read_contacts};
use std::fmt::Write;

const G: f64 = 9.81;
const RATES: [f64; 3] = [60.0, 240.0, 1200.0];

/// State of the moving body at a time, and its contact with the floor during the frame that ends then.
#[derive(Clone, Copy, Default)]
struct Instant {
    position: Vec3,
    rotation: Quaternion,
    velocity: Vec3,
    angular_velocity: Vec3,
    contact: Option<Touch>,
}

#[derive(Clone, Copy, Default)]
struct Touch {
    point: Vec3,
    impulse: f64,
    approach: Option<f64>,
    depth: Option<f64>,
}

#[derive(Clone, Copy)]
struct Quaternion([f64; 4]);

impl Default for Quaternion {
    fn default() -> Self {
        Self([1.0, 0.0, 0.0, 0.0])
    }
}

impl Quaternion {
    fn about(axis: usize, angle: f64) -> Self {
        let mut q = [(0.5 * angle).cos(), 0.0, 0.0, 0.0];
        q[1 + axis] = (0.5 * angle).sin();
        Self(q)
    }

    fn then(self, Self([w, x, y, z]): Self) -> Self {
        let ([a, b, c, d], u) = (self.0, [x, y, z]);
        let v = [b, c, d];
        let [x, y, z] = add(add(scale(u, a), scale(v, w)), cross(v, u));
        Self([a * w - dot(v, u), x, y, z])
    }
}

type Classified = (Vec<(f64, ContactState)>, Vec<(f64, Impact)>);

/// Classifies a motion logged at a rate; the moving body has number 0 or 1 and a mass, the floor the other.
fn classify(
    rate: f64,
    seconds_: f64,
    body: usize,
    mass: f64,
    motion: &dyn Fn(f64, f64) -> Instant,
) -> Classified {
    let mut contacts = "time,a,b,px,py,pz,nx,ny,nz,impulse,approach,depth\n".to_owned();
    let mut poses = "time,body,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n".to_owned();
    for k in 1..=(seconds_ * rate) as u32 {
        let time = f64::from(k) / rate;
        let now = motion(time, 1.0 / rate);
        let ([x, y, z], [vx, vy, vz], [wx, wy, wz]) = (now.position, now.velocity, now.angular_velocity);
        let [qw, qx, qy, qz] = now.rotation.0;
        writeln!(poses, "{time},{body},{x},{y},{z},{qw},{qx},{qy},{qz},{vx},{vy},{vz},{wx},{wy},{wz}")
            .unwrap();
        let Some(touch) = now.contact else { continue };
        let ([x, y, z], up) = (touch.point, if body == 1 { 1 } else { -1 });
        let text = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        let (impulse, approach, depth) = (touch.impulse, text(touch.approach), text(touch.depth));
        writeln!(contacts, "{time},0,1,{x},{y},{z},0,0,{up},{impulse},{approach},{depth}").unwrap();
    }
    let mut masses = vec![0.0; 2];
    masses[body] = mass;
    let options = LogOptions { masses, rate: Some(rate), ..LogOptions::default() };
    let track = read_contacts(contacts.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
    let rules =
        Rules { frame: 1.05 / rate, struck: ImpactObjects::B, restitution: RESTITUTION, ..Rules::default() };
    let mut classifier = Classifier::new(rules, 64);
    let states = track.frames.iter().map(|(t, f)| (seconds(*t), classifier.take(*t, f).unwrap())).collect();
    classifier.advance_to(Tick::MAX);
    let mut impacts = Vec::new();
    while let Some((tick, impact)) = classifier.next_impact(Tick::MAX) {
        impacts.push((seconds(tick), impact));
    }
    (states, impacts)
}

/// State at each millisecond, and the mean square of the amplitude in dB.
fn timeline(states: &[(f64, ContactState)], duration: f64) -> (Vec<Option<State>>, f64) {
    let at = |time: f64| {
        let index = states.partition_point(|(t, _)| *t < time);
        states.get(index).filter(|(t, s)| t - time < seconds(s.frame.interval)).map(|(_, s)| s.state)
    };
    let line = (0..(duration * 1e3) as u32).map(|ms| at((f64::from(ms) + 0.5) * 1e-3)).collect();
    let power: f64 = states.iter().map(|(_, s)| f64::from(s.gain).powi(2) * seconds(s.frame.interval)).sum();
    (line, 10.0 * (power / duration).log10())
}

/// Logs a motion at all rates, compares states and levels with those at the highest, and returns the states.
fn agree(
    name: &str,
    duration: f64,
    body: usize,
    motion: &dyn Fn(f64, f64) -> Instant,
) -> Vec<Vec<(f64, ContactState)>> {
    let all = RATES.map(|rate| classify(rate, duration, body, 0.1, motion));
    let (right, level) = timeline(&all[2].0, duration);
    for (rate, (states, impacts)) in RATES.iter().zip(&all) {
        let (line, found) = timeline(states, duration);
        let same = line.iter().zip(&right).filter(|(a, b)| a == b).count() as f64 / right.len() as f64;
        println!("{name} at {rate} Hz: {:.1} % of the time, {found:.2} dB", 100.0 * same);
        assert!(
            same >= 0.95 && (found - level).abs() < 1.0,
            "{name} at {rate} Hz: {same}, {found} and {level} dB"
        );
        assert!(impacts.is_empty(), "{name} at {rate} Hz: {impacts:?}");
    }
    all.map(|(states, _)| states).into()
}

#[test]
fn a_coin_that_settles_rolls_at_the_speed_of_its_contact_point_at_any_rate() {
    let (radius, tilt) = (0.013, 0.15_f64);
    // It goes round at 30 rad/s and ever faster, more than a turn in a frame of 60 Hz.
    let turns = |t: f64| 30.0 * t + 75.0 * t * t;
    let speed = |t: f64| 30.0 + 150.0 * t;
    let coin = |t: f64, step: f64| {
        let (s, c) = turns(t).sin_cos();
        let lowest = [tilt.cos() * c, tilt.cos() * s, -tilt.sin()];
        let position = [0.0, 0.0, radius * tilt.sin()];
        Instant {
            position,
            rotation: Quaternion::about(2, turns(t))
                .then(Quaternion::about(1, tilt))
                .then(Quaternion::about(2, -turns(t) * tilt.cos())),
            angular_velocity: scale(lowest, -speed(t) * tilt.sin()),
            contact: Some(Touch {
                point: add(position, scale(lowest, radius)),
                impulse: 0.0075 * G * step,
                ..Touch::default()
            }),
            ..Instant::default()
        }
    };
    for body in [0, 1] {
        for states in agree("coin", 3.0, body, &coin) {
            for (t, s) in states.iter().filter(|(t, _)| *t > 0.3) {
                let right = radius * tilt.cos() * speed(*t);
                assert!(
                    s.state == State::Rolling && (f64::from(s.rolling) / right - 1.0).abs() < 0.05,
                    "{t}: {s:?}"
                );
            }
        }
    }
}

#[test]
fn a_drawer_that_goes_to_and_fro_slides_also_at_its_turning_points() {
    for (amplitude, frequency) in [(0.1, 0.7), (0.15, 0.5), (0.02, 3.0)] {
        let w = std::f64::consts::TAU * frequency;
        let drawer = |t: f64, step: f64| {
            let x = amplitude * (1.0 - (w * t).cos());
            let touch = Touch { point: [x, 0.0, 0.0], impulse: 15.0 * step, ..Touch::default() };
            Instant {
                position: [x, 0.0, 0.05],
                velocity: [amplitude * w * (w * t).sin(), 0.0, 0.0],
                contact: Some(touch),
                ..Instant::default()
            }
        };
        for body in [0, 1] {
            for states in agree("drawer", 3.0, body, &drawer) {
                assert!(states.iter().all(|(t, s)| *t < 0.25 || s.state == State::Sliding));
                // The sound follows the speed without a hole: friction of 0.4 times 15 N.
                let (t, s) = states[states.len() / 2];
                let power = 0.4 * 15.0 * (amplitude * w * (w * t).sin()).abs();
                assert!((f64::from(s.power) - power).abs() < 1e-3 * power + 1e-4, "{s:?} for {power}");
            }
        }
    }
}

#[test]
fn a_ball_that_skids_rolls_from_the_time_of_the_closed_form_at_any_rate() {
    let (radius, v0, mu, mass) = (0.02, 2.0, 0.3, 0.1);
    let rolls = 2.0 * v0 / (7.0 * mu * G);
    let ball = |t: f64, step: f64| {
        let (skid, rest) = (t.min(rolls), (t - rolls).max(0.0));
        let last = 2.5 * mu * G * rolls;
        let x = v0 * skid - 0.5 * mu * G * skid * skid + 5.0 / 7.0 * v0 * rest;
        let turned = (1.25 * mu * G * skid * skid + last * rest) / radius;
        Instant {
            position: [x, 0.0, radius],
            rotation: Quaternion::about(1, turned),
            velocity: [v0 - mu * G * skid, 0.0, 0.0],
            angular_velocity: [0.0, 2.5 * mu * G * skid / radius, 0.0],
            contact: Some(Touch { point: [x, 0.0, 0.0], impulse: mass * G * step, ..Touch::default() }),
        }
    };
    for (states, rate) in agree("ball", 2.0, 1, &ball).iter().zip(RATES) {
        let first = |state| states.iter().find(|(_, s)| s.state == state).map(|(t, _)| *t).unwrap();
        let (slides, late) = (first(State::Sliding), first(State::Rolling) - rolls);
        assert!(
            slides < 0.07 + 1.0 / rate && (-0.008..=1.1 / rate).contains(&late),
            "{slides} {late} at {rate} Hz"
        );
    }
}

#[test]
fn a_body_at_rest_is_static_at_any_rate() {
    let rest = |_: f64, step: f64| Instant {
        contact: Some(Touch { impulse: 5.0 * step, ..Touch::default() }),
        ..Instant::default()
    };
    for rate in RATES {
        let (states, impacts) = classify(rate, 1.0, 1, 0.1, &rest);
        assert!(impacts.is_empty() && states.iter().all(|(_, s)| s.gain == 0.0));
        assert!(states.iter().all(|(t, s)| *t < 0.25 || s.state == State::Static), "{rate} Hz");
    }
}

const RESTITUTION: f64 = 0.7;

/// Bounces of a ball from 1 m, in contact for `pulse` each: times and speeds of approach.
fn bounces(pulse: f64) -> Vec<(f64, f64)> {
    let (mut time, mut speed) = ((2.0 / G).sqrt(), (2.0 * G).sqrt());
    let mut all = Vec::new();
    for _ in 0..6 {
        all.push((time, speed));
        speed *= RESTITUTION;
        time += pulse + 2.0 * speed / G;
    }
    all
}

/// A ball that bounces, with a force of a half sine; `deep` is a known depth of penetration.
fn bouncing(mass: f64, pulse: f64, deep: bool) -> impl Fn(f64, f64) -> Instant {
    let all = bounces(pulse);
    move |t, step| {
        let (height, velocity) = match all.iter().rfind(|(start, _)| *start <= t) {
            None => (1.0 - 0.5 * G * t * t, -G * t),
            Some((start, speed)) => {
                let (since, v) = (t - start, speed * RESTITUTION);
                if since < pulse {
                    let phase = std::f64::consts::PI * since / pulse;
                    let share = 0.5 * (1.0 - phase.cos());
                    let depth = speed * pulse / std::f64::consts::PI * phase.sin();
                    (-depth, share * v - (1.0 - share) * speed)
                } else {
                    let free = since - pulse;
                    (v * free - 0.5 * G * free * free, v - G * free)
                }
            }
        };
        let touch =
            all.iter().find(|(start, _)| *start < t && t - step < start + pulse).map(|(start, speed)| {
                let share = |t: f64| {
                    0.5 * (1.0 - (std::f64::consts::PI * ((t - start) / pulse).clamp(0.0, 1.0)).cos())
                };
                Touch {
                    point: [0.0, 0.0, 0.0],
                    impulse: mass * speed * (1.0 + RESTITUTION) * (share(t) - share(t - step)),
                    approach: Some(if t - step < start + 0.5 * pulse { *speed } else { 0.0 }),
                    depth: deep.then_some(-height),
                }
            });
        let (position, velocity) = ([0.0, 0.0, 0.05 + height], [0.0, 0.0, velocity]);
        Instant { position, velocity, contact: touch, ..Instant::default() }
    }
}

#[test]
fn a_bounce_has_its_energy_impulse_and_time_at_30_to_1200_frames_per_second() {
    let mass = 0.2;
    for (known_mass, pulse, deep) in [(mass, 0.001, true), (mass, 0.003, false), (0.0, 0.001, true)] {
        for rate in [30.0, 60.0, 100.0, 240.0, 1200.0] {
            let (_, impacts) = classify(rate, 4.0, 1, known_mass, &bouncing(mass, pulse, deep));
            assert_eq!(impacts.len(), 6, "{rate} Hz");
            for ((at, impact), (time, speed)) in impacts.iter().zip(bounces(pulse)) {
                let db = |found: f32, right: f64| 10.0 * (f64::from(found) / right).log10();
                let energy = db(impact.energy, 0.5 * mass * speed * speed);
                let impulse = db(impact.impulse, mass * speed * (1.0 + RESTITUTION));
                assert!(energy.abs() < 0.5 && impulse.abs() < 0.25, "{energy} and {impulse} dB at {rate} Hz");
                assert!((at - time).abs() < 0.002, "{at} for {time} at {rate} Hz");
            }
        }
    }
}

/// A plate on two edges over a table that shakes, in the frame of the table; steps of [`Rattle::STEP`].
struct Rattle {
    /// Height of the centre and its velocity, in m and m/s; impulse so far, N s; speed of approach of an edge that touches, m/s.
    steps: Vec<[f64; 4]>,
}

impl Rattle {
    const STEP: f64 = 1.0 / 24_000.0;
    const MASS: f64 = 0.4;

    /// The table shakes at a frequency in Hz with an amplitude in m.
    fn new(duration: f64, frequency: f64, amplitude: f64) -> Self {
        const HALF_LENGTH: f64 = 0.07;
        const STIFFNESS: f64 = 2e5;
        const DAMPING: f64 = 120.0;
        let inertia = Self::MASS * HALF_LENGTH * HALF_LENGTH / 2.0;
        let w = std::f64::consts::TAU * frequency;
        let (mut z, mut v, mut tilt, mut turn, mut impulse) = (0.0, 0.0, 0.004, 0.0, 0.0);
        let steps = (0..=(duration / Self::STEP) as usize)
            .map(|k| {
                let time = k as f64 * Self::STEP;
                let mut force = [0.0; 2];
                let mut approach = 0.0_f64;
                for (force, side) in force.iter_mut().zip([-HALF_LENGTH, HALF_LENGTH]) {
                    let (height, speed) = (z + side * tilt, v + side * turn);
                    if height < 0.0 {
                        *force = (-STIFFNESS * height - DAMPING * speed).max(0.0);
                        approach = approach.max(-speed);
                    }
                }
                let [left, right] = force;
                let shake = amplitude * w * w * (w * time).sin() * (4.0 * time).min(1.0);
                v += Self::STEP * ((left + right) / Self::MASS - G + shake);
                turn += Self::STEP * HALF_LENGTH * (right - left) / inertia;
                z += Self::STEP * v;
                tilt += Self::STEP * turn;
                impulse += Self::STEP * (left + right);
                [z, v, impulse, approach]
            })
            .collect();
        Self { steps }
    }

    /// Motion at a time: the plate also slides slowly to and fro.
    fn at(&self, time: f64, step: f64) -> Instant {
        let index = |t: f64| ((t.max(0.0) / Self::STEP).round() as usize).min(self.steps.len() - 1);
        let (from, to) = (index(time - step), index(time));
        let [height, velocity, until, _] = self.steps[to];
        let approach = self.steps[from + 1..=to].iter().map(|[.., v]| *v).fold(0.0, f64::max);
        let impulse = until - self.steps[from][2];
        let x = 0.02 * (4.0 * time).sin();
        let touch = Touch { point: [x, 0.0, 0.0], impulse, approach: Some(approach), depth: None };
        Instant {
            position: [x, 0.0, 0.01 + height],
            velocity: [0.08 * (4.0 * time).cos(), 0.0, velocity],
            contact: (impulse > 0.0).then_some(touch),
            ..Instant::default()
        }
    }
}

#[test]
fn a_plate_that_rattles_has_the_same_states_and_energy_of_impacts_at_any_rate() {
    let duration = 3.0;
    for (frequency, amplitude) in [(9.0, 5e-3), (13.0, 2.5e-3), (18.0, 1.5e-3), (25.0, 6e-4)] {
        let rattle = Rattle::new(duration, frequency, amplitude);
        let all = RATES.map(|rate| classify(rate, duration, 1, Rattle::MASS, &|t, step| rattle.at(t, step)));
        // Without a contact the plate is as silent as in an unsteady one.
        let states = |k: usize| {
            let (line, _) = timeline(&all[k].0, duration);
            line.into_iter().map(|s| s.unwrap_or(State::Unsteady)).collect::<Vec<_>>()
        };
        let energy = |k: usize| -> f64 { all[k].1.iter().map(|(_, impact)| f64::from(impact.energy)).sum() };
        let right = states(2);
        let rattling = right.iter().filter(|s| **s == State::Unsteady).count();
        assert!(rattling * 10 > right.len() * 7, "{rattling} of {} ms at {frequency} Hz", right.len());
        for (k, rate) in RATES.iter().enumerate().take(2) {
            let same =
                states(k).iter().zip(&right).filter(|(a, b)| a == b).count() as f64 / right.len() as f64;
            let db = 10.0 * (energy(k) / energy(2)).log10();
            println!("{frequency} Hz at {rate} Hz: {:.1} % of the time, {db:.2} dB", 100.0 * same);
            assert!(same >= 0.95 && db.abs() < 1.0, "{frequency} Hz at {rate} Hz: {same}, {db} dB");
        }
    }
}

#[test]
fn a_contact_without_poses_begins_its_depth_over_its_approach_before_the_frame() {
    let frame = |depth: f64| {
        let text = format!(
            "time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz,approach,depth_mm\n0.5,0,1,0,0,0,0,0,1,9,0,0,0.5,1,{depth}\n"
        );
        let text = text.clone() + &text.lines().nth(1).unwrap().replace("0.5,0,1", "0.51,0,1") + "\n";
        read_contacts(text.as_bytes(), None, &LogOptions::default()).unwrap().frames
    };
    for (depth, right) in [(6.0, 0.494), (0.0, 0.5), (-2.0, 0.496), (50.0, 0.49)] {
        let mut classifier = Classifier::new(Rules::default(), 4);
        for (tick, frame) in frame(depth) {
            classifier.take(tick, &frame);
        }
        classifier.advance_to(Tick::MAX);
        let (tick, _) = classifier.next_impact(Tick::MAX).unwrap();
        assert!((seconds(tick) - right).abs() < 1e-5, "{} for {right}", seconds(tick));
    }
    let bad = ContactFrame { depth: Some(f32::NAN), ..frame(1.0)[0].1 };
    assert!(Classifier::new(Rules::default(), 4).take(0, &bad).is_none());
}
