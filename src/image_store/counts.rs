//! Counts of a process's reads from the store and writes to it: [`StoreCounts`].

use std::fmt;

/// Numbers of images, with their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct StoreCounts {
    /// Images that were read from the store.
    pub(crate) hits: usize,
    /// Bytes of these images.
    pub(crate) hit_bytes: u64,
    /// Measures and small copies of images, and results of tries, that were read.
    pub(crate) facts: usize,
    /// Time that all this took to make when it was made, in milliseconds.
    pub(crate) saved_ms: u64,
    /// Images that the store did not have.
    pub(crate) misses: usize,
    /// Images that were written to the store.
    pub(crate) written: usize,
    /// Bytes of their files.
    pub(crate) written_bytes: u64,
    /// Images that the store had no room for.
    pub(crate) left_out: usize,
    /// Images whose files were damaged or those of another image; they were removed and made again.
    pub(crate) damaged: usize,
    /// Images that were removed because nobody had used them for long.
    pub(crate) evicted: usize,
}

impl fmt::Display for StoreCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        write!(
            f,
            "{} of {} images read ({:.1} MB), {} measures and small copies; these took {:.1} s to make; {} written ({:.1} MB)",
            self.hits,
            self.hits + self.misses,
            megabytes(self.hit_bytes),
            self.facts,
            self.saved_ms as f64 / 1e3,
            self.written,
            megabytes(self.written_bytes),
        )?;
        for (count, what) in [
            (
                self.left_out,
                "not stored because the store is full (--images-cache size)",
            ),
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
