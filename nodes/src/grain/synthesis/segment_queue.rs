//! Successive segments, each of which is chosen when the one before begins.

use super::segment::{GrainSegment, join};
use crate::grain::dictionary::GrainDictionary;
use serde::{Deserialize, Serialize};

/// A segment that fades out, one that sounds, and the next.
const ROOM: usize = 3;

/// Successive segments that overlap in their fades only.
///
/// Blocks of any length give the same samples. Nothing is allocated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SegmentQueue {
    segments: [GrainSegment; ROOM],
    count: u32,
}

impl SegmentQueue {
    /// The segment that begins last.
    #[must_use]
    pub fn last(&self) -> Option<&GrainSegment> {
        self.segments[..self.count as usize].last()
    }

    /// Joins a segment to the last one.
    pub fn push(&mut self, dictionary: &GrainDictionary, mut segment: GrainSegment) {
        if let Some(last) = self.segments[..self.count as usize].last_mut() {
            join(dictionary, last, &mut segment);
            // Time goes on, whatever the join does.
            if segment.start <= last.start {
                segment.start = last.start + 1;
            }
        }
        if self.count as usize == ROOM {
            self.segments.rotate_left(1);
            self.count -= 1;
        }
        self.segments[self.count as usize] = segment;
        self.count += 1;
    }

    /// Adds the frames from `first` on to the output. `next` returns the segment after the last one, which begins at the frame that it receives.
    ///
    /// # Shapes
    /// `out: [T * channels]`, interleaved.
    pub fn add(
        &mut self,
        dictionary: &GrainDictionary,
        [first, channels]: [i64; 2],
        out: &mut [f32],
        mut next: impl FnMut(Option<&GrainSegment>, i64) -> Option<GrainSegment>,
    ) {
        let width = channels.max(1) as usize;
        let end = first + (out.len() / width) as i64;
        let mut at = first;
        while at < end {
            // The next segment is chosen when the last one begins.
            let mut until = end;
            loop {
                let begins = self.last().map_or(at, |last| last.start);
                if begins > at {
                    until = begins.min(end);
                    break;
                }
                let Some(segment) = next(self.last(), at) else { break };
                self.push(dictionary, segment);
            }
            let part = &mut out[(at - first) as usize * width..(until - first) as usize * width];
            self.segments[..self.count as usize].iter().for_each(|s| s.add(dictionary, at, width, part));
            at = until;
        }
    }
}
