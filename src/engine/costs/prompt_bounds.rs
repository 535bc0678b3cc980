//! Upper bounds of the tokens of prompts: [`PromptBounds`].
//!
//! Before the first reply, a bound is computed from the length of the text and the rule of the model's family for
//! images. Afterwards it is computed from the charged tokens of an earlier prompt with images of the same sizes, plus
//! the bytes of the differing text: no tokenizer makes more tokens than bytes.

use std::collections::VecDeque;

use crate::engine::images::trials::Prompt;
use crate::types::ImageFacts;

/// Tokens that a chat template adds to a message; chosen: more than those of known models.
const TEMPLATE_TOKENS: u64 = 64;

/// Pixels per token of an image, if the model's rule is not known: patches of 14 × 14, the smallest in use.
const PIXELS_PER_TOKEN: u64 = 14 * 14;

/// Minimum number of tokens of an image, if the model's rule is not known: five tiles of 576 tokens, as in LLaVA-NeXT.
const MIN_IMAGE_TOKENS: u64 = 5 * 576;

/// Number of tokens by which a text may exceed the sum of its parts, because of their joins; chosen.
const JOINS: u64 = 4;

/// Number of earlier prompts that are kept for comparison; chosen.
const MAX_REFERENCES: usize = 16;

/// Number of later prompts that must agree with an earlier one before it replaces the bound by length. Chosen: the
/// first reply of a server may come from another replica, or from a cache.
const MIN_AGREEING: usize = 2;

/// Ratio of a bound to the charged tokens up to which the bound is close, so that the prompt need not be kept for
/// comparison; chosen.
const MAX_CLOSE_RATIO: f64 = 1.05;

/// Facts that determine the tokens of a prompt.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PromptFacts<'a> {
    pub(crate) prompt: &'a Prompt,
    /// Width and height of each image, in pixels.
    pub(crate) sizes: &'a [(usize, usize)],
    /// Bytes of the system message.
    pub(crate) system_bytes: usize,
    /// Tokens of all images by the rule of the model's family; `None` if it is not known.
    pub(crate) image_tokens: Option<f64>,
}

/// The width and the height of images.
pub(crate) fn sizes<'a>(images: impl Iterator<Item = &'a ImageFacts>) -> Vec<(usize, usize)> {
    images.map(|image| (image.width, image.height)).collect()
}

/// An earlier prompt with the tokens that it was charged.
#[derive(Debug)]
struct Reference {
    prompt: Prompt,
    sizes: Vec<(usize, usize)>,
    charged: u64,
    /// Number of later prompts that were charged no more than the bound from this one.
    agreeing: usize,
}

impl Reference {
    /// Upper bound of the tokens of another prompt with images of the same sizes.
    fn most_tokens(&self, facts: PromptFacts<'_>) -> f64 {
        (self.charged + differing_bytes(&self.prompt, facts.prompt) as u64 + JOINS) as f64
    }
}

/// Upper bounds of the tokens of a model's prompts.
#[derive(Debug)]
pub(crate) struct PromptBounds {
    references: VecDeque<Reference>,
    /// Largest ratio of charged tokens to the bound by length; at least 1.
    excess_by_length: f64,
    /// Largest ratio of charged tokens to the bound by comparison; at least 1.
    excess_by_comparison: f64,
}

impl PromptBounds {
    pub(crate) fn new() -> Self {
        Self { references: VecDeque::new(), excess_by_length: 1.0, excess_by_comparison: 1.0 }
    }

    /// Upper bound of the tokens of a prompt.
    pub(crate) fn bound(&self, facts: PromptFacts<'_>) -> u64 {
        let by_length = by_length(facts) * self.excess_by_length;
        let by_comparison = self.by_comparison(facts);
        let by_comparison = by_comparison.map(|tokens| tokens * self.excess_by_comparison);
        by_comparison.map_or(by_length, |tokens| tokens.min(by_length)).ceil() as u64
    }

    /// Corrects the bounds of later prompts by the charged tokens of a prompt.
    pub(crate) fn observe(&mut self, facts: PromptFacts<'_>, charged: u64) {
        if charged == 0 {
            return;
        }
        let tokens = charged as f64;
        self.excess_by_length = self.excess_by_length.max(tokens / by_length(facts));
        let by_comparison = self.by_comparison(facts);
        let mut is_close = false;
        for one in self.references.iter_mut().filter(|one| one.sizes == facts.sizes) {
            let most = one.most_tokens(facts);
            one.agreeing += usize::from(tokens <= most);
            is_close |= (tokens..=MAX_CLOSE_RATIO * tokens).contains(&most);
        }
        if let Some(expected) = by_comparison {
            self.excess_by_comparison = self.excess_by_comparison.max(tokens / expected);
        }
        if !is_close {
            if self.references.len() == MAX_REFERENCES {
                self.references.pop_front();
            }
            self.references.push_back(Reference {
                prompt: facts.prompt.clone(),
                sizes: facts.sizes.to_vec(),
                charged,
                agreeing: 0,
            });
        }
    }

    /// Lowest upper bound by comparison with earlier prompts. Only prompts with images of the same sizes count, if
    /// enough later ones agree with them; `None` without any.
    fn by_comparison(&self, facts: PromptFacts<'_>) -> Option<f64> {
        self.references
            .iter()
            .filter(|one| one.sizes == facts.sizes && one.agreeing >= MIN_AGREEING)
            .map(|one| one.most_tokens(facts))
            .min_by(f64::total_cmp)
    }
}

/// Upper bound of the tokens of a prompt by its bytes and the sizes of its images.
fn by_length(facts: PromptFacts<'_>) -> f64 {
    let text: usize = facts.prompt.parts().iter().map(|part| part.len()).sum();
    let text = (text + facts.system_bytes) as u64 + TEMPLATE_TOKENS;
    let images = facts.image_tokens.unwrap_or_else(|| {
        facts
            .sizes
            .iter()
            .map(|(width, height)| (width * height) as u64)
            .map(|area| area.div_ceil(PIXELS_PER_TOKEN).max(MIN_IMAGE_TOKENS))
            .sum::<u64>() as f64
    });
    text as f64 + images
}

/// Number of bytes of a prompt's text without the beginnings and ends that its parts share with those of another
/// prompt.
fn differing_bytes(other: &Prompt, prompt: &Prompt) -> usize {
    other.parts().into_iter().zip(prompt.parts()).map(|(other, text)| unshared(other.as_bytes(), text.as_bytes())).sum()
}

/// Number of bytes of a text without the beginning and end that it shares with another one.
fn unshared(other: &[u8], text: &[u8]) -> usize {
    let start = other.iter().zip(text).take_while(|(a, b)| a == b).count();
    let (other, text) = (&other[start..], &text[start..]);
    let ends = other.iter().rev().zip(text.iter().rev());
    text.len() - ends.take_while(|(a, b)| a == b).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: &[(usize, usize)] = &[(640, 480)];

    fn facts(prompt: &Prompt, image_tokens: Option<f64>) -> PromptFacts<'_> {
        PromptFacts { prompt, sizes: SIZES, system_bytes: 0, image_tokens }
    }

    fn prompt(number: usize) -> Prompt {
        Prompt::from_text(format!("Which room is shown in image {number} of the set?").into())
    }

    #[test]
    fn a_first_prompt_is_bounded_by_its_length() {
        let bounds = PromptBounds::new();
        let text = prompt(7);
        let bytes = text.parts()[0].len() as u64;
        assert_eq!(bounds.bound(facts(&text, Some(80.0))), bytes + 64 + 80);
        assert_eq!(bounds.bound(facts(&text, None)), bytes + 64 + 2880);
    }

    #[test]
    fn later_prompts_are_bounded_by_earlier_ones() {
        let (mut bounds, seven) = (PromptBounds::new(), prompt(7));
        bounds.observe(facts(&seven, None), 300);
        // A single reply may be from a cache.
        assert!(bounds.bound(facts(&prompt(123), None)) > 2000);
        bounds.observe(facts(&prompt(8), None), 301);
        bounds.observe(facts(&prompt(9), None), 300);
        assert_eq!(bounds.bound(facts(&prompt(123), None)), 300 + 3 + 4);
        let other_size = PromptFacts { sizes: &[(320, 240)], ..facts(&seven, None) };
        assert!(bounds.bound(other_size) > 2000, "another image may have more tokens");
    }

    #[test]
    fn a_prompt_beyond_its_bound_raises_all_later_ones() {
        let (mut bounds, seven) = (PromptBounds::new(), prompt(7));
        bounds.observe(facts(&seven, Some(80.0)), 2000);
        assert!(bounds.bound(facts(&prompt(8), Some(80.0))) >= 2000);
        bounds.observe(facts(&prompt(8), Some(80.0)), 4000);
        assert!(bounds.bound(facts(&prompt(9), Some(80.0))) >= 3990);
        let other_size = PromptFacts { sizes: &[(320, 240)], ..facts(&seven, Some(80.0)) };
        assert!(bounds.bound(other_size) >= 4000);
    }

    #[test]
    fn shared_beginnings_and_ends_are_not_counted() {
        assert_eq!(unshared(b"is #17 here", b"is #2 here"), 1);
        assert_eq!(unshared(b"aaa", b"aaaa"), 1);
        assert_eq!(unshared(b"aaaa", b"aa"), 0);
        assert_eq!(unshared(b"", b"abc"), 3);
    }
}
