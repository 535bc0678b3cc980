//! `openeqa` end to end: prompts byte for byte, marks, upstream's files, what is missing, resume, batch, people.

mod costs;
mod marks;
mod prompts;
mod resume;
mod thoughts;
mod walks;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use serde_json::Value;

use crate::support::endpoint::{MockEndpoint, Request};

/// Requests that an endpoint received.
fn sent(mock: &MockEndpoint) -> Vec<Value> {
    mock.requests().iter().map(Request::json).collect()
}

/// The images of a request.
fn images(request: &Value) -> Vec<RgbImage> {
    let parts = request["messages"][0]["content"].as_array().unwrap();
    parts
        .iter()
        .filter_map(|part| part["image_url"]["url"].as_str())
        .map(|url| {
            let file = STANDARD.decode(url.strip_prefix("data:image/png;base64,").unwrap());
            image::load_from_memory(&file.unwrap()).unwrap().into_rgb8()
        })
        .collect()
}
