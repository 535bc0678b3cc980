//! Whether a key may go to an address by its looks: [`check_owner`].

use super::secret::Secret;
use super::url::BaseUrl;
use super::vendor::Vendor;
use crate::error::{Error, Result};

/// Refuses a key that looks like one of a vendor at an address of another: a wrong variable, or an address that a stranger wrote, would
/// give it away. An address of this machine may be a gateway that passes it on.
///
/// # Errors
/// Names the vendor of the key and the address, and never the key.
pub(super) fn check_owner(key: &Secret, base: &BaseUrl) -> Result<()> {
    match Vendor::of_key(key.expose()) {
        Some(owner) if !base.is_loopback() && !owner.is_of(base.host()) => Err(Error::usage(
            "--base-url",
            format_args!(
                "{base}: the key looks like one of {}, and this address is another's; name the key of this address with --api-key-env NAME, \
                 or type --key-anyway to send it there",
                owner.name
            ),
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_goes_to_its_own_vendor() {
        let check = |key: &str, address: &str| {
            let key = Secret::new(key, "KEY").unwrap();
            check_owner(&key, &address.parse().unwrap()).map_err(|e| e.to_string())
        };
        for (key, address) in [
            ("sk-ant-123", "https://api.anthropic.com/v1"),
            ("sk-ant-123", "http://127.0.0.1:4000/v1"),
            ("sk-123", "https://api.example.org/v1"),
        ] {
            assert_eq!(check(key, address), Ok(()), "{address}");
        }
        for address in ["https://api.openai.com/v1", "https://api.example.org/v1"] {
            let error = check("sk-ant-123", address).unwrap_err();
            assert!(
                error.contains("looks like one of Anthropic") && error.contains("--key-anyway")
            );
            assert!(!error.contains("sk-ant"), "{error}");
        }
    }
}
