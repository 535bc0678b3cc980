//! Immutable values that many records share: [`Shared`], and their deduplication: [`Distinct`].

use std::collections::HashSet;
use std::fmt;
use std::hash::Hash;
use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// An immutable value with several owners, an [`Arc`] that is serialized as the value itself.
#[derive(PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Shared<T>(Arc<T>);

impl<T> Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> AsRef<T> for Shared<T> {
    fn as_ref(&self) -> &T {
        self
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T: fmt::Display> fmt::Display for Shared<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<T: fmt::Debug> fmt::Debug for Shared<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<T> From<T> for Shared<T> {
    fn from(value: T) -> Self {
        Self(Arc::new(value))
    }
}

impl<T> FromIterator<T> for Shared<Vec<T>> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self::from(values.into_iter().collect::<Vec<T>>())
    }
}

impl<T: Serialize> Serialize for Shared<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Shared<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        T::deserialize(deserializer).map(Self::from)
    }
}

/// A set of shared values, to replace equal values by one.
#[derive(Debug)]
pub struct Distinct<T>(HashSet<Shared<T>>);

impl<T> Clone for Distinct<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Default for Distinct<T> {
    fn default() -> Self {
        Self(HashSet::new())
    }
}

impl<T: Eq + Hash> Distinct<T> {
    /// Replaces a value by the first equal one, if there was one.
    pub fn share(&mut self, value: &mut Shared<T>) {
        if let Some(first) = self.0.get(value) {
            *value = first.clone();
        } else {
            self.0.insert(value.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_values_share_memory() {
        let mut distinct = Distinct::default();
        let [mut one, mut other, mut same] = ["a", "b", "a"].map(|text| Shared::from(text.to_owned()));
        for value in [&mut one, &mut other, &mut same] {
            distinct.share(value);
        }
        assert!(std::sync::Arc::ptr_eq(&one.0, &same.0) && one == same);
        assert!(one != other && serde_json::to_string(&one).unwrap() == "\"a\"");
        assert_eq!(serde_json::from_str::<Shared<String>>("\"b\"").unwrap(), other);
    }
}
