//! The force that a contact draws from a map of a surface.

use super::law::{Heading, Law, Moves, log2};
use super::plane::{Interp, Lanes, Patch, Plane};
use super::slew::Slew;
use super::voices::{CELL, Cell, Stretch};
use crate::texture::{DiscontinuityMap, FeatureMap, Grid, Pyramid, Surface, level_for};
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Corner of the high-pass that takes the mean from a map that is never negative, Hz.
const CORNER: f64 = 20.0;
/// Most levels of a pyramid: steps of 2048 pixels.
const LEVELS: usize = 13;

/// One level of a map: the map, and what one of its pixels is of a full one along x and y.
type Scaled<const C: usize> = (Plane<C>, [f64; 2]);

/// What is read of a map.
#[derive(Clone, Debug, PartialEq)]
enum Reading {
    /// A gradient along the way.
    Slope(Vec<Scaled<2>>),
    /// The change of a value along the way.
    Change(Vec<Scaled<1>>),
    /// A value.
    Value(Vec<Scaled<1>>),
}

/// A map of a surface, ready to be read at any place and at any speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMap {
    reading: Reading,
    surface: Surface,
    /// Factors of changes along x and y, where these are per metre in place of per pixel.
    per_metre: Option<[f32; 2]>,
}

fn levels(grid: &Grid, surface: &Surface) -> Vec<(Grid, [f64; 2])> {
    let pyramid = Pyramid::new(grid.clone(), surface.wrap);
    pyramid.levels.into_iter().take(LEVELS).map(|level| (level.grid, level.scale)).collect()
}

fn scalar(grid: &Grid, surface: &Surface) -> Vec<Scaled<1>> {
    let laid = |(grid, scale): (Grid, _)| (Plane::new([&grid], [[false; 2]], surface.wrap), scale);
    levels(grid, surface).into_iter().map(laid).collect()
}

impl SurfaceMap {
    /// The slope that a contact meets: the gradient of a map along its way.
    #[must_use]
    pub fn slope(map: &DiscontinuityMap) -> Self {
        let surface = map.surface;
        let both = levels(&map.gx, &surface).into_iter().zip(levels(&map.gy, &surface));
        let along = [[true, false], [false, true]];
        let laid = both.map(|((x, scale), (y, _))| (Plane::new([&x, &y], along, surface.wrap), scale));
        Self { reading: Reading::Slope(laid.collect()), surface, per_metre: None }
    }

    /// The size of the gradient of a map.
    #[must_use]
    pub fn size(map: &DiscontinuityMap) -> Self {
        let samples = map.gx.samples.iter().zip(&map.gy.samples).map(|(x, y)| x.hypot(*y)).collect();
        let size = Grid { width: map.gx.width, height: map.gx.height, samples };
        Self { reading: Reading::Value(scalar(&size, &map.surface)), surface: map.surface, per_metre: None }
    }

    /// How features change along the way of a contact, per pixel.
    #[must_use]
    pub fn feature_change(map: &FeatureMap) -> Self {
        Self {
            reading: Reading::Change(scalar(&map.grid, &map.surface)),
            surface: map.surface,
            per_metre: None,
        }
    }

    /// How heights in m change along the way of a contact, m/m.
    #[must_use]
    pub fn height_change(heights: &Grid, surface: Surface) -> Self {
        let per_metre = Some(surface.density.map(|d| d as f32));
        Self { reading: Reading::Change(scalar(heights, &surface)), surface, per_metre }
    }

    /// The strength of features.
    #[must_use]
    pub fn feature(map: &FeatureMap) -> Self {
        Self {
            reading: Reading::Value(scalar(&map.grid, &map.surface)),
            surface: map.surface,
            per_metre: None,
        }
    }

    /// How it lies on the surface.
    #[must_use]
    pub fn surface(&self) -> Surface {
        self.surface
    }

    /// Whether the sign of what is read depends on the direction; otherwise it is never negative.
    #[must_use]
    pub fn directional(&self) -> bool {
        !matches!(self.reading, Reading::Value(_))
    }

    /// Reads it at places of pixels from pixel `base`; `footprints` are pixels from one sample to the next, where any is
    /// above a half.
    #[inline(always)]
    fn read(
        &self,
        interp: Interp,
        places: &Places,
        footprints: Option<&Cell>,
        range: [usize; 2],
        out: &mut Cell,
    ) {
        let mut both = [[0.0; CELL]; 2];
        match &self.reading {
            Reading::Value(levels) => {
                let mut one = [[0.0; CELL]];
                each(
                    levels,
                    places,
                    footprints,
                    range,
                    &mut one,
                    #[inline(always)]
                    |patch, t| patch.values(interp, t),
                    #[inline(always)]
                    |patch, t, _| patch.values(interp, t),
                );
                *out = one[0];
                return;
            }
            Reading::Slope(levels) => each(
                levels,
                places,
                footprints,
                range,
                &mut both,
                #[inline(always)]
                |patch, t| patch.values(interp, t),
                #[inline(always)]
                |patch, t, _| patch.values(interp, t),
            ),
            Reading::Change(levels) => each(
                levels,
                places,
                footprints,
                range,
                &mut both,
                #[inline(always)]
                |patch, t| patch.gradient(interp, t),
                #[inline(always)]
                |patch, t, scale| {
                    let [x, y] = patch.gradient(interp, t);
                    [[x[0] * scale[0]], [y[0] * scale[1]]]
                },
            ),
        }
        let ([x, y], [ux, uy]) = (&both, self.per_metre.unwrap_or([1.0; 2]));
        for n in 0..CELL {
            out[n] = x[n] * (ux * places.tx[n]) + y[n] * (uy * places.ty[n]);
        }
    }
}

struct Places<'a> {
    base: [i64; 2],
    x: &'a Cell,
    y: &'a Cell,
    tx: &'a Cell,
    ty: &'a Cell,
}

/// Reads the samples of a range, each between the two levels that suit its step: `full` reads many places of the map
/// itself, `one` a place of a level whose pixels are as much smaller as it is told.
#[inline(always)]
fn each<const C: usize, const D: usize>(
    levels: &[Scaled<C>],
    places: &Places,
    footprints: Option<&Cell>,
    [from, to]: [usize; 2],
    out: &mut [Cell; D],
    full: impl Fn(&Patch<C>, &[Lanes; 2]) -> [Lanes; D],
    one: impl Fn(&Patch<C>, &[Lanes<1>; 2], [f32; 2]) -> [Lanes<1>; D],
) {
    let Some((map, _)) = levels.first() else { return };
    let Places { base, x, y, .. } = *places;
    let Some(footprints) = footprints else {
        map.read(base, [x, y], [from, to], out, full);
        return;
    };
    let last = levels.len() - 1;
    // A coarser level has a scale of its own; its places are found in double precision.
    let coarse = |level: usize, n: usize| {
        let Some((plane, scale)) = levels.get(level).filter(|_| level > 0) else {
            return map.at(base, [x[n], y[n]], |patch, t| one(patch, t, [1.0; 2]));
        };
        let at = [(base[0], x[n]), (base[1], y[n])].map(|(base, x)| base as f64 + f64::from(x));
        let at = [at[0] / scale[0], at[1] / scale[1]];
        let whole = at.map(f64::floor);
        let part = [0, 1].map(|k| (at[k] - whole[k]) as f32);
        let smaller = scale.map(|s| (1.0 / s) as f32);
        plane.at(whole.map(|x| x as i64), part, |patch, t| one(patch, t, smaller))
    };
    for n in from..to.min(CELL) {
        let depth = level_for(log2(footprints[n].max(0.5))).min(last as f32);
        let level = depth as usize;
        let way = depth - level as f32;
        let near = coarse(level, n);
        let far = if way > 0.0 { coarse((level + 1).min(last), n) } else { near };
        for (out, (near, far)) in out.iter_mut().zip(near.into_iter().zip(far)) {
            out[n] = near + way * (far - near);
        }
    }
}

/// What one contact leaves behind in a [`MapForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapVoice {
    heading: Heading,
    /// Last input and output of the high-pass.
    high: Option<[f32; 2]>,
}

/// The force of contacts that move over a map: `kappa (f/f_ref)^a (v/v_ref)^b m(t)`.
///
/// # Complexity
/// 16 pixels per sample and contact; 32 at speeds at which more than half a pixel is passed from one sample to the next.
#[derive(Clone, Debug)]
pub struct MapForce {
    simd: Level,
    /// Strength.
    pub law: Law,
    /// Size of the surface: 2 is everything twice as large.
    pub scale: Slew,
    interp: Interp,
    /// Feedback of the high-pass.
    feedback: f32,
    moves: Moves,
    x: Cell,
    y: Cell,
}

impl MapForce {
    /// A force at a sample rate.
    #[must_use]
    pub fn new(law: Law, scale: f64, interp: Interp, rate: f64) -> Self {
        let feedback = (-TAU * CORNER / rate).exp() as f32;
        let (simd, scale) = (Level::new(), Slew::new(scale, rate));
        Self { simd, law, scale, interp, feedback, moves: Moves::new(), x: [0.0; CELL], y: [0.0; CELL] }
    }

    /// Adds the force of one contact over one stretch, N.
    pub fn add(&mut self, map: &SurfaceMap, voice: &mut MapVoice, stretch: &Stretch, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, _simd => self.stretch(map, voice, stretch, out));
    }

    #[inline(always)]
    fn stretch(&mut self, map: &SurfaceMap, voice: &mut MapVoice, stretch: &Stretch, out: &mut [f32]) {
        let way = stretch.way();
        let [dx, dy] = map.surface.density;
        // Directions are those of pixels where changes are per pixel.
        let aspect =
            if map.per_metre.is_some() { [1.0; 2] } else { [dx / dy, dy / dx].map(|r| r.sqrt() as f32) };
        self.moves.follow(stretch, &way, aspect, &mut voice.heading);
        let base = self.place(stretch, &way, [dx, dy]);
        let range = [stretch.from, stretch.to];
        let size = self.scale.at(stretch.anchor);
        let dense = (dx.max(dy) / size / stretch.rate) as f32;
        let mut footprints = self.moves.speed;
        footprints.iter_mut().for_each(|v| *v *= dense);
        let far = stretch.part(&mut footprints).iter().any(|x| *x > 0.5);
        let Self { moves, x, y, .. } = &*self;
        let places = Places { base, x, y, tx: &moves.tx, ty: &moves.ty };
        let mut made = [0.0; CELL];
        map.read(self.interp, &places, far.then_some(&footprints), range, &mut made);
        if !map.directional() {
            high_pass(self.feedback, &mut voice.high, stretch.part(&mut made));
        }
        let sizes = self.scale.ends(stretch.anchor);
        self.law.apply(stretch, &self.moves, sizes, &mut made);
        out.iter_mut().zip(stretch.part(&mut made)).for_each(|(out, x)| *out += *x);
    }

    /// The places of a stretch in pixels from a pixel that is returned.
    #[inline(always)]
    fn place(&mut self, stretch: &Stretch, way: &[[f64; 2]; 4], density: [f64; 2]) -> [i64; 2] {
        let size = self.scale.at(stretch.anchor);
        let start = [0, 1].map(|k| way[0][k] * density[k] / size);
        let whole = start.map(f64::floor);
        let part = [0, 1].map(|k| start[k] - whole[k]);
        if self.scale.settled(stretch.anchor).is_some() {
            let [dx, dy] = density.map(|d| (d / size) as f32);
            let [px, py] = part.map(|p| p as f32);
            for n in 0..CELL {
                self.x[n] = px + dx * self.moves.x[n];
                self.y[n] = py + dy * self.moves.y[n];
            }
        } else {
            // All places move while the size does.
            for n in stretch.from..stretch.to.min(CELL) {
                let size = self.scale.at(stretch.anchor + n as i64);
                let at = |k: usize, local: f32| {
                    ((way[0][k] + f64::from(local)) * density[k] / size - whole[k]) as f32
                };
                self.x[n] = at(0, self.moves.x[n]);
                self.y[n] = at(1, self.moves.y[n]);
            }
        }
        whole.map(|x| x as i64)
    }
}

#[inline(always)]
fn high_pass(feedback: f32, state: &mut Option<[f32; 2]>, samples: &mut [f32]) {
    let Some(first) = samples.first() else { return };
    // A contact begins without a step.
    let [mut before, mut y] = state.unwrap_or([*first, 0.0]);
    for x in samples {
        y = feedback * (y + *x - before);
        before = *x;
        *x = y;
    }
    *state = Some([before, if y.abs() < 1e-20 { 0.0 } else { y }]);
}
