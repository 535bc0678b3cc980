//! Bundled font of the figures: [`Font`].
//!
//! Arimo 1.33 (Steve Matteson, SIL Open Font License 1.1), reduced to Latin, Greek, punctuation and a few signs. Its
//! glyphs have the same widths as Arial, Helvetica and Liberation Sans, so that an SVG looks the same with any of these
//! fonts.

use ttf_parser::{Face, GlyphId};

/// TrueType file of the font.
pub(super) const FONT_FILE: &[u8] = include_bytes!("font/Arimo-figures.ttf");

/// CSS font families for SVG. The named ones have the same glyph widths.
pub(super) const FAMILIES: &str = "Arimo, 'Liberation Sans', Arial, Helvetica, sans-serif";

/// The bundled font.
pub(super) struct Font(Face<'static>);

/// Glyph of one character of a text.
pub(super) struct FontGlyph {
    pub glyph: GlyphId,
    /// Advance width in em.
    pub advance: f32,
}

/// Metrics of the font, in thousandths of an em.
pub(super) struct Metrics {
    /// Left, bottom, right and top of the bounding box of all glyphs.
    pub bounds: [f32; 4],
    pub ascent: f32,
    /// Negative below the baseline.
    pub descent: f32,
    pub capital_height: f32,
}

impl Font {
    /// Parses the bundled font.
    pub(super) fn bundled() -> Self {
        Self(Face::parse(FONT_FILE, 0).expect("the bundled font is a font: a test reads it"))
    }

    /// True if the font has a glyph for a character.
    pub(super) fn has(&self, letter: char) -> bool {
        self.0.glyph_index(letter).is_some()
    }

    /// Glyphs of a text. A character that the font lacks gets the glyph for missing characters.
    pub(super) fn letters(&self, text: &str) -> Vec<FontGlyph> {
        let units = f32::from(self.0.units_per_em());
        text.chars()
            .map(|letter| {
                let glyph = self.0.glyph_index(letter).unwrap_or(GlyphId(0));
                let advance = self.0.glyph_hor_advance(glyph).unwrap_or(0);
                FontGlyph { glyph, advance: f32::from(advance) / units }
            })
            .collect()
    }

    /// Metrics that a PDF file needs.
    pub(super) fn metrics(&self) -> Metrics {
        let bounds = self.0.global_bounding_box();
        Metrics {
            bounds: [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(|units| self.thousandths(units)),
            ascent: self.thousandths(self.0.ascender()),
            descent: self.thousandths(self.0.descender()),
            capital_height: self.thousandths(self.0.capital_height().unwrap_or(self.0.ascender())),
        }
    }

    /// Converts a length from font units to thousandths of an em.
    fn thousandths(&self, units: i16) -> f32 {
        f32::from(units) * 1000.0 / f32::from(self.0.units_per_em())
    }

    /// Width in points of a text at a font size of `size` points.
    pub(super) fn width(&self, text: &str, size: f64) -> f64 {
        self.letters(text).into_iter().map(|letter| f64::from(letter.advance)).sum::<f64>() * size
    }

    /// Shortens a text to at most `width` points by replacing its middle with "…". A text that fits is returned
    /// unchanged.
    pub(super) fn shortened(&self, text: &str, size: f64, width: f64) -> String {
        if self.width(text, size) <= width {
            return text.to_owned();
        }
        let letters: Vec<char> = text.chars().collect();
        let affix_widths = AffixWidths::new(&letters, &self.letters(text));
        let ellipsis = self.width("…", size);
        // Names may be very long: estimate each width from the prefix sums, and build only a text that nearly fits. The
        // tolerance covers rounding errors of the sums.
        let tolerated = width * (1.0 + 1e-6) + 1e-6;
        for kept in (2..letters.len()).rev() {
            let (head, tail) = (kept.div_ceil(2), kept / 2);
            if affix_widths.without_middle(head, tail) * size + ellipsis > tolerated {
                continue;
            }
            let start: String = letters[..head].iter().collect();
            let end: String = letters[letters.len() - tail..].iter().collect();
            let short = format!("{}…{}", start.trim_end(), end.trim_start());
            if self.width(&short, size) <= width {
                return short;
            }
        }
        "…".to_owned()
    }

    /// Breaks a text at spaces into lines of at most `width` points. A word that is wider than a line is shortened.
    pub(super) fn wrapped(&self, text: &str, size: f64, width: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            let word = self.shortened(word, size, width);
            match lines.last_mut() {
                Some(line) if self.width(&format!("{line} {word}"), size) <= width => {
                    line.push(' ');
                    *line += &word;
                }
                _ => lines.push(word),
            }
        }
        lines
    }
}

/// Widths of all prefixes and suffixes of a text, in em, by number of characters. Spaces at the cut are not counted.
struct AffixWidths {
    prefixes: Vec<f64>,
    suffixes: Vec<f64>,
}

impl AffixWidths {
    fn new(characters: &[char], letters: &[FontGlyph]) -> Self {
        let letters = characters.iter().zip(letters);
        Self { prefixes: trimmed_widths(letters.clone()), suffixes: trimmed_widths(letters.rev()) }
    }

    /// Width of the first `head` and the last `tail` characters together.
    fn without_middle(&self, head: usize, tail: usize) -> f64 {
        self.prefixes[head] + self.suffixes[tail]
    }
}

/// Cumulative widths, from none of the characters to all. White space counts only if another character follows.
fn trimmed_widths<'a>(letters: impl Iterator<Item = (&'a char, &'a FontGlyph)>) -> Vec<f64> {
    let (mut sum, mut trimmed) = (0.0, 0.0);
    let mut widths = vec![0.0];
    for (character, letter) in letters {
        sum += f64::from(letter.advance);
        if !character.is_whitespace() {
            trimmed = sum;
        }
        widths.push(trimmed);
    }
    widths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_latin_greek_and_minus() {
        let font = Font::bundled();
        let letters = "AZaz09ÄéßŁñΑΩαωμ−–—…“”‘’±×≤≥°%";
        assert!(letters.chars().all(|letter| font.has(letter)));
        assert!(!font.has('模'));
        assert!(FONT_FILE.len() < 100_000);
        // Widths in Arial and Helvetica, in thousandths of an em.
        let widths = ["W", "i", "−"].map(|text| font.width(text, 1000.0).round() as u32);
        assert_eq!(widths, [944, 222, 584]);
    }

    #[test]
    fn texts_fit_their_room() {
        let font = Font::bundled();
        let long = "a-model-with-a-name-of-30-letters";
        let short = font.shortened(long, 8.0, 60.0);
        assert!(font.width(&short, 8.0) <= 60.0 && short.contains('…') && short.starts_with("a-m"));
        assert_eq!(font.shortened("short", 8.0, 60.0), "short");
        assert_eq!(font.shortened("two    words and   more", 8.0, 50.0), "two…more");
        let lines = font.wrapped("exposure drop with sensor noise, n 237", 8.0, 70.0);
        assert!(lines.len() > 1 && lines.iter().all(|line| font.width(line, 8.0) <= 70.0));
        assert_eq!(lines.join(" "), "exposure drop with sensor noise, n 237");
    }

    /// Regression: a family name of 20,000 escape characters took a report 14 seconds, and the time grew with the
    /// square of the length.
    #[test]
    fn a_very_long_name_is_shortened_at_once() {
        let font = Font::bundled();
        let long = "⟨U+001B⟩".repeat(100_000);
        let short = font.shortened(&long, 8.0, 60.0);
        assert!(font.width(&short, 8.0) <= 60.0 && short.starts_with("⟨U+") && short.ends_with('⟩'));
    }
}
