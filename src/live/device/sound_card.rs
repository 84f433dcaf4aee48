//! Sound cards, by `cpal`.

use super::timing::DeviceStatus;
use crate::live::playback::callback::Callback;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{ErrorKind, FromSample, SampleFormat, SizedSample, StreamConfig};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};

/// Frames that are converted to the format of the card at a time.
const BLOCK: usize = 256;

/// A sound card that plays.
pub struct SoundCard {
    stream: Option<cpal::Stream>,
    callback: Arc<Mutex<Option<Callback>>>,
}

impl SoundCard {
    /// Stops the card and returns the callback.
    pub fn stop(mut self) -> Option<Callback> {
        drop(self.stream.take());
        self.callback.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

fn find(name: Option<&str>) -> Result<cpal::Device, String> {
    let host = cpal::default_host();
    let Some(name) = name else {
        return host.default_output_device().ok_or_else(|| "this machine has no sound card".to_owned());
    };
    let devices = host.output_devices().map_err(|e| format!("the sound cards cannot be listed: {e}"))?;
    let name_of =
        |device: &cpal::Device| device.description().map_or_else(|_| String::new(), |d| d.name().to_owned());
    let mut names = Vec::new();
    for device in devices {
        if name_of(&device) == name {
            return Ok(device);
        }
        names.push(name_of(&device));
    }
    Err(format!("there is no sound card {name:?}; there are: {}", names.join(", ")))
}

/// Chooses a configuration of a card: the rate of the graph, at least its channels, and the sample format nearest to floats.
fn choose(device: &cpal::Device, rate: u32, channels: usize) -> Result<(StreamConfig, SampleFormat), String> {
    let all = device
        .supported_output_configs()
        .map_err(|e| format!("the configurations of the card cannot be listed: {e}"))?;
    let all: Vec<_> = all.collect();
    let format = |f: SampleFormat| match f {
        SampleFormat::F32 => Some(0),
        SampleFormat::I32 => Some(1),
        SampleFormat::I16 => Some(2),
        _ => None,
    };
    let fits =
        |c: &&cpal::SupportedStreamConfigRange| (c.min_sample_rate()..=c.max_sample_rate()).contains(&rate);
    let best = all
        .iter()
        .filter(fits)
        .filter_map(|c| {
            let (too_few, count) = (usize::from(c.channels()) < channels, c.channels());
            Some(((too_few, format(c.sample_format())?, count), c))
        })
        .min_by_key(|(key, _)| *key);
    let Some((_, best)) = best else {
        let rates: Vec<String> =
            all.iter().map(|c| format!("{}-{} Hz", c.min_sample_rate(), c.max_sample_rate())).collect();
        return Err(format!("the card does not play at {rate} Hz, but at {}", rates.join(", ")));
    };
    Ok((best.with_sample_rate(rate).config(), best.sample_format()))
}

/// Starts a sound card.
///
/// # Errors
/// The message of the system, with the callback.
pub fn start(
    name: Option<&str>,
    callback: Callback,
) -> Result<(SoundCard, Arc<DeviceStatus>), (Box<Callback>, String)> {
    let (rate, channels) = (callback.rate().num() as u32, callback.channels());
    let found = find(name).and_then(|device| {
        let (config, format) = choose(&device, rate, channels)?;
        Ok((device, config, format))
    });
    let (device, config, format) = match found {
        Ok(found) => found,
        Err(e) => return Err((Box::new(callback), e)),
    };
    let shared = Arc::new(Mutex::new(Some(callback)));
    let status = Arc::new(DeviceStatus::default());
    let stream = match format {
        SampleFormat::F32 => build::<f32>(&device, config, channels, &shared, &status),
        SampleFormat::I32 => build::<i32>(&device, config, channels, &shared, &status),
        _ => build::<i16>(&device, config, channels, &shared, &status),
    };
    match stream.and_then(|stream| stream.play().map(|()| stream)) {
        Ok(stream) => Ok((SoundCard { stream: Some(stream), callback: shared }, status)),
        Err(e) => {
            let callback = shared.lock().unwrap_or_else(PoisonError::into_inner).take();
            // It is taken out only after the card has started.
            let callback = callback.expect("the callback is still there");
            Err((Box::new(callback), format!("the sound card cannot be opened: {e}")))
        }
    }
}

fn build<T: SizedSample + FromSample<f32>>(
    device: &cpal::Device,
    config: StreamConfig,
    channels: usize,
    shared: &Arc<Mutex<Option<Callback>>>,
    status: &Arc<DeviceStatus>,
) -> Result<cpal::Stream, cpal::Error> {
    let (shared, status) = (Arc::clone(shared), Arc::clone(status));
    let device_channels = usize::from(config.channels).max(1);
    let mut block = vec![0.0; BLOCK * channels];
    let play = move |out: &mut [T], _: &cpal::OutputCallbackInfo| {
        // The lock is free: `stop` takes it only after it has dropped the stream.
        let Ok(mut callback) = shared.try_lock() else { return out.fill(T::from_sample(0.0)) };
        let Some(callback) = callback.as_mut() else { return out.fill(T::from_sample(0.0)) };
        for out in out.chunks_mut(BLOCK * device_channels) {
            let block = &mut block[..out.len() / device_channels * channels];
            callback.fill(block);
            for (out, frame) in out.chunks_exact_mut(device_channels).zip(block.chunks_exact(channels)) {
                for (k, x) in out.iter_mut().enumerate() {
                    let sample = if channels == 1 { frame[0] } else { frame.get(k).copied().unwrap_or(0.0) };
                    *x = T::from_sample(sample.clamp(-1.0, 1.0));
                }
            }
        }
    };
    let fail = move |e: cpal::Error| match e.kind() {
        ErrorKind::DeviceNotAvailable | ErrorKind::HostUnavailable => status.lost.store(true, Relaxed),
        _ => {
            status.late.fetch_add(1, Relaxed);
        }
    };
    device.build_output_stream(config, play, fail, None)
}
