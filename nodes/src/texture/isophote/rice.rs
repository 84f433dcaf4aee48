//! Streams of bits, and an adaptive Rice code.

/// Writes bits, from the lowest.
#[derive(Debug, Default)]
pub(super) struct Writer {
    bytes: Vec<u8>,
    pending: u64,
    count: u32,
}

impl Writer {
    /// Continues `bytes`.
    pub fn new(bytes: &[u8]) -> Self {
        Self { bytes: bytes.to_vec(), ..Self::default() }
    }

    /// Writes the lowest `count` bits of a value, at most 32.
    pub fn bits(&mut self, value: u64, count: u32) {
        // At most 7 bits are pending.
        self.pending |= value << self.count;
        self.count += count;
        while self.count >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.count -= 8;
        }
    }

    /// Returns all bytes, with the last one padded by zeros.
    pub fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.pending as u8);
        }
        self.bytes
    }
}

/// Reads bits, from the lowest.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    pending: u64,
    count: u32,
}

impl<'a> Reader<'a> {
    /// Starts at the first bit of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, pending: 0, count: 0 }
    }

    /// Bytes that are not read yet.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Reads `count` bits; `None` at the end.
    pub fn bits(&mut self, count: u32) -> Option<u64> {
        while self.count < count {
            self.pending |= u64::from(*self.bytes.get(self.at)?) << self.count;
            self.at += 1;
            self.count += 8;
        }
        let value = self.pending & ((1 << count) - 1);
        self.pending >>= count;
        self.count -= count;
        Some(value)
    }
}

/// An adaptive Rice code for numbers near 0: its parameter follows their mean.
#[derive(Clone, Debug)]
pub(super) struct Rice {
    sum: u64,
    count: u64,
}

/// Length of a unary prefix after which a number follows in 32 bits.
const ESCAPE: u64 = 20;

impl Rice {
    pub fn new() -> Self {
        Self { sum: 16, count: 1 }
    }

    fn low_bits(&self) -> u32 {
        (self.sum / self.count).checked_ilog2().unwrap_or(0).min(24)
    }

    /// Updates the mean.
    fn update(&mut self, value: u64) {
        self.sum += value.min(1 << 24);
        self.count += 1;
        if self.count == 64 {
            self.sum /= 2;
            self.count /= 2;
        }
    }

    pub fn write(&mut self, out: &mut Writer, number: i64) {
        let value = u64::from(((number << 1) ^ (number >> 63)) as u32);
        let k = self.low_bits();
        match value >> k {
            ones if ones < ESCAPE => {
                out.bits((1 << ones) - 1, ones as u32 + 1);
                out.bits(value & ((1 << k) - 1), k);
            }
            _ => {
                out.bits((1 << ESCAPE) - 1, ESCAPE as u32);
                out.bits(value, 32);
            }
        }
        self.update(value);
    }

    pub fn read(&mut self, from: &mut Reader<'_>) -> Option<i64> {
        let mut ones = 0;
        while ones < ESCAPE && from.bits(1)? == 1 {
            ones += 1;
        }
        let k = self.low_bits();
        let value = if ones == ESCAPE { from.bits(32)? } else { ones << k | from.bits(k)? };
        self.update(value);
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_size_are_coded() {
        let numbers = [0, 1, -1, 5, -300, 70_000, i64::from(i32::MAX), i64::from(i32::MIN), 0, 0, 2, -2];
        let (mut out, mut code) = (Writer::default(), Rice::new());
        numbers.iter().cycle().take(500).for_each(|n| code.write(&mut out, *n));
        let bytes = out.finish();
        let (mut from, mut code) = (Reader::new(&bytes), Rice::new());
        for n in numbers.iter().cycle().take(500) {
            assert_eq!(code.read(&mut from), Some(*n));
        }
    }
}
