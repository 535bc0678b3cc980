//! Counts of the reads and writes of this process: [`StoreCounts`].

use std::fmt;

/// Numbers of images read, written and left out, with their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct StoreCounts {
    /// Images that were read from the store.
    pub(crate) hits: usize,
    /// Bytes of these images.
    pub(crate) hit_bytes: u64,
    /// Measures, thumbnails and probe results that were read.
    pub(crate) facts: usize,
    /// Time saved by reading: the time that the entries took to compute, in milliseconds.
    pub(crate) saved_ms: u64,
    /// Images that the store did not have.
    pub(crate) misses: usize,
    /// Images that were written to the store.
    pub(crate) written: usize,
    /// Bytes of their files.
    pub(crate) written_bytes: u64,
    /// Images that the store had no room for.
    pub(crate) left_out: usize,
    /// Images whose files were damaged or exchanged, and therefore removed.
    pub(crate) damaged: usize,
    /// Images that were removed because they had been unused for long.
    pub(crate) evicted: usize,
}

impl fmt::Display for StoreCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} images read ({:.1} MB), {} measures and small copies; these took {:.1} s to make; {} written ({:.1} MB)",
            self.hits,
            self.hits + self.misses,
            self.hit_bytes as f64 / 1e6,
            self.facts,
            self.saved_ms as f64 / 1e3,
            self.written,
            self.written_bytes as f64 / 1e6,
        )?;
        for (count, what) in [
            (self.left_out, "not stored because the store is full (--images-cache size)"),
            (self.damaged, "damaged and made again"),
            (self.evicted, "removed that nobody had used for 14 days"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}
