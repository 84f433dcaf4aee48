//! Rings that pass finished windows from a worker to the callback, and empty buffers back.

use foley_nodes::core::buffer::{AnyBuffer, StreamBuffer};
use foley_nodes::core::stage::Stage;
use foley_nodes::dsp::Dropout;
use rtrb::{Consumer, Producer, RingBuffer};

/// One window of one output.
pub struct FinishedWindow {
    window: u64,
    buffer: Box<dyn AnyBuffer>,
}

/// The end at the worker.
pub struct RingSender {
    buffer: usize,
    clock: usize,
    full: Producer<FinishedWindow>,
    empty: Consumer<Box<dyn AnyBuffer>>,
}

/// The end at the callback.
pub struct RingReceiver {
    buffer: usize,
    clock: usize,
    full: Consumer<FinishedWindow>,
    empty: Producer<Box<dyn AnyBuffer>>,
    dropout: Option<Dropout>,
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
    (
        RingSender { buffer: sender.0, clock: sender.1, full: full_in, empty: empty_out },
        RingReceiver { buffer: receiver.0, clock: receiver.1, full: full_out, empty: empty_in, dropout },
    )
}

impl RingSender {
    /// Returns true if another window fits.
    #[must_use]
    pub fn has_room(&self) -> bool {
        !self.empty.is_empty() && !self.full.is_full()
    }

    /// Sends the current window of a stage.
    pub fn send(&mut self, stage: &Stage, window: u64) {
        if let Ok(mut buffer) = self.empty.pop() {
            stage.export(self.buffer, self.clock, &mut *buffer);
            // There are as many buffers as slots.
            let _ = self.full.push(FinishedWindow { window, buffer });
        }
    }
}

impl RingReceiver {
    /// Takes a window into a stage; if it has not arrived, pads with silence and returns false.
    pub fn receive(&mut self, stage: &mut Stage, window: u64) -> bool {
        let span = stage.span(self.clock);
        while self.full.peek().is_ok_and(|finished| finished.window < window) {
            self.recycle();
        }
        let arrived = self.full.peek().is_ok_and(|finished| finished.window == window);
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
        arrived || span.full == span.from
    }

    /// Continues the ring of another receiver.
    pub fn take_over(&mut self, old: &mut Self) {
        std::mem::swap(&mut self.full, &mut old.full);
        std::mem::swap(&mut self.empty, &mut old.empty);
        std::mem::swap(&mut self.dropout, &mut old.dropout);
    }

    fn recycle(&mut self) {
        if let Ok(finished) = self.full.pop() {
            let _ = self.empty.push(finished.buffer);
        }
    }
}
