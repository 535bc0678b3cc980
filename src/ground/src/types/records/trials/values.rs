//! Different values, each with a number: [`Values`].

use std::hash::{BuildHasher, Hash};

use hashbrown::{DefaultHashBuilder, HashTable};

/// The different values that were met, in the order in which they were met first. A value has its place among them as number.
#[derive(Debug, Clone)]
pub(super) struct Values<T> {
    all: Vec<T>,
    /// The numbers, by the hashes of their values.
    numbers: HashTable<u32>,
    hashes: DefaultHashBuilder,
}

impl<T> Default for Values<T> {
    fn default() -> Self {
        Self {
            all: Vec::new(),
            numbers: HashTable::new(),
            hashes: DefaultHashBuilder::default(),
        }
    }
}

impl<T: Hash + Eq> Values<T> {
    /// The number of a value; it is kept if it is new.
    pub(super) fn number(&mut self, value: T) -> u32 {
        match self.find(&value, |known| *known == value) {
            Some(number) => number,
            None => self.push(value),
        }
    }

    /// The number of the value that `is_it`; a key of it has the same hash.
    pub(super) fn find(&self, key: &impl Hash, is_it: impl Fn(&T) -> bool) -> Option<u32> {
        let hash = self.hashes.hash_one(key);
        self.numbers
            .find(hash, |number| is_it(self.get(*number)))
            .copied()
    }

    /// Keeps a value that is new.
    pub(super) fn push(&mut self, value: T) -> u32 {
        let Self {
            all,
            numbers,
            hashes,
        } = self;
        let number = all.len() as u32;
        let hash = hashes.hash_one(&value);
        all.push(value);
        let rehash = |number: &u32| hashes.hash_one(&all[*number as usize]);
        numbers.insert_unique(hash, number, rehash);
        number
    }
}

impl<T> Values<T> {
    /// The value of a number.
    pub(super) fn get(&self, number: u32) -> &T {
        &self.all[number as usize]
    }

    /// All values, by number.
    pub(super) fn all(&self) -> &[T] {
        &self.all
    }

    /// All values with what each becomes; two may become equal. After this no value is looked up by its content.
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
    fn equal_values_have_one_number() {
        let mut values = Values::default();
        let numbers: Vec<u32> = (0..3000).map(|n| values.number(n % 1000)).collect();
        assert!(
            numbers
                .iter()
                .zip(0..)
                .all(|(number, n)| *number == n % 1000)
        );
        assert_eq!((values.len(), *values.get(7)), (1000, 7));
    }
}
