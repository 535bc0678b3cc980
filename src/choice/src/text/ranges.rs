//! Stretches of a text: [`Ranges`].

/// Stretches of a text in bytes, each from its first byte to the byte after its last.
#[derive(Debug, Default)]
pub(crate) struct Ranges(Vec<(usize, usize)>);

impl Ranges {
    /// These stretches. Overlapping ones are joined, empty ones left out.
    pub(crate) fn new(mut all: Vec<(usize, usize)>) -> Self {
        all.retain(|(start, end)| start < end);
        all.sort_unstable();
        let mut joined: Vec<(usize, usize)> = Vec::with_capacity(all.len());
        for (start, end) in all {
            match joined.last_mut() {
                Some(last) if start <= last.1 => last.1 = last.1.max(end),
                _ => joined.push((start, end)),
            }
        }
        Self(joined)
    }

    /// Whether a byte lies in one of them.
    pub(crate) fn contain(&self, byte: usize) -> bool {
        let after = self.0.partition_point(|range| range.1 <= byte);
        self.0.get(after).is_some_and(|range| range.0 <= byte)
    }
}
