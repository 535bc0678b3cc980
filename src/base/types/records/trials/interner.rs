//! [`Interner`]: stores equal values once and gives each a number.
//!
//! Location of the texts of a trial: [`TextPlace`].

use std::hash::{BuildHasher, Hash};

use hashbrown::{DefaultHashBuilder, HashTable};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Distinct values in the order in which they were added. The number of a value is its index.
#[derive(Debug, Clone)]
pub(super) struct Interner<T> {
    all: Vec<T>,
    /// The numbers, by the hashes of their values.
    numbers: HashTable<u32>,
    hashes: DefaultHashBuilder,
}

impl<T> Default for Interner<T> {
    fn default() -> Self {
        Self { all: Vec::new(), numbers: HashTable::new(), hashes: DefaultHashBuilder::default() }
    }
}

impl<T: Hash + Eq> Interner<T> {
    /// The number of a value, which is added if it is new.
    pub(super) fn intern(&mut self, value: T) -> u32 {
        match self.find(&value, |known| *known == value) {
            Some(number) => number,
            None => self.push(value),
        }
    }

    /// The number of the value for which `is_equal` returns true. `key` must have the same hash as that value.
    pub(super) fn find(&self, key: &impl Hash, is_equal: impl Fn(&T) -> bool) -> Option<u32> {
        let hash = self.hashes.hash_one(key);
        self.numbers.find(hash, |number| is_equal(self.get(*number))).copied()
    }

    /// Adds a value that is known to be new, and returns its number.
    pub(super) fn push(&mut self, value: T) -> u32 {
        let Self { all, numbers, hashes } = self;
        let number = all.len() as u32;
        let hash = hashes.hash_one(&value);
        all.push(value);
        numbers.insert_unique(hash, number, |number| hashes.hash_one(&all[*number as usize]));
        number
    }
}

/// Serialized as the list of its values.
impl<T: Serialize> Serialize for Interner<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.all.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de> + Hash + Eq> Deserialize<'de> for Interner<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut values = Self::default();
        for value in Vec::<T>::deserialize(deserializer)? {
            values.push(value);
        }
        Ok(values)
    }
}

impl<T> Interner<T> {
    /// The value with a number.
    pub(super) fn get(&self, number: u32) -> &T {
        &self.all[number as usize]
    }

    /// All values, by number.
    pub(super) fn all(&self) -> &[T] {
        &self.all
    }

    /// All values, to change them. Two may become equal, so values are no longer found by their content.
    pub(super) fn all_mut(&mut self) -> &mut [T] {
        self.numbers.clear();
        &mut self.all
    }

    /// Number of values.
    pub(super) fn len(&self) -> usize {
        self.all.len()
    }
}

/// The byte offset of a trial's line in the file of its run; for records in memory, the number of the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
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
    fn equal_values_share_a_number() {
        let mut values = Interner::default();
        let numbers: Vec<u32> = (0..3000).map(|n| values.intern(n % 1000)).collect();
        assert!(numbers.iter().zip(0..).all(|(number, n)| *number == n % 1000));
        assert_eq!((values.len(), *values.get(7)), (1000, 7));
    }

    #[test]
    fn places_beyond_4_gb_are_kept() {
        let place = TextPlace::new(0x1234_5678_9abc).after(3);
        assert_eq!((place.log(), place.start()), (3, 0x1234_5678_9abc));
        assert_eq!(size_of::<TextPlace>(), 8);
    }
}
