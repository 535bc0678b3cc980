//! The HTTP status that the words of an error imply which a server sent with a success status: [`implied_status`].

use super::api_error::ApiError;
use super::moderation::{is_moderated, is_out_of_tokens};
use super::vocabulary;

/// The HTTP status that an error implies which came with a success status: its code, or what its words mean. Without
/// either it is a failure of the server, which may pass.
pub(crate) fn implied_status(api_error: &ApiError) -> u16 {
    if let Some(status) = api_error.status() {
        return status;
    }
    let is_credit = api_error.has_code_like(&vocabulary::CREDIT_CODES) || api_error.mentions_any(&vocabulary::CREDIT);
    if is_moderated(400, api_error) || is_out_of_tokens(400, api_error) {
        400
    } else if is_credit {
        402
    } else if api_error.mentions_any(&vocabulary::RATE) {
        429
    } else if api_error.mentions_any(&vocabulary::WRONG_KEY) {
        401
    } else {
        500
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ask::failures::find_error;
    use serde_json::{Value, json};

    fn status(body: &Value) -> Option<(String, u16)> {
        let error = ApiError::from_error(&find_error(body)?);
        Some((error.message.clone(), implied_status(&error)))
    }

    #[test]
    fn errors_of_every_structure_are_found() {
        for (body, message, expected) in [
            (
                json!({"choices": null, "base_resp": {"status_code": 1026, "status_msg": "input new_sensitive"}}),
                "input new_sensitive",
                400,
            ),
            (
                json!({"base_resp": {"status_code": 1004, "status_msg": "login fail: Please carry the API secret key"}}),
                "login fail: Please carry the API secret key",
                401,
            ),
            (
                json!({"base_resp": {"status_code": 1008, "status_msg": "insufficient balance"}}),
                "insufficient balance",
                402,
            ),
            (
                json!({"base_resp": {"status_code": 1002, "status_msg": "rate limit exceeded(RPM)"}}),
                "rate limit exceeded(RPM)",
                429,
            ),
            (
                json!({"error_code": 18, "error_msg": "Open api qps request limit reached"}),
                "Open api qps request limit reached",
                429,
            ),
            (json!({"code": "10013", "msg": "内容审核不通过"}), "内容审核不通过", 400),
            (json!({"errors": [{"code": 10000, "message": "Authentication error"}]}), "Authentication error", 401),
            (json!({"Response": {"ErrorCode": 503, "ErrorMsg": "busy"}}), "busy", 503),
            (json!({"code": 7, "msg": "oops"}), "oops", 500),
        ] {
            let expected = (message.to_owned(), expected);
            assert_eq!(status(&body), Some(expected), "{body}");
        }
    }

    #[test]
    fn bodies_without_an_error_have_none() {
        for body in [
            json!({"base_resp": {"status_code": 0, "status_msg": "success"}}),
            json!({"base_resp": {"status_code": 0, "status_msg": ""}, "choices": null}),
            json!({"code": 200, "msg": "ok"}),
            json!({"code": "success", "message": "done"}),
            json!({"usage": {"total_tokens": 5}, "model": "m"}),
            json!({"status": "in_progress", "message": "soon"}),
            json!([1]),
            json!("x"),
        ] {
            assert_eq!(find_error(&body), None, "{body}");
        }
    }
}
