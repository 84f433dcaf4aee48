//! The way of finished windows from a worker to the callback.

use foley_nodes::core::buffer::{AnyBuffer, StreamBuffer};
use foley_nodes::core::stage::Stage;
use foley_nodes::dsp::Dropout;
use rtrb::{Consumer, Producer, RingBuffer};

/// One window of one output.
pub struct Parcel {
    window: u64,
    buffer: Box<dyn AnyBuffer>,
}

/// The worker's end.
pub struct Sender {
    buffer: usize,
    clock: usize,
    full: Producer<Parcel>,
    empty: Consumer<Box<dyn AnyBuffer>>,
}

/// The callback's end.
pub struct Receiver {
    buffer: usize,
    clock: usize,
    full: Consumer<Parcel>,
    empty: Producer<Box<dyn AnyBuffer>>,
    bridge: Option<Dropout>,
}

/// Both ends of a link that holds `depth` windows: buffer and clock of either side, and a buffer to copy.
#[must_use]
pub fn link(
    depth: usize,
    sender: (usize, usize),
    receiver: (usize, usize),
    bridge: Option<Dropout>,
    mut make: impl FnMut() -> Box<dyn AnyBuffer>,
) -> (Sender, Receiver) {
    let (full_in, full_out) = RingBuffer::new(depth);
    let (mut empty_in, empty_out) = RingBuffer::new(depth);
    for _ in 0..depth {
        // The ring is as long as this.
        let _ = empty_in.push(make());
    }
    (
        Sender { buffer: sender.0, clock: sender.1, full: full_in, empty: empty_out },
        Receiver { buffer: receiver.0, clock: receiver.1, full: full_out, empty: empty_in, bridge },
    )
}

impl Sender {
    /// Whether another window fits.
    #[must_use]
    pub fn has_room(&self) -> bool {
        !self.empty.is_empty() && !self.full.is_full()
    }

    /// Sends the window that a stage has just run.
    pub fn send(&mut self, stage: &Stage, window: u64) {
        if let Ok(mut buffer) = self.empty.pop() {
            stage.export(self.buffer, self.clock, &mut *buffer);
            // There are as many buffers as places.
            let _ = self.full.push(Parcel { window, buffer });
        }
    }
}

impl Receiver {
    /// Takes the window into a stage; false where it has not arrived, and silence takes its place.
    pub fn receive(&mut self, stage: &mut Stage, window: u64) -> bool {
        let span = stage.span(self.clock);
        while self.full.peek().is_ok_and(|parcel| parcel.window < window) {
            self.recycle();
        }
        let here = self.full.peek().is_ok_and(|parcel| parcel.window == window);
        if let (true, Ok(parcel)) = (here, self.full.pop()) {
            stage.import(self.buffer, self.clock, &*parcel.buffer);
            let _ = self.empty.push(parcel.buffer);
        } else {
            // A stream that has ended, or not begun, sends nothing and misses nothing.
            stage.pad(self.buffer, span.full);
        }
        if let Some(bridge) = &mut self.bridge {
            stage.with_buffer_mut(self.buffer, |buffer| {
                let Some(buffer) = buffer.typed_mut::<StreamBuffer<f32>>() else { return };
                let items = buffer.last_mut((span.full - span.from) as usize);
                if here { bridge.sound(items) } else { bridge.gap(items) }
            });
        }
        here || span.full == span.from
    }

    /// Goes on with the ring of another, and with what was heard over it.
    pub fn take_over(&mut self, old: &mut Self) {
        std::mem::swap(&mut self.full, &mut old.full);
        std::mem::swap(&mut self.empty, &mut old.empty);
        std::mem::swap(&mut self.bridge, &mut old.bridge);
    }

    fn recycle(&mut self) {
        if let Ok(parcel) = self.full.pop() {
            let _ = self.empty.push(parcel.buffer);
        }
    }
}
