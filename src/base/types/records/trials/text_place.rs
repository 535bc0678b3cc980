//! Location of the texts of a trial: [`TextPlace`].

/// The byte offset of a trial's line in the file of its run; for records in memory, the number of the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct TextPlace {
    log: u16,
    high: u16,
    low: u32,
}

impl TextPlace {
    /// A place at an offset in the first file.
    #[must_use]
    pub fn new(start: u64) -> Self {
        Self { log: 0, high: (start >> 32) as u16, low: start as u32 }
    }

    /// The same offset in the file with the index `log`.
    #[must_use]
    pub fn in_log(self, log: usize) -> Self {
        Self { log: log as u16, ..self }
    }

    /// Index of the file among those of all runs.
    #[must_use]
    pub fn log(self) -> usize {
        usize::from(self.log)
    }

    /// The first byte of the line in its file, or the number of the line.
    #[must_use]
    pub fn start(self) -> u64 {
        u64::from(self.high) << 32 | u64::from(self.low)
    }

    /// The same offset, with the file index raised by `logs`, the number of files of the runs before.
    pub(super) fn after(self, logs: usize) -> Self {
        Self { log: self.log + logs as u16, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_beyond_4_gb_are_kept() {
        let place = TextPlace::new(0x1234_5678_9abc).after(3);
        assert_eq!((place.log(), place.start()), (3, 0x1234_5678_9abc));
        assert_eq!(size_of::<TextPlace>(), 8);
    }
}
