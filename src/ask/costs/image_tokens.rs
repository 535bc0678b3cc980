//! Number of tokens that a model counts for an image: [`image_tokens`].
//!
//! It is used only for estimates before a request is sent; afterwards the server reports the charged tokens. The model families and the
//! sources of their rules are in `image_tokens.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::ask::requests::ImageDetail;

/// The built-in table.
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let text = include_str!("../image_tokens.toml");
    toml::from_str(text).unwrap_or_else(|e| unreachable!("a test reads image_tokens.toml: {e}"))
});

/// Table of model families, with its date.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Table {
    #[expect(dead_code, reason = "for readers of the table")]
    as_of: String,
    family: Vec<Family>,
}

/// Models with the same rule.
#[derive(Debug, Deserialize)]
struct Family {
    /// Prefixes of their names.
    begins: Vec<String>,
    #[serde(flatten)]
    rule: Rule,
}

/// Rule by which a family of models counts the tokens of an image; explained in `image_tokens.toml`.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(
    deny_unknown_fields,
    tag = "rule",
    rename_all = "kebab-case",
    rename_all_fields = "kebab-case"
)]
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
    },
    Merged {
        patch: f64,
        #[serde(default = "unlimited")]
        side: f64,
    },
}

/// Default of a maximum side.
fn unlimited() -> f64 {
    f64::MAX
}

/// Number of tokens that a model counts for an image of this size in pixels; `None` for an unknown family.
pub(in crate::ask) fn image_tokens(
    model: &str,
    detail: Option<ImageDetail>,
    width: u64,
    height: u64,
) -> Option<u64> {
    let name = model.rsplit('/').next().unwrap_or(model).to_lowercase();
    let family = TABLE
        .family
        .iter()
        .find(|family| family.begins.iter().any(|begin| name.starts_with(begin)))?;
    Some(family.rule.count(detail, width as f64, height as f64))
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
                return base
                    + tile * (tiles_along(scale, width) * tiles_along(scale, height)) as u64;
            }
            Self::FittedPatches {
                most,
                side,
                high_most,
                high_side,
                original_most,
                original_side,
                factor,
            } => {
                let (detail_side, detail_most) = match detail {
                    Some(ImageDetail::High) => (high_side, high_most),
                    Some(ImageDetail::Original) => (original_side, original_most),
                    _ => (None, None),
                };
                let side = detail_side.unwrap_or(side);
                let most = detail_most.unwrap_or(most);
                patches_after_fit(width, height, side, most) * factor
            }
            Self::Patches { patch, side, most } => {
                max_patches_within(width, height, patch, PatchLimits { side, most })
            }
            Self::Crops if longer <= 384.0 => 258.0,
            Self::Crops => {
                let unit = (shorter / 1.5).floor().max(1.0);
                258.0 * (width / unit).ceil() * (height / unit).ceil()
            }
            Self::Resized { patch } => patches_after_resize(width, height, patch),
            Self::Merged { patch, side } => {
                let scale = (side / longer).min(1.0);
                (width * scale / patch).round().max(1.0) * (height * scale / patch).round().max(1.0)
            }
        };
        count.ceil() as u64
    }
}

/// Tiles of 512 pixels along a scaled side.
fn tiles_along(scale: f64, side: f64) -> f64 {
    (side * scale / 512.0).ceil().max(1.0)
}

/// Number of patches that cover an image scaled by a factor. Up to a millionth of a patch per side is ignored as a rounding error.
fn count_patches(width: f64, height: f64, patch: f64, scale: f64) -> f64 {
    let [columns, rows] =
        [width, height].map(|side| ((side * scale / patch * 1e6).round() / 1e6).ceil().max(1.0));
    columns * rows
}

/// Number of 32 × 32 patches after an image is reduced to a maximum side and to at most `most` patches. The scale is chosen so that the
/// sides are whole numbers of patches (OpenAI).
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

/// Number of patches of the largest image with the same aspect ratio within both limits (Anthropic), by bisection of the scale.
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

/// Number of patches after Qwen's smart_resize.
fn patches_after_resize(width: f64, height: f64, patch: f64) -> f64 {
    const MIN: f64 = 4.0;
    const MAX: f64 = 16_384.0;
    let count = |round: fn(f64) -> f64, scale: f64| {
        let [columns, rows] = [width, height].map(|side| round(side * scale / patch).max(1.0));
        columns * rows
    };
    let unscaled = count(f64::round_ties_even, 1.0);
    let area = width * height / (patch * patch);
    if unscaled > MAX {
        count(f64::floor, (MAX / area).sqrt())
    } else if unscaled < MIN {
        count(f64::ceil, (MIN / area).sqrt())
    } else {
        unscaled
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
            ("qwen3-vl-plus", None, 10, 10, 4),
        ] {
            let counted = image_tokens(model, detail, width, height);
            assert_eq!(counted, Some(tokens), "{model} {width} × {height}");
        }
        // 1800 × 2400 pixels are reduced to at most 1536 patches: 33 × 44.
        assert_eq!(image_tokens("gpt-4.1-mini", None, 1800, 2400), Some(2353));
        assert_eq!(image_tokens("my-model", None, 640, 480), None);
    }

    #[test]
    fn no_prefix_is_hidden_by_an_earlier_one() {
        let mut earlier: Vec<&String> = Vec::new();
        for begin in TABLE.family.iter().flat_map(|family| &family.begins) {
            let hidden_by = earlier
                .iter()
                .find(|prefix| begin.starts_with(prefix.as_str()));
            assert_eq!(hidden_by, None, "{begin} is never reached");
            earlier.push(begin);
        }
        assert!(earlier.len() > 30);
    }

    #[test]
    fn counts_grow_with_the_size() {
        for family in &TABLE.family {
            let counts: Vec<u64> = (1..40)
                .map(|step| f64::from(step) * 100.0)
                .map(|side| family.rule.count(None, side, side))
                .collect();
            let decrease = counts
                .windows(2)
                .find(|pair| (pair[1] as f64) < 0.9 * pair[0] as f64);
            assert_eq!(decrease, None, "{:?}", family.begins);
        }
    }
}
