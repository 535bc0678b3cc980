//! A content hash of 32 bytes: [`Digest`].

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
        let text = serde_json::to_string(value).map_err(|e| Error::data(domain, e))?;
        debug_assert_eq!(canonical(value).ok().map(|value| value.to_string()).as_ref(), Some(&text));
        Ok(Self::from_text(domain, &text))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn canonical_digest_hashes_domain_and_json() {
        let value = std::collections::BTreeMap::from([("a", [Some(1), None])]);
        let first = Digest::canonical("darkqa.test/1", &value).unwrap();
        assert_eq!(first, Digest::from_bytes(b"darkqa.test/1\0{\"a\":[1,null]}"));
        assert_ne!(first, Digest::canonical("darkqa.test/2", &value).unwrap());
        assert!(Digest::canonical("darkqa.test/1", &f32::NAN).is_err());
    }
}
