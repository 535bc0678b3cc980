//! The values that were made last: [`Recent`].

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// A cache of the `capacity` values that were added last. A thread that needs what another one is making waits for it.
///
/// First in, first out. The caches of libraries weigh how often a value is used (quick_cache was tried): with room for one or two
/// large frames they turn a new frame away, which is the one that is needed next.
#[derive(Debug)]
pub(crate) struct Recent<K, V> {
    capacity: usize,
    slots: Mutex<VecDeque<(K, Slot<V>)>>,
}

/// A value, or `None` until it is made.
type Slot<V> = Arc<Mutex<Option<V>>>;

impl<K: PartialEq + Clone, V: Clone> Recent<K, V> {
    pub(crate) fn new(capacity: usize) -> Self {
        let slots = Mutex::default();
        Self { capacity, slots }
    }

    /// The value of a key, made if it is not there; what fails is tried again the next time.
    ///
    /// # Errors
    /// Those of `make`.
    pub(crate) fn get<E>(&self, key: &K, make: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        let slot = self.slot(key);
        let mut value = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = &*value {
            return Ok(value.clone());
        }
        let made = make()?;
        *value = Some(made.clone());
        Ok(made)
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
    fn the_last_values_are_kept_and_failures_are_not() {
        let cache = Recent::new(2);
        let mut made = Vec::new();
        for key in [1, 2, 1, 3, 1, 3] {
            let value = cache.get(&key, || {
                made.push(key);
                Ok::<_, ()>(key * 10)
            });
            assert_eq!(value, Ok(key * 10));
        }
        assert_eq!(made, [1, 2, 3, 1]);
        assert_eq!(cache.get(&7, || Err("no")), Err("no"));
        assert_eq!(cache.get(&7, || Ok::<_, ()>(70)), Ok(70));
    }
}
