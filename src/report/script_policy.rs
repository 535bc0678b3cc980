//! Content security policy of pages with one inline script: [`allow_script`].

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest as _, Sha256};

/// Text in the policy of a template that the digest of the script replaces.
const PLACEHOLDER: &str = "SCRIPT-DIGEST";

/// The page with the digest of its script in its policy, so that a browser runs that script alone. The data of a page
/// are in its script, so that the digest is computed last.
pub(super) fn allow_script(page: &str) -> String {
    let script =
        page.split_once("<script>").and_then(|(_, rest)| rest.split_once("</script>")).map_or("", |(script, _)| script);
    let digest = STANDARD.encode(Sha256::digest(script));
    page.replacen(PLACEHOLDER, &format!("sha256-{digest}"), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_policy_has_the_digest_of_the_script() {
        let page = "<meta content=\"script-src 'SCRIPT-DIGEST'\"><script>alert('Hello, world.');</script>";
        // The example of the specification, Content Security Policy Level 3.
        let expected = "script-src 'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='";
        assert!(allow_script(page).contains(expected), "{}", allow_script(page));
    }
}
