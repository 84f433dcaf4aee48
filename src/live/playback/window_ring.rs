//! Rings that pass finished windows from a worker to the callback, and empty buffers back.
//!
//! A window that arrives too late is lost if it is of a stream: silence has replaced it. If it is of events, these move to the first tick
//! of the next window of the callback.

use foley_nodes::core::buffer::{AnyBuffer, LateEvents, StreamBuffer};
use foley_nodes::core::stage::Stage;
use foley_nodes::dsp::Dropout;
use rtrb::{Consumer, Producer, RingBuffer};

/// One window of one output, or late events.
pub struct FinishedWindow {
    /// The window; `None` if the buffer holds the events of windows that were not sent in time.
    window: Option<u64>,
    buffer: Box<dyn AnyBuffer>,
    /// Events that the worker has left out for want of room.
    lost: u64,
}

/// The end at the worker.
pub struct RingSender {
    buffer: usize,
    clock: usize,
    full: Producer<FinishedWindow>,
    empty: Consumer<Box<dyn AnyBuffer>>,
    late: Option<LateWindows>,
}

/// Events of windows that could not be sent in time; streams have none.
struct LateWindows {
    buffer: Box<dyn AnyBuffer>,
    /// Numbers of events in it, and of those for which there was no room.
    events: LateEvents,
}

/// The end at the callback.
pub struct RingReceiver {
    buffer: usize,
    clock: usize,
    full: Consumer<FinishedWindow>,
    empty: Producer<Box<dyn AnyBuffer>>,
    dropout: Option<Dropout>,
}

/// Actions of a receiver for one window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// True if a window was due and had not arrived.
    pub missed: bool,
    /// Late events for which there was no room.
    pub lost_events: u64,
}

/// Makes a ring of `depth` windows, from buffer and clock of both sides; `make` makes an empty buffer.
#[must_use]
pub fn ring(
    depth: usize,
    sender: (usize, usize),
    receiver: (usize, usize),
    dropout: Option<Dropout>,
    mut make: impl FnMut() -> Box<dyn AnyBuffer>,
) -> (RingSender, RingReceiver) {
    let (full_in, full_out) = RingBuffer::new(depth);
    let (mut empty_in, empty_out) = RingBuffer::new(depth);
    for _ in 0..depth {
        // The ring has `depth` slots.
        let _ = empty_in.push(make());
    }
    let late = make();
    // Only buffers of events grow.
    let late = late.grows().then(|| LateWindows { buffer: late, events: LateEvents::default() });
    (
        RingSender { buffer: sender.0, clock: sender.1, full: full_in, empty: empty_out, late },
        RingReceiver { buffer: receiver.0, clock: receiver.1, full: full_out, empty: empty_in, dropout },
    )
}

impl RingSender {
    /// Returns true if another window fits, after late events.
    #[must_use]
    pub fn has_room(&self) -> bool {
        let late = self.late.as_ref().is_some_and(|late| late.events != LateEvents::default());
        // There are as many buffers as slots.
        self.empty.slots() > usize::from(late)
    }

    /// Sends the current window of a stage; without room it is late.
    pub fn send(&mut self, stage: &Stage, window: u64) {
        self.send_late_events();
        match self.empty.pop() {
            Ok(mut buffer) => {
                stage.export(self.buffer, self.clock, &mut *buffer);
                let _ = self.full.push(FinishedWindow { window: Some(window), buffer, lost: 0 });
            }
            Err(_) => self.send_late(stage),
        }
    }

    /// Sends the events of the current window of a stage, which is late, as soon as the ring is empty, so that windows in time have room,
    /// or with the next window in time; nothing of a stream.
    pub fn send_late(&mut self, stage: &Stage) {
        let Some(late) = &mut self.late else { return };
        let span = stage.span(self.clock);
        let events =
            stage.with_buffer(self.buffer, |buffer| late.buffer.append_late(buffer, span.from, span.to));
        late.events.added += events.added;
        late.events.lost += events.lost;
        if self.empty.slots() == self.empty.buffer().capacity() {
            self.send_late_events();
        }
    }

    fn send_late_events(&mut self) {
        let Some(late) = self.late.as_mut().filter(|late| late.events != LateEvents::default()) else {
            return;
        };
        if let Ok(mut buffer) = self.empty.pop() {
            buffer.restart(0);
            std::mem::swap(&mut buffer, &mut late.buffer);
            let lost = std::mem::take(&mut late.events).lost;
            let _ = self.full.push(FinishedWindow { window: None, buffer, lost });
        }
    }
}

impl RingReceiver {
    /// Takes a window into a stage, after events that are late; if it has not arrived, pads with silence.
    pub fn receive(&mut self, stage: &mut Stage, window: u64) -> Received {
        let span = stage.span(self.clock);
        let mut lost_events = 0;
        // `None` is before any window.
        while self.full.peek().is_ok_and(|finished| finished.window < Some(window)) {
            lost_events += self.receive_late(stage);
        }
        let arrived = self.full.peek().is_ok_and(|finished| finished.window == Some(window));
        if let (true, Ok(finished)) = (arrived, self.full.pop()) {
            stage.import(self.buffer, self.clock, &*finished.buffer);
            let _ = self.empty.push(finished.buffer);
        } else {
            // A stream that has ended, or not begun, sends no window.
            stage.pad(self.buffer, span.full);
        }
        if let Some(dropout) = &mut self.dropout {
            stage.with_buffer_mut(self.buffer, |buffer| {
                let Some(buffer) = buffer.typed_mut::<StreamBuffer<f32>>() else { return };
                let items = buffer.last_mut((span.full - span.from) as usize);
                if arrived { dropout.sound(items) } else { dropout.gap(items) }
            });
        }
        Received { missed: !arrived && span.full > span.from, lost_events }
    }

    /// Continues the ring of another receiver.
    pub fn take_over(&mut self, old: &mut Self) {
        std::mem::swap(&mut self.full, &mut old.full);
        std::mem::swap(&mut self.empty, &mut old.empty);
        std::mem::swap(&mut self.dropout, &mut old.dropout);
    }

    /// Takes the events of a late window, and returns the number of those that are lost.
    fn receive_late(&mut self, stage: &mut Stage) -> u64 {
        let Ok(finished) = self.full.pop() else { return 0 };
        let late = stage
            .with_buffer_mut(self.buffer, |buffer| buffer.append_late(&*finished.buffer, i64::MIN, i64::MAX));
        let _ = self.empty.push(finished.buffer);
        finished.lost + late.lost
    }
}

#[cfg(test)]
mod tests;
