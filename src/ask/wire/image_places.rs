//! Images in the JSON of a request: [`with_images`].

use std::sync::Arc;

use crate::ask::body::Parts;
use crate::ask::payload::Payload;

/// A body with the images in their places; their bytes are shared, not copied.
///
/// A place is a field with an empty value, as `"url":""`. No question can contain one, because in a JSON text every quotation mark
/// has a backslash before it.
pub(super) fn with_images(json: String, place: &str, images: &[Arc<Payload>]) -> Parts {
    if images.is_empty() {
        return Parts::new([json.into()]);
    }
    debug_assert_eq!(json.matches(place).count(), images.len());
    let (open, close) = place.split_at(place.len() - 1);
    let mut pieces = Vec::with_capacity(2 * images.len() + 1);
    let mut begin = "";
    let mut images = images.iter();
    for words in json.split(place) {
        match images.next() {
            Some(image) => {
                pieces.push([begin, words, open].concat().into());
                pieces.push(image.data_url());
            }
            None => pieces.push([begin, words].concat().into()),
        }
        begin = close;
    }
    Parts::new(pieces)
}
