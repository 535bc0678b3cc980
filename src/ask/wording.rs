//! What servers write into errors, with the cause and the remedy: [`Wording::find`], by `wordings.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::complaint::Complaint;
use super::failure::Reach;

/// A cause of refused requests.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wording {
    cause: String,
    remedy: String,
    reach: WordingReach,
    /// Whether only requests with images are refused for it.
    #[serde(default)]
    images: bool,
    patterns: Vec<String>,
}

/// The requests that fail for a cause.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum WordingReach {
    All,
    Size,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wordings {
    wording: Vec<Wording>,
}

static WORDINGS: LazyLock<Vec<Wording>> = LazyLock::new(|| {
    let all: Wordings = toml::from_str(include_str!("wordings.toml")).unwrap_or_default();
    all.wording
});

impl Wording {
    /// The cause that an error is about; `None` if the table does not have it.
    pub(super) fn find(complaint: &Complaint, has_image: bool) -> Option<&'static Self> {
        let texts = complaint.texts();
        let mut all = WORDINGS.iter();
        all.find(|wording| {
            let mut patterns = wording.patterns.iter();
            (has_image || !wording.images)
                && patterns.any(|pattern| texts.iter().any(|text| text.contains(pattern)))
        })
    }

    /// The requests that fail for the cause.
    pub(super) fn reach(&self) -> Reach {
        match self.reach {
            WordingReach::All => Reach::Endpoint,
            WordingReach::Size => Reach::Alike,
        }
    }

    /// The cause and the remedy.
    pub(super) fn hint(&self) -> String {
        format!("{}: {}", self.cause, self.remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_complete() {
        let all: Wordings = toml::from_str(include_str!("wordings.toml")).unwrap();
        let patterns = all.wording.iter().flat_map(|wording| &wording.patterns);
        let mut patterns: Vec<&String> = patterns.collect();
        assert!(
            patterns
                .iter()
                .all(|p| **p == p.to_lowercase() && p.len() > 8)
        );
        let count = patterns.len();
        patterns.sort();
        patterns.dedup();
        assert_eq!(patterns.len(), count);
    }

    #[test]
    fn words_of_servers_have_their_cause() {
        for (body, flag) in [
            (
                r#"{"error":"Model does not support images. Please use a model that does."}"#,
                "--blind",
            ),
            (
                r#"{"object":"error","message":"This model's maximum context length is 4096 tokens. However, you requested 5000 tokens","code":400}"#,
                "--max-tokens",
            ),
            (
                r#"{"object":"error","message":"The decoder prompt (length 5000) is longer than the maximum model length of 4096.","code":400}"#,
                "--max-side",
            ),
            (
                r#"[{"error":{"code":400,"message":"Bad key","status":"INVALID_ARGUMENT","details":[{"reason":"API_KEY_INVALID"}]}}]"#,
                "--api-key-env",
            ),
        ] {
            let wording = Wording::find(&Complaint::of_body(body), true);
            let hint = wording.unwrap_or_else(|| panic!("{body}")).hint();
            assert!(hint.contains(flag), "{body}: {hint}");
        }
        let text = Complaint::of_body(r#"{"error":{"message":"m is not a multimodal model"}}"#);
        assert!(Wording::find(&text, false).is_none(), "no image was sent");
        let other = Complaint::of_body(r#"{"error":{"message":"the image is too small"}}"#);
        assert!(Wording::find(&other, true).is_none());
    }
}
