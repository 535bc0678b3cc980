//! Digests, canonical JSON, a cache, and shared values.
//!
//! A content hash of 32 bytes: [`Digest`].
//!
//! A small cache that evicts the oldest value first: [`Recent`].
//!
//! Immutable values that many records share: [`Shared`], and their deduplication: [`Distinct`].

#[cfg(feature = "program")]
mod canonical;

use std::collections::{HashSet, VecDeque};
use std::fmt;
use std::hash::Hash;
use std::ops::Deref;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::Error;
use crate::types::text::words::as_text;

#[cfg(feature = "program")]
use canonical::canonical;

/// A BLAKE3 digest, written as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest([u8; 32]);

impl Digest {
    /// The digest of some bytes.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// The digest of the bytes that a hasher was given.
    pub fn from_hasher(hasher: &blake3::Hasher) -> Self {
        Self(*hasher.finalize().as_bytes())
    }

    /// The digest of a value as canonical JSON: keys sorted, nulls and absent fields left out at every depth. `domain`
    /// names the kind of value and its version, as `darkqa.trial/2`, so that equal values of two kinds have different
    /// digests.
    ///
    /// # Errors
    /// If a number in the value is infinite or NaN, or a key of a map is not a string.
    #[cfg(feature = "program")]
    pub fn canonical(domain: &'static str, value: &impl serde::Serialize) -> Result<Self, Error> {
        Ok(Self::canonical_value(domain, value)?.0)
    }

    /// [`Digest::canonical`], together with the canonical value that was hashed.
    ///
    /// # Errors
    /// As [`Digest::canonical`].
    #[cfg(feature = "program")]
    pub fn canonical_value(
        domain: &'static str,
        value: &impl serde::Serialize,
    ) -> Result<(Self, serde_json::Value), Error> {
        let value = canonical(value).map_err(|e| Error::data(domain, e))?;
        Ok((Self::from_text(domain, &value.to_string()), value))
    }

    /// [`Digest::canonical`] in a tenth of the time, for a type that serializes to canonical JSON: its fields are
    /// declared in sorted order, `None` is skipped, and no number is a float.
    ///
    /// # Errors
    /// If a key of a map is not a string.
    #[cfg(feature = "program")]
    pub fn presorted(domain: &'static str, value: &impl serde::Serialize) -> Result<Self, Error> {
        Ok(Self::from_text(domain, &Self::presorted_text(domain, value)?))
    }

    /// The text that [`Digest::presorted`] hashes.
    ///
    /// # Errors
    /// As [`Digest::presorted`].
    #[cfg(feature = "program")]
    pub fn presorted_text(domain: &'static str, value: &impl serde::Serialize) -> Result<String, Error> {
        let text = serde_json::to_string(value).map_err(|e| Error::data(domain, e))?;
        debug_assert_eq!(canonical(value).ok().map(|value| value.to_string()).as_ref(), Some(&text));
        Ok(text)
    }

    /// [`Digest::presorted`] of one object: its first fields are those of `head`, a text of [`Digest::presorted_text`],
    /// and its further ones those of `rest`. Both have at least one field, and every name in `rest` sorts after all in
    /// `head`.
    ///
    /// # Errors
    /// As [`Digest::presorted`].
    #[cfg(feature = "program")]
    pub fn presorted_after(domain: &'static str, head: &str, rest: &impl serde::Serialize) -> Result<Self, Error> {
        let head = head.strip_suffix('}').unwrap_or(head);
        // Names of models, questions and conditions, and two digests.
        let mut text = Vec::with_capacity(domain.len() + head.len() + 512);
        text.extend_from_slice(domain.as_bytes());
        text.push(0);
        text.extend_from_slice(head.as_bytes());
        let comma = text.len();
        serde_json::to_writer(&mut text, rest).map_err(|e| Error::data(domain, e))?;
        // In place of the brace that opens the rest.
        text[comma] = b',';
        debug_assert!(
            serde_json::from_slice(&text[domain.len() + 1..])
                .is_ok_and(|value: serde_json::Value| { value.to_string().as_bytes() == &text[domain.len() + 1..] })
        );
        Ok(Self::from_bytes(&text))
    }

    #[cfg(feature = "program")]
    fn from_text(domain: &'static str, text: &str) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(domain.as_bytes()).update(&[0]);
        hasher.update(text.as_bytes());
        Self(*hasher.finalize().as_bytes())
    }

    /// The digest of several parts in order. The length of each part is hashed too, so that different lists never hash
    /// the same bytes.
    pub fn from_parts<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in parts {
            hasher.update(&(part.len() as u64).to_le_bytes()).update(part);
        }
        Self(*hasher.finalize().as_bytes())
    }

    /// The digest of a single file as it is, or a combined digest of several files in order; `None` without files.
    pub fn from_file_digests(files: impl IntoIterator<Item = Self>) -> Option<Self> {
        let files: Vec<Self> = files.into_iter().collect();
        match &*files {
            [] => None,
            [only] => Some(*only),
            several => Some(Self::from_parts(several.iter().map(|file| &file.0[..]))),
        }
    }

    /// The digest as 32 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", blake3::Hash::from_bytes(self.0).to_hex())
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

impl FromStr for Digest {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let hash = blake3::Hash::from_hex(text).map_err(|e| Error::data(format_args!("digest {text:?}"), e))?;
        Ok(Self(*hash.as_bytes()))
    }
}

as_text!(Digest);

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
    fn digest_of_two_parts_is_that_of_one_object() {
        #[derive(serde::Serialize)]
        struct Head<'a> {
            before: &'a str,
            choices: [&'a str; 2],
        }
        #[derive(serde::Serialize)]
        struct Rest {
            model: String,
            repeat: u32,
        }
        let head = Head { before: "Is it \"red\"}?", choices: ["{yes}", "no\n"] };
        let rest = Rest { model: "m".to_owned(), repeat: 2 };
        let whole = serde_json::json!({
            "before": head.before, "choices": head.choices, "model": rest.model, "repeat": rest.repeat,
        });
        let text = Digest::presorted_text("darkqa.test/1", &head).unwrap();
        let digest = Digest::presorted_after("darkqa.test/1", &text, &rest).unwrap();
        assert_eq!(digest, Digest::canonical("darkqa.test/1", &whole).unwrap());
        assert_ne!(digest, Digest::presorted_after("darkqa.test/2", &text, &rest).unwrap());
        let other = Rest { repeat: 3, ..rest };
        assert_ne!(digest, Digest::presorted_after("darkqa.test/1", &text, &other).unwrap());
    }

    #[test]
    fn canonical_digest_hashes_domain_and_json() {
        let value = std::collections::BTreeMap::from([("a", [Some(1), None])]);
        let first = Digest::canonical("darkqa.test/1", &value).unwrap();
        assert_eq!(first, Digest::from_bytes(b"darkqa.test/1\0{\"a\":[1,null]}"));
        assert_ne!(first, Digest::canonical("darkqa.test/2", &value).unwrap());
        assert!(Digest::canonical("darkqa.test/1", &f32::NAN).is_err());
    }

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
