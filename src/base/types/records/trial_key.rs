//! The key that identifies a trial: [`TrialKey`].

use std::fmt;
use std::str::FromStr;

use crate::error::Error;
use crate::types::text::words::as_text;
use crate::types::values::Digest;

/// The digest of everything that decides a reply: question and choices as shown, the recipe of the image, prompt, model
/// and parameters. Trials with the same key are the same trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrialKey([u8; 16]);

impl From<Digest> for TrialKey {
    fn from(digest: Digest) -> Self {
        let mut key = [0; 16];
        key.copy_from_slice(&digest.as_bytes()[..16]);
        Self(key)
    }
}

impl TrialKey {
    /// The key as 16 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 16] {
        &self.0
    }
}

impl fmt::Display for TrialKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", u128::from_be_bytes(self.0))
    }
}

impl FromStr for TrialKey {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        // `from_str_radix` would accept a sign.
        if text.len() == 32
            && text.bytes().all(|b| b.is_ascii_hexdigit())
            && let Ok(key) = u128::from_str_radix(text, 16)
        {
            return Ok(Self(key.to_be_bytes()));
        }
        let problem = format_args!("{text:?} is not a key of 32 hexadecimal digits");
        Err(Error::data("key", problem))
    }
}

as_text!(TrialKey);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_read_back() {
        let key = TrialKey::from(Digest::from_bytes(b"a trial"));
        assert_eq!(key.to_string().parse::<TrialKey>().unwrap(), key);
        for wrong in ["", "12", &"g".repeat(32), &format!("+{}", "1".repeat(31))] {
            assert!(wrong.parse::<TrialKey>().is_err(), "{wrong}");
        }
    }
}
