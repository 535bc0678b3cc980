//! The header that carries a key: [`KeyHeader`].

use std::fmt;
use std::str::FromStr;

use crate::error::{Error, Result};

/// The header that carries a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyHeader {
    /// `api-key` at Azure, `Authorization` elsewhere.
    Auto,
    /// `Authorization: Bearer …`; at Azure for tokens of Microsoft Entra.
    Bearer,
    /// `api-key: …`, as Azure and gateways before it want it.
    ApiKey,
}

impl KeyHeader {
    const NAMES: [(Self, &str); 3] = [
        (Self::Auto, "auto"),
        (Self::Bearer, "bearer"),
        (Self::ApiKey, "api-key"),
    ];
}

impl fmt::Display for KeyHeader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(header, _)| header == self);
        f.pad(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for KeyHeader {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(header, _)| *header).ok_or_else(|| {
            Error::usage(
                "--key-header",
                format_args!("{text:?} is none of auto, bearer, api-key"),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for (header, name) in KeyHeader::NAMES {
            assert_eq!(name.parse::<KeyHeader>().unwrap(), header);
            assert_eq!(header.to_string(), name);
        }
        assert!("basic".parse::<KeyHeader>().is_err());
    }
}
