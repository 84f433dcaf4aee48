//! Inverse Fourier transform noise: clips with the amplitudes of a friction model and random phases.
//!
//! # Source
//! Rodet and Depalle, "Spectral envelopes and inverse FFT synthesis" (1992); An, James and Marschner (SIGGRAPH 2012),
//! section 2.

use std::sync::Arc;

use foley_fft::RealFftPlanner;
use realfft::ComplexToReal;
use realfft::num_complex::Complex;
use thiserror::Error;

use super::clusters::Clusters;
use super::noise_params::{AreaWeight, Emitters, IftNoiseParams, Magnitude};
use super::phasors::{BLOCK, Rayleigh, phasors};
use super::receiver::{Mono, Receiver};
use super::speed_coverage::SpeedCoverage;
use crate::archive_state;
use crate::core::random::Random;
use crate::core::state::Stateful;
use crate::friction::model::spectrum_table::{Coverage, SpectrumTable};
use crate::friction::model::{FrictionModel, ModelError, REFERENCE_AREA, clip_samples};

/// Reasons why noise cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NoiseError {
    /// A model, rate or clip length that cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A vertex area that is negative or not finite.
    #[error("area of vertex {vertex} is {found} m^2; areas are finite and not negative")]
    Area {
        /// Index of the vertex.
        vertex: usize,
        /// Area found.
        found: f32,
    },
    /// A cell size that is not above 0.
    #[error("clusters have cells of {found} m; a finite size above 0 is needed")]
    Cell {
        /// Size found.
        found: f32,
    },
    /// A slice of the wrong length.
    #[error("clip {clip}: {found} {what} given; {expected} are needed")]
    Length {
        /// Index of the clip.
        clip: u64,
        /// Name of the values.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// A speed that is negative or not finite.
    #[error("clip {clip}: speed of vertex {vertex} is {found} m/s; speeds are finite and not negative")]
    Speed {
        /// Index of the clip.
        clip: u64,
        /// Index of the vertex.
        vertex: usize,
        /// Speed found.
        found: f32,
    },
    /// A pressure that is negative or not finite.
    #[error("clip {clip}: pressure of vertex {vertex} is {found}; pressures are finite and not negative")]
    Pressure {
        /// Index of the clip.
        clip: u64,
        /// Index of the vertex.
        vertex: usize,
        /// Pressure found.
        found: f32,
    },
    /// A position that is not finite.
    #[error("clip {clip}: position of vertex {vertex} is {found:?}; coordinates are finite")]
    Position {
        /// Index of the clip.
        clip: u64,
        /// Index of the vertex.
        vertex: usize,
        /// Position found.
        found: [f32; 3],
    },
}

/// Motion of the vertices at the centre of a clip.
#[derive(Clone, Copy, Debug, Default)]
pub struct ClipInput<'a> {
    /// Sliding speed per vertex in m/s. A speed of 0 is silent and costs nothing.
    pub speeds: &'a [f32],
    /// Position per vertex in metres, for clusters and receivers.
    pub positions: Option<&'a [[f32; 3]]>,
    /// Factor on the power per vertex, as of [`Pressures`](crate::contact::Pressures); none for 1.
    pub pressures: Option<&'a [f32]>,
}

/// A sliding vertex as weights of two neighbouring rows of the table.
#[derive(Clone, Copy)]
struct Sliding {
    vertex: u32,
    row: u32,
    low: f64,
    high: f64,
    power: f64,
}

/// Friction noise in windowed clips, from the sliding speed of every vertex.
///
/// Clip `k` is centred at sample `k * hop` and covers one hop on either side. Its speeds and positions are those at its
/// centre, so a contact sounds up to half a clip early. [`ClipStream`](super::ClipStream) overlaps and adds the clips.
///
/// The transform is linear, so the spectra of all emitters are added before a single inverse transform per channel. The
/// power per bin of a cluster is the sum over its vertices (incoherent sum), computed from a histogram over the rows of
/// a [`SpectrumTable`].
///
/// # Complexity
/// Per clip: O(V), O(rows * bins) per cluster, and one inverse transform per channel; without clusters O(V * bins).
/// Memory: O(V + clusters * rows + rows * bins). Nothing is allocated after `new`.
pub struct IftNoise<R = Mono> {
    table: SpectrumTable,
    params: IftNoiseParams,
    /// The distribution of [`Magnitude::Rayleigh`].
    rayleigh: Option<Rayleigh>,
    /// Power gain per vertex.
    gains: Vec<f64>,
    random: Random,
    receiver: R,
    window: Vec<f32>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    scratch: Vec<Complex<f32>>,
    bins: Vec<Complex<f32>>,
    /// Spectrum of one emitter.
    emitter: (Vec<f32>, Vec<f32>),
    /// Sum over emitters per channel, `[channels * padded bins]`.
    sums: (Vec<f32>, Vec<f32>),
    /// Power per bin of one emitter, padded to whole blocks.
    power: Vec<f32>,
    /// Power per row and cluster.
    histogram: Vec<f64>,
    /// Rows of one cluster with their weights.
    weighted_rows: Vec<(usize, f32)>,
    sliding: Vec<Sliding>,
    clusters: Clusters,
    coverage: SpeedCoverage,
}

impl<R> Stateful for IftNoise<R> {
    archive_state!(coverage);
}

impl IftNoise<Mono> {
    /// Creates mono noise at `fs` hertz for vertices of the given areas in m^2.
    ///
    /// # Errors
    /// When the model, the clip length or the rate is invalid, or an area is negative or not finite.
    pub fn new(
        model: &FrictionModel,
        fs: f64,
        params: IftNoiseParams,
        vertex_areas: &[f32],
        random: Random,
    ) -> Result<Self, NoiseError> {
        Self::with_receiver(model, fs, params, vertex_areas, random, Mono)
    }
}

impl<R: Receiver> IftNoise<R> {
    /// Creates noise with the channels of a receiver.
    ///
    /// # Errors
    /// As [`IftNoise::new`].
    pub fn with_receiver(
        model: &FrictionModel,
        fs: f64,
        params: IftNoiseParams,
        vertex_areas: &[f32],
        random: Random,
        receiver: R,
    ) -> Result<Self, NoiseError> {
        if !(fs > 0.0 && fs.is_finite() && params.clip > 0.0 && params.clip.is_finite()) {
            return Err(ModelError::Target { clip_samples: 0, fs }.into());
        }
        let len = clip_samples(params.clip, fs);
        let table = SpectrumTable::new(model, fs, len, params.gain)?;
        if let Some(vertex) = vertex_areas.iter().position(|a| !(a.is_finite() && *a >= 0.0)) {
            return Err(NoiseError::Area { vertex, found: vertex_areas[vertex] });
        }
        let (max_groups, clusters) = match params.emitters {
            Emitters::Clustered { cell, .. } if !(cell > 0.0 && cell.is_finite()) => {
                return Err(NoiseError::Cell { found: cell });
            }
            Emitters::Clustered { max, cell } => {
                let max_groups = max.clamp(1, vertex_areas.len().max(1));
                (max_groups, Clusters::new(cell, max_groups, vertex_areas.len()))
            }
            Emitters::PerVertex => (0, Clusters::new(1.0, 1, 0)),
        };
        let weight = |&area: &f32| match params.area_weight {
            AreaWeight::Sqrt => f64::from(area) / REFERENCE_AREA,
            AreaWeight::None => 1.0,
        };
        let inverse = RealFftPlanner::new().plan_fft_inverse(len);
        let padded = table.bins().next_multiple_of(BLOCK);
        let channels = receiver.channels();
        Ok(Self {
            params,
            rayleigh: match params.magnitude.unwrap_or_else(|| params.emitters.magnitude()) {
                Magnitude::Rayleigh => Some(Rayleigh::new()),
                Magnitude::Fixed => None,
            },
            gains: vertex_areas.iter().map(weight).collect(),
            random,
            receiver,
            window: (0..len).map(|n| params.window.at(n, len) as f32).collect(),
            scratch: inverse.make_scratch_vec(),
            bins: inverse.make_input_vec(),
            inverse,
            emitter: (vec![0.0; padded], vec![0.0; padded]),
            sums: (vec![0.0; channels * padded], vec![0.0; channels * padded]),
            power: vec![0.0; padded],
            histogram: vec![0.0; max_groups * table.speeds().len()],
            weighted_rows: Vec::with_capacity(table.speeds().len() + 3),
            sliding: Vec::with_capacity(vertex_areas.len()),
            clusters,
            coverage: SpeedCoverage::default(),
            table,
        })
    }

    /// Returns the number of samples per clip, which is even.
    #[must_use]
    pub fn clip_len(&self) -> usize {
        self.window.len()
    }

    /// Returns the number of samples from one clip to the next: half a clip.
    #[must_use]
    pub fn hop(&self) -> usize {
        self.window.len() / 2
    }

    /// Returns the number of channels of the receiver.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.receiver.channels()
    }

    /// Returns the receiver, so that it can be moved between clips.
    pub fn receiver_mut(&mut self) -> &mut R {
        &mut self.receiver
    }

    /// Returns the numbers of clips so far that lay outside the model's speeds.
    #[must_use]
    pub fn coverage(&self) -> SpeedCoverage {
        self.coverage
    }

    /// Writes the windowed clip `clip` and returns the number of sliding vertices. Without sliding vertices `out` is
    /// exactly zero.
    ///
    /// # Shapes
    /// `input.speeds: [V]`, `input.positions: [V]`, `input.pressures: [V]`, `out: [channels * N]`, planar.
    ///
    /// # Errors
    /// When a slice has the wrong length, a speed or pressure is negative or not finite, or a position is not finite. `out` is then
    /// unspecified.
    pub fn clip(&mut self, clip: u64, input: ClipInput<'_>, out: &mut [f32]) -> Result<usize, NoiseError> {
        let len = self.clip_len();
        check_length(clip, "output samples", out.len(), len * self.channels())?;
        self.find_sliding(clip, input)?;
        out.fill(0.0);
        if self.sliding.is_empty() {
            return Ok(0);
        }
        self.sums.0.fill(0.0);
        self.sums.1.fill(0.0);
        match self.params.emitters {
            Emitters::PerVertex => self.sum_vertices(clip, input.positions),
            Emitters::Clustered { .. } => self.sum_clusters(clip, input.positions),
        }
        let padded = self.power.len();
        for (channel, out) in out.chunks_exact_mut(len).enumerate() {
            self.transform(channel * padded, out);
        }
        Ok(self.sliding.len())
    }

    /// Checks the input and lists the sliding vertices with their table rows.
    fn find_sliding(&mut self, clip: u64, input: ClipInput<'_>) -> Result<(), NoiseError> {
        let vertices = self.gains.len();
        check_length(clip, "speeds", input.speeds.len(), vertices)?;
        if let Some(positions) = input.positions {
            check_length(clip, "positions", positions.len(), vertices)?;
        }
        if let Some(pressures) = input.pressures {
            check_length(clip, "pressures", pressures.len(), vertices)?;
        }
        self.sliding.clear();
        let mut coverage = self.coverage;
        for (vertex, (&speed, &gain)) in input.speeds.iter().zip(&self.gains).enumerate() {
            if !(0.0..f32::INFINITY).contains(&speed) {
                return Err(NoiseError::Speed { clip, vertex, found: speed });
            }
            let mut gain = gain;
            if let Some(pressures) = input.pressures {
                let found = pressures[vertex];
                if !(0.0..f32::INFINITY).contains(&found) {
                    return Err(NoiseError::Pressure { clip, vertex, found });
                }
                gain *= f64::from(found);
            }
            if gain == 0.0 {
                continue;
            }
            let Some(split) = self.table.locate(speed) else { continue };
            if let Some(found) = input.positions.map(|p| p[vertex])
                && !found.iter().all(|x| x.is_finite())
            {
                return Err(NoiseError::Position { clip, vertex, found });
            }
            coverage.sliding += 1;
            coverage.above += u64::from(split.coverage == Coverage::Above);
            coverage.below += u64::from(split.coverage == Coverage::Below);
            self.sliding.push(Sliding {
                vertex: vertex as u32,
                row: split.row as u32,
                low: gain * split.low,
                high: gain * split.high,
                power: gain * self.table.total(&split),
            });
        }
        self.coverage = coverage;
        Ok(())
    }

    /// Adds the spectra of all sliding vertices, each with phases of its own.
    fn sum_vertices(&mut self, clip: u64, positions: Option<&[[f32; 3]]>) {
        let bins = self.table.bins();
        for i in 0..self.sliding.len() {
            let Sliding { vertex, row, low, high, .. } = self.sliding[i];
            let rows = self.table.row(row as usize).iter().zip(self.table.row(row as usize + 1));
            let (low, high) = (low as f32, high as f32);
            for (p, (a, b)) in self.power[..bins].iter_mut().zip(rows) {
                *p = low * a + high * b;
            }
            self.emit(clip, vertex, positions.map(|p| p[vertex as usize]));
        }
    }

    /// Adds the spectra of all clusters of sliding vertices.
    fn sum_clusters(&mut self, clip: u64, positions: Option<&[[f32; 3]]>) {
        let rows = self.table.speeds().len();
        let positions = positions.filter(|_| self.receiver.uses_positions());
        let groups = match positions {
            Some(p) => self.clusters.assign(self.sliding.iter().map(|s| (p[s.vertex as usize], s.power))),
            None => 1,
        };
        self.histogram[..groups * rows].fill(0.0);
        for (i, s) in self.sliding.iter().enumerate() {
            let group = if positions.is_some() { self.clusters.group(i) } else { 0 };
            let index = group * rows + s.row as usize;
            self.histogram[index] += s.low;
            self.histogram[index + 1] += s.high;
        }
        for group in 0..groups {
            let weights = self.histogram[group * rows..(group + 1) * rows].iter().enumerate();
            self.weighted_rows.clear();
            self.weighted_rows.extend(weights.filter(|(_, w)| **w > 0.0).map(|(row, &w)| (row, w as f32)));
            self.mix_rows();
            self.emit(clip, group as u32, positions.map(|_| self.clusters.centre(group)));
        }
    }

    /// Writes the weighted sum of rows to `self.power`, four rows per pass.
    fn mix_rows(&mut self) {
        let bins = self.table.bins();
        while !self.weighted_rows.len().is_multiple_of(4) {
            self.weighted_rows.push((0, 0.0));
        }
        self.power.fill(0.0);
        for four in self.weighted_rows.chunks_exact(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| self.table.row(four[i].0));
            let [wa, wb, wc, wd] = [0, 1, 2, 3].map(|i| four[i].1);
            let rows = a.iter().zip(b).zip(c.iter().zip(d));
            for (p, ((a, b), (c, d))) in self.power[..bins].iter_mut().zip(rows) {
                *p += (wa * a + wb * b) + (wc * c + wd * d);
            }
        }
    }

    /// Applies random phases to `self.power` and adds the spectrum to each channel of the receiver.
    fn emit(&mut self, clip: u64, entity: u32, position: Option<[f32; 3]>) {
        let (re, im) = &mut self.emitter;
        let blocks =
            self.power.chunks_exact(BLOCK).zip(re.chunks_exact_mut(BLOCK).zip(im.chunks_exact_mut(BLOCK)));
        for (block, (power, (re, im))) in blocks.enumerate() {
            let (cos, sin) = phasors(&self.random, entity, clip, block);
            for i in 0..BLOCK {
                // A real sine of mean square P has magnitude sqrt(P / 2) at its positive and its negative frequency.
                let a = (0.5 * power[i]).sqrt();
                re[i] = a * cos[i];
                im[i] = a * sin[i];
            }
            if let Some(rayleigh) = self.rayleigh {
                let m = rayleigh.magnitudes(&self.random, entity, clip, block);
                for i in 0..BLOCK {
                    re[i] *= m[i];
                    im[i] *= m[i];
                }
            }
        }
        // DC is silent. Nyquist is real: it has a sign in place of a phase, and all of its power in one bin.
        let last = self.table.bins() - 1;
        let nyquist = (2.0 * (re[last] * re[last] + im[last] * im[last])).sqrt();
        re[last] = if re[last] < 0.0 { -nyquist } else { nyquist };
        (re[0], im[0], im[last]) = (0.0, 0.0, 0.0);
        let padded = self.power.len();
        let bins = last + 1;
        for channel in 0..self.receiver.channels() {
            let range = channel * padded..channel * padded + bins;
            let sum = (&mut self.sums.0[range.clone()], &mut self.sums.1[range]);
            self.receiver.add(channel, position, (&re[..bins], &im[..bins]), sum);
        }
    }

    /// Writes the windowed inverse transform of the spectrum that begins at `from` in `self.sums`.
    fn transform(&mut self, from: usize, out: &mut [f32]) {
        let last = self.bins.len() - 1;
        for (k, bin) in self.bins.iter_mut().enumerate() {
            *bin = Complex::new(self.sums.0[from + k], self.sums.1[from + k]);
        }
        self.bins[0].im = 0.0;
        self.bins[last].im = 0.0;
        // The plan refuses only wrong lengths and complex values at DC and Nyquist, which do not occur here.
        if self.inverse.process_with_scratch(&mut self.bins, out, &mut self.scratch).is_err() {
            out.fill(0.0);
        }
        out.iter_mut().zip(&self.window).for_each(|(x, w)| *x *= w);
    }
}

fn check_length(clip: u64, what: &'static str, found: usize, expected: usize) -> Result<(), NoiseError> {
    if found == expected { Ok(()) } else { Err(NoiseError::Length { clip, what, found, expected }) }
}

#[cfg(test)]
mod tests;
