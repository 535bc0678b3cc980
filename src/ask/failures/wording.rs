//! Causes and remedies of server errors, recognized by their wording: [`Wording::find`], with the table
//! `wordings.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::api_error::ApiError;
use super::ask_error::Reach;

/// A cause of refused requests, with the text patterns that indicate it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wording {
    cause: String,
    remedy: String,
    reach: WordingReach,
    /// True if only requests with images can have this cause.
    #[serde(default)]
    images: bool,
    patterns: Vec<String>,
}

/// Requests that fail for a cause.
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

/// The built-in table; a test parses it.
static WORDINGS: LazyLock<Wordings> =
    LazyLock::new(|| toml::from_str(include_str!("../wordings.toml")).unwrap_or_default());

impl Wording {
    /// Finds the cause of an error; `None` if the table does not have it.
    pub(crate) fn find(api_error: &ApiError, has_image: bool) -> Option<&'static Self> {
        let texts = api_error.lower_case_texts();
        WORDINGS.wording.iter().find(|wording| {
            (has_image || !wording.images)
                && wording.patterns.iter().any(|pattern| texts.iter().any(|text| text.contains(pattern)))
        })
    }

    /// Requests that fail for this cause.
    pub(super) fn reach(&self) -> Reach {
        match self.reach {
            WordingReach::All => Reach::Endpoint,
            WordingReach::Size => Reach::Alike,
        }
    }

    /// Cause and remedy, as one text.
    pub(super) fn hint(&self) -> String {
        format!("{}: {}", self.cause, self.remedy)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_table_is_complete() {
        let all: Wordings = toml::from_str(include_str!("../wordings.toml")).unwrap();
        let mut patterns: Vec<&String> = all.wording.iter().flat_map(|wording| &wording.patterns).collect();
        assert!(patterns.iter().all(|p| **p == p.to_lowercase() && p.len() > 8));
        let count = patterns.len();
        patterns.sort();
        patterns.dedup();
        assert_eq!(patterns.len(), count);
    }

    fn flat(message: &str) -> String {
        json!({"object": "error", "message": message, "type": "BadRequestError", "code": 400}).to_string()
    }

    fn error(message: &str) -> String {
        json!({"error": {"message": message}}).to_string()
    }

    #[test]
    fn server_errors_have_a_cause() {
        for (body, flag) in [
            (flat("facebook/opt-125m is not a multimodal model None"), "--blind"),
            (json!({"error": "Model does not support images. Please use a model that does."}).to_string(), "--blind"),
            (error("Error in iterating prediction stream: ValueError: Vision add-on is not loaded, but images were provided for processing"), "--blind"),
            (error("this model is missing data required for image input"), "--blind"),
            (error("image input is not supported by this server"), "--blind"),
            (error("Failed to deserialize the JSON body into the target type: messages[1]: unknown variant `image_url`, expected `text` at line 1 column 690848"), "--blind"),
            (error("Failed to deserialize the JSON body into the target type: messages[1]: data did not match any variant of untagged enum ChatCompletionRequestContent at line 1 column 18231"), "--blind"),
            (error("messages[1].content must be a string"), "--blind"),
            (json!({"object": "Error", "message": "Image input is not enabled for this model", "code": 3051}).to_string(), "--blind"),
            (error("prompting with images is incompatible with system messages"), "--system"),
            (flat("At most 0 image(s) may be provided in one request."), "--blind"),
            (flat("At most 1 image(s) may be provided in one request."), "--limit-mm-per-prompt"),
            (flat("This model's maximum context length is 4096 tokens. However, you requested 5000 tokens"), "--max-tokens"),
            (flat("The decoder prompt (length 5000) is longer than the maximum model length of 4096."), "--image max-side"),
            (flat("Multimodal prompt is too long after expanding multimodal tokens. After expanding len(req.origin_input_ids_unpadded)=5192 => 6153 >= 5489."), "--image max-side"),
            (flat("The input (61709 tokens) is longer than the model's context length (40960 tokens)."), "--image max-side"),
            (flat("The request exceeds the model context length."), "--image max-side"),
            (error("internal error happened, status code ResponseType.INPUT_LENGTH_ERROR"), "--image max-side"),
            (json!({"error": {"code": 400, "message": "too long", "type": "exceed_context_size_error", "n_ctx": 256}}).to_string(), "--image max-side"),
            (json!({"error": "Trying to keep the first 111490 tokens when context the overflows. However, the model is loaded with context length of only 32768 tokens"}).to_string(), "--image max-side"),
            (json!({"error": {"message": "Please reduce the length of the messages or completion.", "code": "context_length_exceeded"}}).to_string(), "--image max-side"),
            (json!([{"error": {"code": 400, "message": "Bad key", "details": [{"reason": "API_KEY_INVALID"}]}}]).to_string(), "--api-key-env"),
        ] {
            let wording = Wording::find(&ApiError::from_body(&body), true);
            let hint = wording.unwrap_or_else(|| panic!("{body}")).hint();
            assert!(hint.contains(flag), "{body}: {hint}");
        }
        let text = ApiError::from_body(r#"{"error":{"message":"m is not a multimodal model"}}"#);
        assert!(Wording::find(&text, false).is_none(), "no image was sent");
        let other = ApiError::from_body(r#"{"error":{"message":"the image is too small"}}"#);
        assert!(Wording::find(&other, true).is_none());
    }
}
