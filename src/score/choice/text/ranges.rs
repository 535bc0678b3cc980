//! [`Ranges`]: a set of byte ranges of a text.

/// Disjoint byte ranges of a text, each from its first byte to the byte after its last.
#[derive(Debug, Default)]
pub(crate) struct Ranges(Vec<(usize, usize)>);

impl Ranges {
    /// Merges overlapping ranges and drops empty ones.
    pub(crate) fn new(mut all: Vec<(usize, usize)>) -> Self {
        all.retain(|(start, end)| start < end);
        all.sort_unstable();
        let mut merged: Vec<(usize, usize)> = Vec::with_capacity(all.len());
        for (start, end) in all {
            match merged.last_mut() {
                Some(last) if start <= last.1 => last.1 = last.1.max(end),
                _ => merged.push((start, end)),
            }
        }
        Self(merged)
    }

    /// True if a byte is in one of the ranges.
    pub(crate) fn contain(&self, byte: usize) -> bool {
        let after = self.0.partition_point(|range| range.1 <= byte);
        self.0.get(after).is_some_and(|range| range.0 <= byte)
    }
}
