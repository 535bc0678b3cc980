//! Check that a key belongs to the vendor of an address: [`check_owner`].

use super::secret::Secret;
use crate::ask::endpoints::BaseUrl;
use crate::ask::vendors::VendorTable;
use crate::error::{Error, Result};

/// Checks that a key does not look like the key of another vendor: a wrong variable, or an address from someone else,
/// would disclose it. Any key may be sent to this machine, which may run a gateway.
///
/// # Errors
/// If the key belongs to another vendor. The error names the vendor and the address, but never the key.
pub(crate) fn check_owner(key: &Secret, base: &BaseUrl, vendors: VendorTable) -> Result<()> {
    match vendors.by_key(key.expose()) {
        Some(owner) if !base.is_loopback() && !owner.owns_host(base.host()) => Err(Error::usage(
            "--base-url",
            format_args!(
                "{base}: the key looks like one of {}, and this address is another's; name the key of this address with --api-key-env NAME, \
                 or type --allow key-mismatch to send it there",
                owner.name
            ),
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(vendors: VendorTable, key: &str, address: &str) -> Result<(), String> {
        let key = Secret::new(key, "KEY").unwrap();
        check_owner(&key, &address.parse().unwrap(), vendors).map_err(|e| e.to_string())
    }

    #[test]
    fn keys_are_sent_only_to_their_vendor() {
        let rows = tempfile::NamedTempFile::new().unwrap();
        let text = "[[vendor]]\nname = \"Campus\"\nhosts = [\"llm.example\"]\nkey = [\"K\"]\nkey-form = [\"camp-\", \"sk-proj-\"]\n";
        std::fs::write(rows.path(), text).unwrap();
        let own = VendorTable::read(rows.path()).unwrap();
        for (key, address) in [
            ("sk-ant-123", "https://api.anthropic.com/v1"),
            ("sk-ant-123", "http://127.0.0.1:4000/v1"),
            ("sk-123", "https://api.example.org/v1"),
        ] {
            assert_eq!(check(VendorTable::default(), key, address), Ok(()), "{address}");
        }
        for address in ["https://api.openai.com/v1", "https://api.example.org/v1"] {
            let error = check(own, "sk-ant-123", address).unwrap_err();
            assert!(error.contains("looks like one of Anthropic") && error.contains("--allow key-mismatch"));
            assert!(!error.contains("sk-ant"), "{error}");
        }
        // The user's table can add key forms. Its hosts may receive keys of these forms, even if they are another
        // vendor's.
        let gateway = "https://llm.example/v1";
        assert_eq!(check(own, "camp-123", gateway), Ok(()));
        assert_eq!(check(own, "sk-proj-123", gateway), Ok(()));
        assert!(check(VendorTable::default(), "sk-proj-123", gateway).is_err());
        let error = check(own, "camp-123", "https://api.example.org/v1").unwrap_err();
        assert!(error.contains("looks like one of Campus"), "{error}");
    }
}
