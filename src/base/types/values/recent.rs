//! A small cache that evicts the oldest value first: [`Recent`].

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// A first-in, first-out cache of at most `capacity` values. If another thread is already computing a value, `get`
/// waits for it.
///
/// Cache crates consider how often a value is used (quick_cache was tried): with a capacity of one or two large frames
/// they reject a new frame, although it is needed next.
#[derive(Debug)]
pub struct Recent<K, V> {
    capacity: usize,
    slots: Mutex<VecDeque<(K, Slot<V>)>>,
}

/// A cached value; `None` until it is computed.
type Slot<V> = Arc<Mutex<Option<V>>>;

impl<K: PartialEq + Clone, V: Clone> Recent<K, V> {
    /// An empty cache of `capacity` values.
    pub fn new(capacity: usize) -> Self {
        let slots = Mutex::default();
        Self { capacity, slots }
    }

    /// The value of a key, computed by `compute` if it is not cached. Errors are not cached.
    ///
    /// # Errors
    /// Errors of `compute`.
    pub fn get<E>(&self, key: &K, compute: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        let slot = self.slot(key);
        let mut value = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = &*value {
            return Ok(value.clone());
        }
        let new = compute()?;
        *value = Some(new.clone());
        Ok(new)
    }

    fn slot(&self, key: &K) -> Slot<V> {
        let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, slot)) = slots.iter().find(|(known, _)| known == key) {
            return Arc::clone(slot);
        }
        let slot = Slot::default();
        slots.push_back((key.clone(), Arc::clone(&slot)));
        if slots.len() > self.capacity {
            slots.pop_front();
        }
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_values_are_cached_and_errors_are_not() {
        let cache = Recent::new(2);
        let mut computed = Vec::new();
        for key in [1, 2, 1, 3, 1, 3] {
            let value = cache.get(&key, || {
                computed.push(key);
                Ok::<_, ()>(key * 10)
            });
            assert_eq!(value, Ok(key * 10));
        }
        assert_eq!(computed, [1, 2, 3, 1]);
        assert_eq!(cache.get(&7, || Err("no")), Err("no"));
        assert_eq!(cache.get(&7, || Ok::<_, ()>(70)), Ok(70));
    }
}
