//! The header that carries a key: [`KeyHeader`].

use crate::types::words::words;

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

words!(KeyHeader by "--key-header" {
    Auto = "auto",
    Bearer = "bearer",
    ApiKey = "api-key",
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for name in ["auto", "bearer", "api-key"] {
            assert_eq!(name.parse::<KeyHeader>().unwrap().to_string(), name);
        }
        assert!("basic".parse::<KeyHeader>().is_err());
    }
}
