//! Images in the JSON of a request: [`with_images`].

use std::sync::Arc;

use crate::ask::requests::Parts;
use crate::picture::Payload;

/// A body of these fields and of one more of this name behind them, with the images in their places in it; their bytes are shared,
/// not copied.
///
/// A place is a field with an empty value, as `"url":""`. No question can contain one, because in a JSON text every quotation mark
/// has a backslash before it. The other fields may be the user's, so no place is looked for in them.
pub(super) fn with_images<'a>(
    fields: &str,
    name: &str,
    json: &str,
    place: &str,
    mut images: impl Iterator<Item = &'a Arc<Payload>> + Clone,
) -> Parts {
    let fields = fields.strip_suffix('}').unwrap_or(fields);
    let head = format!("{fields},\"{name}\":");
    let json = format!("{json}}}");
    let count = images.clone().count();
    if count == 0 {
        return Parts::new([(head + &json).into()]);
    }
    debug_assert_eq!(json.matches(place).count(), count);
    let (open, close) = place.split_at(place.len() - 1);
    let mut pieces = Vec::with_capacity(2 * count + 1);
    let mut begin = &*head;
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
