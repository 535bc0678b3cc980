//! A hash of 32 bytes that identifies a content: [`Digest`].

use std::fmt;
use std::str::FromStr;

#[cfg(feature = "program")]
use super::canonical::canonical;
use crate::error::Error;
use crate::types::text::words::as_text;

/// A BLAKE3 digest, written as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest([u8; 32]);

impl Digest {
    /// The digest of some bytes.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// The digest of a value as canonical JSON: keys sorted, nulls and absent fields left out at every depth. `domain` names
    /// the kind of value and its version, as `darkqa.trial/2`, so that equal values of two kinds have different digests.
    ///
    /// # Errors
    /// If a number in it is infinite or NaN, or a key of a map is not a text.
    #[cfg(feature = "program")]
    pub fn canonical(domain: &'static str, value: &impl serde::Serialize) -> Result<Self, Error> {
        Ok(Self::canonical_value(domain, value)?.0)
    }

    /// The same digest, with the value that it is the digest of: keys sorted, nulls and absent fields left out at every depth.
    #[cfg(feature = "program")]
    pub fn canonical_value(
        domain: &'static str,
        value: &impl serde::Serialize,
    ) -> Result<(Self, serde_json::Value), Error> {
        let value = canonical(value).map_err(|e| Error::data(domain, e))?;
        Ok((Self::from_text(domain, &value.to_string()), value))
    }

    /// The same digest as [`Digest::canonical`], ten times as fast, of a value whose JSON is canonical as it is written: its fields
    /// are sorted, `None` is skipped, and no number is a float.
    ///
    /// # Errors
    /// If a key of a map is not a text.
    #[cfg(feature = "program")]
    pub fn sorted(domain: &'static str, value: &impl serde::Serialize) -> Result<Self, Error> {
        let text = serde_json::to_string(value).map_err(|e| Error::data(domain, e))?;
        debug_assert_eq!(
            canonical(value)
                .ok()
                .map(|value| value.to_string())
                .as_ref(),
            Some(&text)
        );
        Ok(Self::from_text(domain, &text))
    }

    #[cfg(feature = "program")]
    fn from_text(domain: &'static str, text: &str) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(domain.as_bytes()).update(&[0]);
        hasher.update(text.as_bytes());
        Self(*hasher.finalize().as_bytes())
    }

    /// The digest of several parts in order. Each part's length is hashed too, so that no two lists have the same input.
    pub fn from_parts<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in parts {
            hasher
                .update(&(part.len() as u64).to_le_bytes())
                .update(part);
        }
        Self(*hasher.finalize().as_bytes())
    }

    /// The digest of one file, or the combined digest, in order, of several that are shown together; `None` if there is no file.
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
        let hash = blake3::Hash::from_hex(text)
            .map_err(|e| Error::data(format_args!("digest {text:?}"), e))?;
        Ok(Self(*hash.as_bytes()))
    }
}

as_text!(Digest);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn canonical_digests_are_of_domain_and_text() {
        let digest = |domain, value: [Option<u8>; 2]| {
            Digest::canonical(domain, &std::collections::BTreeMap::from([("a", value)])).unwrap()
        };
        let value = [Some(1), None];
        let first = digest("darkqa.test/1", value);
        assert_eq!(
            first,
            Digest::from_bytes(b"darkqa.test/1\0{\"a\":[1,null]}")
        );
        assert_ne!(first, digest("darkqa.test/2", value));
        assert!(Digest::canonical("darkqa.test/1", &f32::NAN).is_err());
    }
}
