//! The number of tokens that a model counts for an image: [`image_tokens`].
//!
//! It is used only for estimates before anything is sent; the server states what a reply was charged.

use super::parameters::ImageDetail;

/// The rule by which a family of models counts the tokens of an image.
#[derive(Debug, Clone, Copy)]
enum Rule {
    /// OpenAI's tiles: the image is scaled to fit 2048 × 2048, then to a shorter side of 768. There is a base, and a number
    /// for each tile of 512 × 512; low detail has only the base (platform.openai.com/docs/guides/images-vision, "Calculating
    /// costs").
    Tiles { base: u64, tile: u64 },
    /// OpenAI's patches of 32 × 32 times a factor. The image is first reduced to at most `most` patches, or `high` in high
    /// detail (same page; users measured the factors of the gpt-5 line, community.openai.com/t/1377015).
    Patches { most: f64, high: f64, factor: f64 },
    /// Anthropic's rule: width × height / 750, at most `most`; the longer side is first scaled down to `side`
    /// (docs.anthropic.com/en/docs/build-with-claude/vision).
    Area { side: f64, most: f64 },
    /// Gemini 2's rule: 258 if both sides are at most 384, otherwise 258 for each square tile, whose side is two thirds of
    /// the image's shorter side (ai.google.dev/gemini-api/docs/tokens).
    Crops,
    /// The same number for all images.
    Fixed(u64),
    /// Merged patches with sides of `patch` pixels; the longer side of the image is first scaled down to `side`.
    Merged { patch: f64, side: f64 },
}

use Rule::{Area, Crops, Fixed, Merged, Patches, Tiles};

const fn tiles(base: u64, tile: u64) -> Rule {
    Tiles { base, tile }
}

const fn patches(most: f64, high: f64, factor: f64) -> Rule {
    Patches { most, high, factor }
}

const fn area(side: f64, most: f64) -> Rule {
    Area { side, most }
}

const fn merged(patch: f64, side: f64) -> Rule {
    Merged { patch, side }
}

/// Families by the beginning of a model's name; the first match applies.
const FAMILIES: [(&str, Rule); 38] = [
    ("gpt-4o-mini", tiles(2833, 5667)),
    ("gpt-4.1-mini", patches(1536.0, 1536.0, 1.62)),
    ("gpt-4.1-nano", patches(1536.0, 1536.0, 2.46)),
    ("o4-mini", patches(1536.0, 1536.0, 1.72)),
    ("gpt-5-mini", patches(1536.0, 1536.0, 1.2)),
    ("gpt-5-nano", patches(1536.0, 1536.0, 1.5)),
    ("gpt-5.4-mini", patches(1536.0, 1536.0, 1.2)),
    ("gpt-5.4-nano", patches(1536.0, 1536.0, 1.2)),
    ("gpt-5.2", patches(1536.0, 1536.0, 1.2)),
    ("gpt-5.3", patches(1536.0, 1536.0, 1.2)),
    ("gpt-5.4", patches(2500.0, 2500.0, 1.2)),
    ("gpt-5.5", patches(10_000.0, 2500.0, 1.2)),
    ("gpt-5.6", patches(10_000.0, 2500.0, 1.2)),
    ("gpt-6", patches(f64::MAX, 2500.0, 1.2)),
    ("gpt-5", tiles(70, 140)),
    ("gpt-4", tiles(85, 170)),
    ("o1", tiles(75, 150)),
    ("o3", tiles(75, 150)),
    ("claude-sonnet-5", area(2000.0, 4000.0)),
    ("claude-opus-5", area(2000.0, 4000.0)),
    ("claude-haiku-5", area(2000.0, 4000.0)),
    ("claude", area(1568.0, 1600.0)),
    ("gemini-3", Fixed(1100)),
    ("gemini-4", Fixed(1100)),
    ("gemini", Crops),
    ("gemma-3", Fixed(256)),
    ("llava-1.5", Fixed(576)),
    ("llava-v1.5", Fixed(576)),
    ("qwen2-vl", merged(28.0, f64::MAX)),
    ("qwen2.5-vl", merged(28.0, f64::MAX)),
    ("qwen3-vl", merged(32.0, f64::MAX)),
    ("qwen3.", merged(32.0, f64::MAX)),
    ("pixtral", merged(16.0, 1024.0)),
    ("mistral-small", merged(28.0, 1540.0)),
    ("mistral-medium", merged(28.0, 1540.0)),
    ("mistral-large", merged(28.0, 1540.0)),
    ("ministral", merged(28.0, 1540.0)),
    ("kimi", merged(28.0, f64::MAX)),
];

/// The number of tokens that a model counts for an image of this size in pixels; `None` if its family is unknown.
pub(super) fn image_tokens(
    model: &str,
    detail: Option<ImageDetail>,
    width: u64,
    height: u64,
) -> Option<u64> {
    let name = model.rsplit('/').next().unwrap_or(model).to_lowercase();
    let (_, rule) = FAMILIES
        .iter()
        .find(|(family, _)| name.starts_with(family))?;
    Some(rule.count(detail, width as f64, height as f64))
}

impl Rule {
    fn count(self, detail: Option<ImageDetail>, width: f64, height: f64) -> u64 {
        let (longer, shorter) = (width.max(height), width.min(height));
        let count = match self {
            Fixed(tokens) => return tokens,
            Tiles { base, .. } if detail == Some(ImageDetail::Low) => return base,
            Tiles { base, tile } => {
                let scale = (2048.0 / longer).min(1.0);
                let scale = scale * (768.0 / (shorter * scale)).min(1.0);
                let tiles = |side: f64| (side * scale / 512.0).ceil().max(1.0);
                return base + tile * (tiles(width) * tiles(height)) as u64;
            }
            Patches { most, high, factor } => {
                let most = if detail == Some(ImageDetail::High) {
                    high
                } else {
                    most
                };
                fitted_patches(width, height, most) * factor
            }
            Area { side, most } => {
                let scale = (side / longer).min(1.0);
                (width * height * scale * scale / 750.0).min(most)
            }
            Crops if longer <= 384.0 => 258.0,
            Crops => {
                let unit = (shorter / 1.5).floor().max(1.0);
                258.0 * (width / unit).ceil() * (height / unit).ceil()
            }
            Merged { patch, side } => {
                let scale = (side / longer).min(1.0);
                let patches = |length: f64| (length * scale / patch).round().max(1.0);
                patches(width) * patches(height)
            }
        };
        count.ceil() as u64
    }
}

/// The number of patches of 32 × 32 that cover an image after it is reduced to at most `most` patches. The scale makes the
/// sides whole numbers of patches (OpenAI, same page).
fn fitted_patches(width: f64, height: f64, most: f64) -> f64 {
    let cover = |scale: f64| {
        let patches = |side: f64| (side * scale / 32.0).ceil().max(1.0);
        patches(width) * patches(height)
    };
    if cover(1.0) <= most {
        return cover(1.0);
    }
    let scale = (32.0 * 32.0 * most / (width * height)).sqrt();
    let whole = |side: f64| (side * scale / 32.0).floor().max(1.0) / (side * scale / 32.0);
    cover(scale * whole(width).min(whole(height)) * (1.0 - 1e-9)).min(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_match_the_published_ones() {
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
            // ai.google.dev/gemini-api/docs/tokens
            ("gemini-2.5-flash", None, 384, 384, 258),
            ("gemini-2.5-flash", None, 960, 540, 1548),
            // docs.anthropic.com: 1.15 megapixels are about 1600 tokens
            ("claude-sonnet-4-5", None, 1000, 1000, 1334),
            ("claude-sonnet-4-5", None, 2560, 1440, 1600),
            ("Qwen/Qwen2.5-VL-7B-Instruct", None, 1288, 728, 1196),
        ] {
            let counted = image_tokens(model, detail, width, height);
            assert_eq!(counted, Some(tokens), "{model} {width} × {height}");
        }
        // 1800 × 2400 is more than 1536 patches: 33 × 44 of them.
        assert_eq!(image_tokens("gpt-4.1-mini", None, 1800, 2400), Some(2353));
        assert_eq!(image_tokens("my-model", None, 640, 480), None);
    }
}
