//! Marks such as `<image 2>` for the places of images in a text: [`mark`] writes one, [`pieces`] splits a text at them.

use std::sync::LazyLock;

use regex::Regex;

/// A piece of a text with marks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkedPiece<'a> {
    /// Words between two marks; never empty.
    Words(&'a str),
    /// The place of an image, by its index from 0.
    Image(usize),
}

/// The mark of the image at an index: 0 is `<image 1>`.
pub fn mark(index: usize) -> String {
    format!("<image {}>", index + 1)
}

/// Matches a [`mark`] whose number has no leading zeros.
static MARK: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new("<image ([1-9][0-9]{0,3})>").ok());

/// Splits a text at its marks. A mark stays part of the words if `is_place` returns false for the index of its image.
pub fn pieces(text: &str, mut is_place: impl FnMut(usize) -> bool) -> Vec<MarkedPiece<'_>> {
    let mut pieces = Vec::new();
    let mut end = 0;
    for captures in MARK.iter().flat_map(|mark| mark.captures_iter(text)) {
        let (Some(place), Ok(number)) = (captures.get(0), captures[1].parse::<usize>()) else {
            continue;
        };
        let index = number - 1;
        if !is_place(index) {
            continue;
        }
        pieces.push(MarkedPiece::Words(&text[end..place.start()]));
        pieces.push(MarkedPiece::Image(index));
        end = place.end();
    }
    pieces.push(MarkedPiece::Words(&text[end..]));
    pieces.retain(|piece| *piece != MarkedPiece::Words(""));
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_at_its_marks() {
        use MarkedPiece::{Image, Words};
        let text = format!("{}Is it like {}?", mark(1), mark(0));
        assert_eq!(pieces(&text, |_| true), [Image(1), Words("Is it like "), Image(0), Words("?")]);
        for other in ["<image>", "<image 0>", "<image 01>", "<image 12345>", "< image 1>"] {
            assert_eq!(pieces(other, |_| true), [Words(other)]);
        }
        assert_eq!(pieces("", |_| true), []);
        let first = pieces("<image 1> or <image 2>", |index| index == 1);
        assert_eq!(first, [Words("<image 1> or "), Image(1)]);
    }
}
