//! Byte offsets to lines and columns, and back.

/// A position for people: both numbers start at 1, the column counts characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LineColumn {
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
}

/// A character that is longer than one byte, and the number of extra bytes of all of them up to it.
#[derive(Clone, Copy, Debug)]
struct Wide {
    start: usize,
    end: usize,
    bytes_over_chars: usize,
    bytes_over_utf16: usize,
}

/// The line starts of a text, for looking up positions.
///
/// # Complexity
/// Linear to make; each look-up is a binary search.
#[derive(Clone, Debug)]
pub struct LineIndex {
    starts: Vec<usize>,
    wide: Vec<Wide>,
    len: usize,
}

impl LineIndex {
    /// Indexes a text. A line ends at a line feed.
    pub fn new(text: &str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        let mut wide: Vec<Wide> = Vec::new();
        for (start, c) in text.char_indices().filter(|(_, c)| !c.is_ascii()) {
            let (bytes, last) = (c.len_utf8(), wide.last().copied());
            wide.push(Wide {
                start,
                end: start + bytes,
                bytes_over_chars: last.map_or(0, |w| w.bytes_over_chars) + bytes - 1,
                bytes_over_utf16: last.map_or(0, |w| w.bytes_over_utf16) + bytes - c.len_utf16(),
            });
        }
        LineIndex { starts, wide, len: text.len() }
    }

    /// The number of lines; an empty text has one.
    pub fn lines(&self) -> usize {
        self.starts.len()
    }

    /// The line (from 0) of an offset.
    fn line(&self, offset: usize) -> usize {
        self.starts.partition_point(|&start| start <= offset) - 1
    }

    /// An offset inside the text, at the start of a character.
    fn floor(&self, offset: usize) -> usize {
        let offset = offset.min(self.len);
        match self.wide.get(self.wide.partition_point(|w| w.end <= offset)) {
            Some(w) if w.start < offset => w.start,
            _ => offset,
        }
    }

    fn wide_before(&self, offset: usize) -> Option<&Wide> {
        self.wide.partition_point(|w| w.end <= offset).checked_sub(1).map(|last| &self.wide[last])
    }

    fn column(&self, start: usize, offset: usize, excess: fn(&Wide) -> usize) -> usize {
        let before = |at| self.wide_before(at).map_or(0, excess);
        offset - start - (before(offset) - before(start))
    }

    /// The line and column of a byte offset. An offset past the end counts as the end, one inside a
    /// character as its start.
    pub fn line_column(&self, offset: usize) -> LineColumn {
        let offset = self.floor(offset);
        let line = self.line(offset);
        LineColumn {
            line: line + 1,
            column: self.column(self.starts[line], offset, |w| w.bytes_over_chars) + 1,
        }
    }

    /// The line and column of a byte offset as editors count them: from 0, the column in UTF-16 units.
    pub fn utf16(&self, offset: usize) -> (usize, usize) {
        let offset = self.floor(offset);
        let line = self.line(offset);
        (line, self.column(self.starts[line], offset, |w| w.bytes_over_utf16))
    }

    /// The byte offset of an editor's line and UTF-16 column, both from 0. A column past the line's end
    /// counts as its end.
    pub fn offset_of_utf16(&self, line: usize, column: usize) -> usize {
        let Some(&start) = self.starts.get(line) else { return self.len };
        let end = self.starts.get(line + 1).map_or(self.len, |next| next - 1);
        let (mut low, mut high) = (start, end);
        // The UTF-16 column grows with the offset.
        while low < high {
            let middle = (low + high).div_ceil(2);
            if self.column(start, self.floor(middle), |w| w.bytes_over_utf16) <= column {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
        self.floor(low)
    }

    /// The byte offsets of a line, counted from 1, without its line feed.
    pub fn line_span(&self, line: usize) -> Option<std::ops::Range<usize>> {
        let index = line.checked_sub(1)?;
        let start = *self.starts.get(index)?;
        let end = self.starts.get(index + 1).map_or(self.len, |next| next - 1);
        Some(start..end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn columns_count_characters_and_utf16_units() {
        let index = LineIndex::new("aé😀b\r\nx");
        let at =
            |offset| (index.line_column(offset).line, index.line_column(offset).column, index.utf16(offset));
        assert_eq!(at(0), (1, 1, (0, 0)));
        assert_eq!(at(3), (1, 3, (0, 2)));
        assert_eq!(at(7), (1, 4, (0, 4)));
        assert_eq!(at(10), (2, 1, (1, 0)));
        assert_eq!(at(5), at(3), "inside a character counts as its start");
        assert_eq!(at(99), (2, 2, (1, 1)));
        assert_eq!(index.line_span(1), Some(0..9));
        assert_eq!(index.line_span(3), None);
    }

    proptest! {
        #[test]
        fn columns_agree_with_counting(text in "[aé😀\n\r ]{0,40}") {
            let index = LineIndex::new(&text);
            for (offset, _) in text.char_indices().chain([(text.len(), ' ')]) {
                let line_start = text[..offset].rfind('\n').map_or(0, |at| at + 1);
                let before = &text[line_start..offset];
                let lines = text[..offset].matches('\n').count();
                let expected = LineColumn { line: lines + 1, column: before.chars().count() + 1 };
                prop_assert_eq!(index.line_column(offset), expected);
                prop_assert_eq!(index.utf16(offset), (lines, before.encode_utf16().count()));
                prop_assert_eq!(index.offset_of_utf16(lines, before.encode_utf16().count()), offset);
            }
        }
    }
}
