//! Detection of servers that shrink images, by the tokens that they count: [`ImageTokenCheck`].
//!
//! A model that sees an image at its full size has a token for each of its patches. A server that counts far fewer
//! tokens has made the image smaller first: LM Studio to a longer side of 500 or 1024 pixels, Ollama to a number of
//! tokens, vLLM to its `max_pixels`. Averaging pixels removes noise and small objects.

use crate::types::text::plural;

/// Share of the tokens by the family's rule below which an image was shrunk; chosen: half the area, and a tolerance for
/// the text.
const MAX_SHARE: f64 = 0.6;

/// Minimum number of tokens by the family's rule for an image to be judged; chosen, so that the text matters little.
const MIN_EXPECTED: f64 = 100.0;

/// Minimum number of tokens that a server counts for an image; with fewer it does not count images at all. Chosen, more
/// than the error of an estimate of the text.
const MIN_COUNTED: f64 = 64.0;

/// Maximum number of characters per token of a text; chosen, twice the usual number in English.
const MAX_CHARACTERS_PER_TOKEN: f64 = 8.0;

/// Usual number of characters per token in English, and of tokens of a message besides its text.
const USUAL: (f64, f64) = (4.0, 10.0);

/// Minimum number of replies about large images, and of their share that shows shrunk images; chosen.
const MIN_REPLIES: usize = 5;
const MIN_SHARE: f64 = 0.9;

/// Tokens of a large image by the rule, as a share of those of the largest image; chosen. A server may leave smaller
/// ones as they are.
const LARGE: f64 = 0.5;

/// Maximum number of replies that are kept; chosen.
const MAX_REPLIES: usize = 200;

/// Difference of counts up to which they are the same for all sizes, and ratio of the rule's counts from which sizes
/// differ; chosen.
const SAME: f64 = 0.1;
const OTHER_SIZE: f64 = 1.25;

/// Tokens that a server counts for the images of a model, beside the rule of the model's family.
#[derive(Debug, Clone, Default)]
pub(crate) struct ImageTokenCheck {
    replies: Vec<Counted>,
}

/// Tokens of one image of a reply.
#[derive(Debug, Clone, Copy)]
struct Counted {
    /// Estimate of the tokens that the server counts.
    tokens: f64,
    /// Tokens by the rule of the model's family.
    expected: f64,
    is_shrunk: bool,
}

/// Images that a server shrinks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShrunkImages {
    /// Median of the tokens that the server counts for an image.
    counted: f64,
    /// Median of the tokens by the rule of the model's family.
    expected: f64,
    replies: usize,
    /// True if images of several sizes have the same number of tokens.
    is_same: bool,
}

impl ImageTokenCheck {
    /// Adds a reply: the charged tokens of its prompt, the characters of its text, and the tokens of each image by the
    /// rule of the model's family.
    pub(crate) fn add(&mut self, charged: u64, characters: usize, expected: &[u64]) {
        let images = expected.len() as f64;
        let (charged, characters) = (charged as f64, characters as f64);
        let expected = expected.iter().sum::<u64>() as f64 / images;
        if charged <= 0.0 || expected < MIN_EXPECTED || self.replies.len() >= MAX_REPLIES {
            return;
        }
        let most = (charged - characters / MAX_CHARACTERS_PER_TOKEN) / images;
        let counted = (charged - characters / USUAL.0 - USUAL.1) / images;
        self.replies.push(Counted {
            tokens: counted,
            expected,
            is_shrunk: most < MAX_SHARE * expected && counted >= MIN_COUNTED,
        });
    }

    /// The shrunk images; `None` if the images are sent as they are, if the server does not count them, or if there are
    /// too few replies.
    pub(crate) fn shrunk(&self) -> Option<ShrunkImages> {
        let of_all = |value: fn(&Counted) -> f64| sorted(&self.replies, value);
        let largest = of_all(|one| one.expected).last().copied()?;
        let large: Vec<Counted> = self.replies.iter().copied().filter(|one| one.expected >= LARGE * largest).collect();
        let shrunk = large.iter().filter(|one| one.is_shrunk).count();
        let is_enough = large.len() >= MIN_REPLIES && shrunk as f64 >= MIN_SHARE * large.len() as f64;
        if !is_enough {
            return None;
        }
        let middle = |values: Vec<f64>| values[values.len() / 2];
        let spread = |values: &[f64]| values[values.len() - 1] / values[0];
        let is_same =
            spread(&of_all(|one| one.expected)) >= OTHER_SIZE && spread(&of_all(|one| one.tokens)) <= 1.0 + SAME;
        Some(ShrunkImages {
            counted: middle(sorted(&large, |one| one.tokens)),
            expected: middle(sorted(&large, |one| one.expected)),
            replies: large.len(),
            is_same,
        })
    }
}

fn sorted(replies: &[Counted], value: impl Fn(&Counted) -> f64) -> Vec<f64> {
    let mut values: Vec<f64> = replies.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    values
}

impl ShrunkImages {
    /// A sentence about a model.
    pub(crate) fn words(&self, model: &str) -> String {
        let same = if self.is_same { ", at all sizes" } else { "" };
        format!(
            "{model}: the server counts about {:.0} tokens an image{same}, where the rule of the model's family gives {:.0} ({}): it \
             probably shrinks the images, and averages noise and small objects away. Remedy: raise the server's limit of the image size, \
             or send images that it leaves as they are (--image max-side=N).",
            self.counted,
            self.expected,
            plural(self.replies, "reply", "replies")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHARACTERS: usize = 160;

    /// Replies about images with these tokens: counted by the server, and by the rule.
    fn check(images: &[(u64, u64)]) -> Option<ShrunkImages> {
        let mut check = ImageTokenCheck::default();
        for (counted, expected) in images.iter().cycle().take(12) {
            check.add(50 + counted, CHARACTERS, &[*expected]);
        }
        check.shrunk()
    }

    #[test]
    fn far_fewer_tokens_mean_shrunk_images() {
        let one_size = check(&[(280, 1560)]).unwrap();
        assert!((one_size.counted - 280.0).abs() < 1.0 && !one_size.is_same);
        let sizes = check(&[(280, 1560), (282, 884)]).unwrap();
        assert!(sizes.words("m").starts_with("m: the server counts about 282 tokens an image, at all sizes, where"));
        // A small image may be left as it is.
        let small = check(&[(280, 1564), (280, 391)]).unwrap();
        assert!((small.expected - 1564.0).abs() < 1.0 && small.is_same);
    }

    #[test]
    fn images_sent_as_they_are_are_not_shrunk() {
        for images in [
            &[(1560, 1560)][..],
            &[(1300, 1560), (700, 884)],
            // Small images, and a server that does not count images.
            &[(6, 70)],
            &[(0, 1560)],
            &[(40, 1560)],
            &[(280, 1560), (1560, 1560)],
        ] {
            assert_eq!(check(images), None, "{images:?}");
        }
        let mut few = ImageTokenCheck::default();
        for _ in 0..4 {
            few.add(300, CHARACTERS, &[1560]);
        }
        assert_eq!(few.shrunk(), None);
    }
}
