//! Readings of the meters of a graph, from the callback to a display.

use foley_nodes::core::input::Display;
use foley_nodes::dsp::Level;
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::{Mutex, PoisonError};

/// Maximum number of unread readings of a meter.
const MAX_READINGS: usize = 1024;

/// Readings of one meter since the last call.
#[derive(Clone, Debug, PartialEq)]
pub struct MeterReadings {
    /// Name of the meter.
    pub name: String,
    /// Readings per second.
    pub rate: f64,
    /// The readings, the oldest first.
    pub readings: Vec<Level>,
}

struct Source {
    name: String,
    rate: f64,
    readings: Consumer<Level>,
}

/// The meters of the graphs that play.
#[derive(Default)]
pub struct Meters {
    sources: Mutex<Vec<Source>>,
}

impl Meters {
    /// Opens a meter that gives `rate` readings a second.
    pub fn open(&self, name: &str, rate: f64) -> Box<dyn Display> {
        let (producer, readings) = RingBuffer::new(MAX_READINGS);
        let mut sources = self.sources.lock().unwrap_or_else(PoisonError::into_inner);
        sources.push(Source { name: name.to_owned(), rate, readings });
        Box::new(Sender(producer))
    }

    /// Takes all unread readings, by name; a meter of a graph that has ended is left out.
    ///
    /// While a node is replaced, the old and the new meter of one name both play; the readings are those of the new one.
    pub fn take(&self) -> Vec<MeterReadings> {
        let mut sources = self.sources.lock().unwrap_or_else(PoisonError::into_inner);
        sources.retain(|source| !source.readings.is_abandoned() || !source.readings.is_empty());
        let mut all: Vec<MeterReadings> = Vec::new();
        for Source { name, rate, readings } in sources.iter_mut() {
            let count = readings.slots();
            let new = readings.read_chunk(count).map(|chunk| chunk.into_iter().collect()).unwrap_or_default();
            let new = MeterReadings { name: name.clone(), rate: *rate, readings: new };
            match all.iter_mut().find(|m| m.name == *name) {
                Some(old) if !new.readings.is_empty() => *old = new,
                Some(_) => {}
                None => all.push(new),
            }
        }
        all.sort_by(|a, b| a.name.cmp(&b.name));
        all
    }
}

struct Sender(Producer<Level>);

impl Display for Sender {
    fn show(&mut self, peak: f32, rms: f64) {
        let _ = self.0.push(Level { peak, rms });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_taken_once_and_a_meter_ends_with_its_node() {
        let meters = Meters::default();
        let (mut force, mut sound) = (meters.open("force", 30.0), meters.open("a sound", 10.0));
        let level = |peak: f32| Level { peak, rms: f64::from(peak) / 2.0 };
        let show = |meter: &mut Box<dyn Display>, peak| meter.show(peak, level(peak).rms);
        (0..2000).for_each(|k| show(&mut force, k as f32));
        show(&mut sound, 1.0);
        let found = meters.take();
        assert_eq!(
            found[0],
            MeterReadings { name: "a sound".into(), rate: 10.0, readings: vec![level(1.0)] }
        );
        // Nobody read the ones after: the first are in the ring.
        assert_eq!(found[1].readings, (0..1024).map(|k| level(k as f32)).collect::<Vec<_>>());
        assert!(meters.take().iter().all(|m| m.readings.is_empty()));
        let mut next = meters.open("force", 60.0);
        show(&mut force, 1.0);
        show(&mut next, 2.0);
        assert_eq!(meters.take()[1].readings, [level(2.0)]);
        drop((force, next, sound));
        assert!(meters.take().is_empty());
    }
}
