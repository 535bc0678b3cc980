//! Number of tokens that a model counts for an image: [`image_tokens`].
//!
//! It is used only for estimates before a request is sent; afterwards the server reports the charged tokens. The model
//! families and the sources of their rules are in `image_tokens.toml`.
//!
//! Detection of servers that shrink images, by the tokens that they count: [`ImageTokenCheck`].
//!
//! A model that sees an image at its full size has a token for each of its patches. A server that counts far fewer
//! tokens has made the image smaller first: LM Studio to a longer side of 500 or 1024 pixels, Ollama to a number of
//! tokens, vLLM to its `max_pixels`. Averaging pixels removes noise and small objects.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::requests::ImageDetail;
use darkqa_base::types::text::plural;

/// The built-in table.
static TABLE: LazyLock<TokenTable> = LazyLock::new(|| {
    let text = include_str!("../image_tokens.toml");
    toml::from_str(text).unwrap_or_else(|e| unreachable!("a test reads image_tokens.toml: {e}"))
});

/// Table of model families, with its date.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct TokenTable {
    #[expect(dead_code, reason = "for readers of the table")]
    as_of: String,
    family: Vec<ModelFamily>,
}

/// Models with the same rule.
#[derive(Debug, Deserialize)]
struct ModelFamily {
    /// Prefixes of their names.
    begins: Vec<String>,
    #[serde(flatten)]
    rule: Rule,
}

/// Rule by which a family of models counts the tokens of an image; explained in `image_tokens.toml`.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, tag = "rule", rename_all = "kebab-case", rename_all_fields = "kebab-case")]
enum Rule {
    Tiles {
        base: u64,
        tile: u64,
    },
    FittedPatches {
        most: f64,
        #[serde(default = "unlimited")]
        side: f64,
        high_most: Option<f64>,
        high_side: Option<f64>,
        original_most: Option<f64>,
        original_side: Option<f64>,
        factor: f64,
    },
    Patches {
        patch: f64,
        side: f64,
        most: f64,
    },
    Crops,
    Fixed {
        tokens: u64,
    },
    Resized {
        patch: f64,
        least: f64,
        most: f64,
    },
    Rows {
        patch: f64,
        side: f64,
    },
    Padded {
        patch: f64,
        side: f64,
        most: f64,
    },
    Filled {
        most: f64,
    },
    Grid {
        tile: f64,
        tokens: f64,
        most: u32,
    },
}

/// Default of a maximum side.
fn unlimited() -> f64 {
    f64::MAX
}

/// Number of tokens that a model counts for an image of this size in pixels; `None` for an unknown family.
pub(crate) fn image_tokens(model: &str, detail: Option<ImageDetail>, width: u64, height: u64) -> Option<u64> {
    let rule = family(model)?.rule;
    Some(rule.count(detail, width as f64, height as f64))
}

/// Number of tokens of an image for a family that has more of them for larger images, so that fewer tokens mean a
/// smaller image; `None` for other families: those whose number hardly depends on the size, and Gemini, whose servers
/// choose the number of crops.
pub fn scaling_image_tokens(model: &str, detail: Option<ImageDetail>, width: u64, height: u64) -> Option<u64> {
    let rule = family(model)?.rule;
    let is_scaling = !matches!(rule, Rule::Fixed { .. } | Rule::Crops | Rule::Filled { .. } | Rule::Grid { .. });
    is_scaling.then(|| rule.count(detail, width as f64, height as f64))
}

/// The family of a model, by the beginning of its name.
fn family(model: &str) -> Option<&'static ModelFamily> {
    let name = model.rsplit('/').next().unwrap_or(model).to_lowercase();
    TABLE.family.iter().find(|family| family.begins.iter().any(|begin| name.starts_with(begin)))
}

impl Rule {
    /// Number of tokens of an image of this size in pixels.
    fn count(self, detail: Option<ImageDetail>, width: f64, height: f64) -> u64 {
        let (longer, shorter) = (width.max(height), width.min(height));
        let count = match self {
            Self::Fixed { tokens } => return tokens,
            Self::Tiles { base, .. } if detail == Some(ImageDetail::Low) => return base,
            Self::Tiles { base, tile } => {
                let scale = (2048.0 / longer).min(1.0);
                let scale = scale * (768.0 / (shorter * scale)).min(1.0);
                return base + tile * (tiles_along(scale, width) * tiles_along(scale, height)) as u64;
            }
            Self::FittedPatches { most, side, high_most, high_side, original_most, original_side, factor } => {
                let (detail_side, detail_most) = match detail {
                    Some(ImageDetail::High) => (high_side, high_most),
                    Some(ImageDetail::Original) => (original_side, original_most),
                    _ => (None, None),
                };
                let side = detail_side.unwrap_or(side);
                let most = detail_most.unwrap_or(most);
                patches_after_fit(width, height, side, most) * factor
            }
            Self::Patches { patch, side, most } => max_patches_within(width, height, patch, PatchLimits { side, most }),
            Self::Crops if longer <= 384.0 => 258.0,
            Self::Crops => {
                let unit = (shorter / 1.5).floor().max(1.0);
                258.0 * (width / unit).ceil() * (height / unit).ceil()
            }
            Self::Resized { patch, least, most } => patches_after_resize(width, height, patch, (least, most)),
            Self::Rows { patch, side } => {
                let ratio = (longer / side).max(1.0);
                let [columns, rows] =
                    [width, height].map(|length| ((length / ratio).round_ties_even().max(1.0) / patch).ceil());
                (columns + 1.0) * rows
            }
            Self::Padded { patch, side, most } => {
                // The limit applies to patches before 2 × 2 of them are merged.
                let [columns, rows] = [width, height].map(|length| (2.0 * length / patch).floor().max(1.0));
                let scale = (4.0 * most / (columns * rows)).sqrt().min(side / longer);
                let along = |length: f64| ((length * scale.min(1.0)).floor().max(1.0) / patch).ceil();
                along(width) * along(height)
            }
            Self::Filled { most } => {
                let scale = (most / (width * height)).sqrt();
                let [columns, rows] = [width, height].map(|length| (length * scale).floor());
                match (columns, rows) {
                    (0.0, _) => (height / width).floor().min(most),
                    (_, 0.0) => (width / height).floor().min(most),
                    _ => columns * rows,
                }
            }
            Self::Grid { tile, tokens, most } => {
                let tiles = tiles_of_grid(width, height, tile, most);
                // Several tiles are preceded by the whole image; a token marks the beginning and one the end.
                let thumbnail = if tiles > 1.0 { 1.0 } else { 0.0 };
                2.0 + tokens * (tiles + thumbnail)
            }
        };
        count.ceil() as u64
    }
}

/// Tiles of 512 pixels along a scaled side.
fn tiles_along(scale: f64, side: f64) -> f64 {
    (side * scale / 512.0).ceil().max(1.0)
}

/// Number of patches that cover an image scaled by a factor. Up to a millionth of a patch per side is ignored as a
/// rounding error.
fn count_patches(width: f64, height: f64, patch: f64, scale: f64) -> f64 {
    let [columns, rows] = [width, height].map(|side| ((side * scale / patch * 1e6).round() / 1e6).ceil().max(1.0));
    columns * rows
}

/// Number of 32 × 32 patches after an image is reduced to a maximum side and to at most `most` patches. The scale is
/// chosen so that the sides are whole numbers of patches (OpenAI).
fn patches_after_fit(width: f64, height: f64, side: f64, most: f64) -> f64 {
    let scale = (side / width.max(height)).min(1.0);
    let count = count_patches(width, height, 32.0, scale);
    if count <= most {
        return count;
    }
    let scale = (32.0 * 32.0 * most / (width * height)).sqrt();
    let [whole_width, whole_height] =
        [width, height].map(|side| (side * scale / 32.0).floor().max(1.0) / (side * scale / 32.0));
    count_patches(width, height, 32.0, scale * whole_width.min(whole_height)).min(most)
}

/// Limits of an image: maximum side in pixels, and maximum number of patches.
#[derive(Clone, Copy)]
struct PatchLimits {
    side: f64,
    most: f64,
}

/// Number of patches of the largest image with the same aspect ratio within both limits (Anthropic), by bisection of
/// the scale.
fn max_patches_within(width: f64, height: f64, patch: f64, limits: PatchLimits) -> f64 {
    let count_at = |scale: f64| count_patches(width, height, patch, scale);
    let max_scale = (limits.side / width.max(height)).min(1.0);
    if count_at(max_scale) <= limits.most {
        return count_at(max_scale);
    }
    let (mut low, mut high) = (0.0, max_scale);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if count_at(middle) <= limits.most {
            low = middle;
        } else {
            high = middle;
        }
    }
    count_at(low)
}

/// Number of patches after Qwen's smart_resize, between a least and a most number.
fn patches_after_resize(width: f64, height: f64, patch: f64, (least, most): (f64, f64)) -> f64 {
    let count = |round: fn(f64) -> f64, scale: f64| {
        let [columns, rows] = [width, height].map(|side| round(side * scale / patch).max(1.0));
        columns * rows
    };
    let unscaled = count(f64::round_ties_even, 1.0);
    let area = width * height / (patch * patch);
    if unscaled > most {
        count(f64::floor, (most / area).sqrt())
    } else if unscaled < least {
        count(f64::ceil, (least / area).sqrt())
    } else {
        unscaled
    }
}

/// Number of tiles of the grid with the aspect ratio closest to that of an image. Among equally close ones the largest
/// that the image fills by half.
fn tiles_of_grid(width: f64, height: f64, tile: f64, most: u32) -> f64 {
    let mut grids: Vec<(u32, u32)> =
        (1..=most).flat_map(|columns| (1..=most / columns).map(move |rows| (columns, rows))).collect();
    grids.sort_by_key(|(columns, rows)| columns * rows);
    let (mut closest, mut tiles) = (f64::INFINITY, 1.0);
    for (columns, rows) in grids {
        let difference = (width / height - f64::from(columns) / f64::from(rows)).abs();
        let count = f64::from(columns * rows);
        let is_filled = width * height > 0.5 * tile * tile * count;
        if difference < closest || (difference <= closest && is_filled) {
            (closest, tiles) = (difference, count);
        }
    }
    tiles
}

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
pub struct ImageTokenCheck {
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
pub struct ShrunkImages {
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
    pub fn add(&mut self, charged: u64, characters: usize, expected: &[u64]) {
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
    pub fn shrunk(&self) -> Option<ShrunkImages> {
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
    pub fn words(&self, model: &str) -> String {
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

    #[test]
    fn counts_match_published_ones() {
        let high = Some(ImageDetail::High);
        for (model, detail, width, height, tokens) in [
            // platform.openai.com/docs/guides/images-vision
            ("gpt-4o", high, 1024, 1024, 765),
            ("gpt-4o", high, 2048, 4096, 1105),
            ("gpt-4o", Some(ImageDetail::Low), 4096, 8192, 85),
            ("o4-mini", None, 1024, 1024, 1762),
            ("gpt-4.1-mini", None, 1024, 1024, 1659),
            // community.openai.com/t/1262691, without the text: 128 × 64
            ("openai/gpt-4.1-2025-04-14", high, 128, 64, 255),
            ("gpt-4o-mini", high, 128, 64, 8500),
            ("gpt-5.4", high, 2560, 1440, 2765),
            ("gpt-5.4", Some(ImageDetail::Original), 2560, 1440, 4320),
            ("gpt-5.5", high, 2560, 1440, 2765),
            ("gpt-5.5", None, 2560, 1440, 4320),
            // ai.google.dev/gemini-api/docs/tokens
            ("gemini-2.5-flash", None, 384, 384, 258),
            ("gemini-2.5-flash", None, 960, 540, 1548),
            ("gemini-3-flash", None, 2560, 1440, 1120),
            // platform.claude.com/docs, vision: the two documented sizes, and one at the limit
            ("claude-opus-4-7", None, 1000, 1000, 1296),
            ("claude-opus-5-5", None, 1920, 1080, 2691),
            ("anthropic/claude-sonnet-5", None, 2560, 1440, 4784),
            // counts reported by users, including the text: 1558 to 1561
            ("claude-sonnet-4-5", None, 2560, 1440, 1560),
            ("Qwen/Qwen2.5-VL-7B-Instruct", None, 1288, 728, 1196),
            ("Qwen/Qwen2.5-VL-7B-Instruct", None, 2560, 1440, 4641),
            ("Qwen/Qwen3-VL-8B-Instruct", None, 2560, 1440, 3600),
            // 22.5 rows: half to even is 22, not 23.
            ("qwen3-vl-plus", None, 1280, 720, 880),
            ("qwen3-vl-plus", None, 10, 10, 64),
        ] {
            let counted = image_tokens(model, detail, width, height);
            assert_eq!(counted, Some(tokens), "{model} {width} × {height}");
        }
        // 1800 × 2400 pixels are reduced to at most 1536 patches: 33 × 44.
        assert_eq!(image_tokens("gpt-4.1-mini", None, 1800, 2400), Some(2353));
        assert_eq!(image_tokens("my-model", None, 640, 480), None);
    }

    /// Counts by running the image processors of transformers 5.24.0 and mistral-common 1.13.1.
    #[test]
    fn counts_match_the_published_image_processors() {
        let sizes = [(96, 64), (10, 10), (640, 480), (1280, 720), (2560, 1440), (500, 333), (4000, 3000), (30, 1000)];
        for (model, counts) in [
            ("qwen2.5-vl-7b", [6, 4, 391, 1196, 4641, 216, 15301, 36]),
            ("qwen3-vl-8b", [70, 64, 300, 880, 3600, 160, 11750, 94]),
            ("qwen3.8-flash", [70, 64, 300, 880, 3600, 160, 11750, 94]),
            ("glm-4.5v", [12, 9, 391, 1196, 4641, 216, 6030, 36]),
            ("kimi-k2.5", [12, 1, 414, 1196, 4214, 216, 4200, 72]),
            ("gemma-4-31b-it", [260, 256, 266, 264, 264, 260, 266, 192]),
            ("internvl3-8b", [1794, 258, 3330, 2306, 2306, 1794, 3330, 3330]),
            ("pixtral-12b", [28, 2, 1230, 2340, 2340, 693, 3120, 189]),
            ("mistral-small-2603", [15, 2, 432, 1222, 1736, 228, 2352, 108]),
        ] {
            let found = sizes.map(|(width, height)| image_tokens(model, None, width, height).unwrap());
            assert_eq!(found, counts, "{model}");
        }
    }

    #[test]
    fn no_prefix_is_hidden_by_an_earlier_one() {
        let mut earlier: Vec<&String> = Vec::new();
        for begin in TABLE.family.iter().flat_map(|family| &family.begins) {
            let hidden_by = earlier.iter().find(|prefix| begin.starts_with(prefix.as_str()));
            assert_eq!(hidden_by, None, "{begin} is never reached");
            earlier.push(begin);
        }
        assert!(earlier.len() > 30);
    }

    #[test]
    fn counts_grow_with_the_size() {
        for family in &TABLE.family {
            let counts: Vec<u64> =
                (1..40).map(|step| f64::from(step) * 100.0).map(|side| family.rule.count(None, side, side)).collect();
            let decrease = counts.windows(2).find(|pair| (pair[1] as f64) < 0.9 * pair[0] as f64);
            assert_eq!(decrease, None, "{:?}", family.begins);
        }
    }

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
