//! Insertion of images into the JSON of a request: [`with_images`].

use std::sync::Arc;

use crate::ask::requests::RequestBody;
use crate::pictures::Payload;

/// Builds a request body from the JSON object `fields` and one more field with the value `json`, in which each `place`
/// is replaced by the data URL of an image. The bytes of the images are shared, not copied.
///
/// A place is a field with an empty value, such as `"url":""`. The text of a question cannot contain one, because JSON
/// escapes every quotation mark. `fields` is not searched for places, because it may contain fields of the user.
pub(super) fn with_images<'a>(
    fields: &str,
    name: &str,
    json: &str,
    place: &str,
    mut images: impl Iterator<Item = &'a Arc<Payload>> + Clone,
) -> RequestBody {
    let fields = fields.strip_suffix('}').unwrap_or(fields);
    let head = format!("{fields},\"{name}\":");
    let json = format!("{json}}}");
    let count = images.clone().count();
    if count == 0 {
        return RequestBody::new([(head + &json).into()]);
    }
    debug_assert_eq!(json.matches(place).count(), count);
    let (open, close) = place.split_at(place.len() - 1);
    let mut chunks = Vec::with_capacity(2 * count + 1);
    let mut start = head.as_str();
    for text in json.split(place) {
        match images.next() {
            Some(image) => {
                chunks.push([start, text, open].concat().into());
                chunks.push(image.data_url());
            }
            None => chunks.push([start, text].concat().into()),
        }
        start = close;
    }
    RequestBody::new(chunks)
}
