//! [`Interner`]: stores equal values once and gives each a number.

use std::hash::{BuildHasher, Hash};

use hashbrown::{DefaultHashBuilder, HashTable};

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
}
