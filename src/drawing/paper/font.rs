//! The font of figures for papers: [`Font`].
//!
//! Arimo 1.33 (Steve Matteson, SIL Open Font License 1.1), reduced to Latin, Greek, punctuation and a few signs. Its letters are as wide
//! as those of Arial, Helvetica and Liberation Sans, so that an SVG has the same measures where one of them is installed.

use ttf_parser::{Face, GlyphId};

/// The file of the font.
pub(super) const FILE: &[u8] = include_bytes!("font/Arimo-figures.ttf");

/// The families that a viewer of an SVG may take: all of them have the same measures.
pub(super) const FAMILIES: &str = "Arimo, 'Liberation Sans', Arial, Helvetica, sans-serif";

/// The bundled font.
pub(super) struct Font(Face<'static>);

/// One letter of a text.
pub(super) struct Letter {
    pub glyph: GlyphId,
    /// Width for letters of height 1.
    pub advance: f32,
}

/// Measures of the font, in thousandths of the letter height.
pub(super) struct Metrics {
    /// Left, bottom, right and top of the box that holds every glyph.
    pub bounds: [f32; 4],
    pub ascent: f32,
    /// Negative below the baseline.
    pub descent: f32,
    pub capital_height: f32,
}

impl Font {
    /// The bundled font.
    pub(super) fn bundled() -> Self {
        Self(Face::parse(FILE, 0).expect("the bundled font is a font: a test reads it"))
    }

    /// Whether the font has a letter.
    pub(super) fn has(&self, letter: char) -> bool {
        self.0.glyph_index(letter).is_some()
    }

    /// The letters of a text; of one that the font lacks, the sign for a missing letter.
    pub(super) fn letters(&self, text: &str) -> Vec<Letter> {
        let units = f32::from(self.0.units_per_em());
        text.chars()
            .map(|letter| {
                let glyph = self.0.glyph_index(letter).unwrap_or(GlyphId(0));
                let advance = self.0.glyph_hor_advance(glyph).unwrap_or(0);
                Letter {
                    glyph,
                    advance: f32::from(advance) / units,
                }
            })
            .collect()
    }

    /// The measures of the font that a PDF file states.
    pub(super) fn metrics(&self) -> Metrics {
        let thousandths = |units: i16| f32::from(units) * 1000.0 / f32::from(self.0.units_per_em());
        let bounds = self.0.global_bounding_box();
        Metrics {
            bounds: [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(thousandths),
            ascent: thousandths(self.0.ascender()),
            descent: thousandths(self.0.descender()),
            capital_height: thousandths(self.0.capital_height().unwrap_or(self.0.ascender())),
        }
    }

    /// Width in points of a text in letters of `size` points.
    pub(super) fn width(&self, text: &str, size: f64) -> f64 {
        self.letters(text)
            .into_iter()
            .map(|letter| f64::from(letter.advance))
            .sum::<f64>()
            * size
    }

    /// The text, or its start and end with "…" between, so that it is no wider than `room` points.
    pub(super) fn shortened(&self, text: &str, size: f64, room: f64) -> String {
        if self.width(text, size) <= room {
            return text.to_owned();
        }
        let letters: Vec<char> = text.chars().collect();
        let lengths = Lengths::new(&letters, &self.letters(text));
        let rest = self.width("…", size);
        // A name of a stranger may be very long: a text is made of those letters alone that nearly fit. Sums differ by their rounding.
        let nearly = room * (1.0 + 1e-6) + 1e-6;
        for kept in (2..letters.len()).rev() {
            let (head, tail) = (kept.div_ceil(2), kept / 2);
            if lengths.without_middle(head, tail) * size + rest > nearly {
                continue;
            }
            let start: String = letters[..head].iter().collect();
            let end: String = letters[letters.len() - tail..].iter().collect();
            let short = format!("{}…{}", start.trim_end(), end.trim_start());
            if self.width(&short, size) <= room {
                return short;
            }
        }
        "…".to_owned()
    }

    /// The text in lines of at most `room` points, broken at spaces; a word that is wider is shortened.
    pub(super) fn wrapped(&self, text: &str, size: f64, room: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            let word = self.shortened(word, size, room);
            match lines.last_mut() {
                Some(line) if self.width(&format!("{line} {word}"), size) <= room => {
                    line.push(' ');
                    *line += &word;
                }
                _ => lines.push(word),
            }
        }
        lines
    }
}

/// The lengths of all starts and ends of a text, for letters of height 1.
struct Lengths {
    /// Of so many letters from the start, without spaces at their end.
    trimmed_starts: Vec<f64>,
    /// Of so many letters from the end, without spaces at their start.
    trimmed_ends: Vec<f64>,
}

impl Lengths {
    fn new(letters: &[char], widths: &[Letter]) -> Self {
        let (mut starts, mut trimmed_starts) = (vec![0.0], vec![0.0]);
        let (mut ends, mut trimmed_ends) = (vec![0.0], vec![0.0]);
        let all = || letters.iter().zip(widths);
        let add =
            |(letter, width): (&char, &Letter), sums: &mut Vec<f64>, trimmed: &mut Vec<f64>| {
                let sum = sums[sums.len() - 1] + f64::from(width.advance);
                let last = trimmed[trimmed.len() - 1];
                sums.push(sum);
                trimmed.push(if letter.is_whitespace() { last } else { sum });
            };
        all().for_each(|one| add(one, &mut starts, &mut trimmed_starts));
        all()
            .rev()
            .for_each(|one| add(one, &mut ends, &mut trimmed_ends));
        Self {
            trimmed_starts,
            trimmed_ends,
        }
    }

    /// Of so many letters from the start and so many from the end, without the spaces between them.
    fn without_middle(&self, head: usize, tail: usize) -> f64 {
        self.trimmed_starts[head] + self.trimmed_ends[tail]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_latin_greek_and_the_minus_sign_and_is_small() {
        let font = Font::bundled();
        let letters = "AZaz09ÄéßŁñΑΩαωμ−–—…“”‘’±×≤≥°%";
        assert!(letters.chars().all(|letter| font.has(letter)));
        assert!(!font.has('模'));
        assert!(FILE.len() < 100_000);
        // The widths that Arial and Helvetica have, in thousandths: W 944, i 222, minus 584.
        let width = |text| font.width(text, 1000.0).round() as u32;
        assert_eq!([width("W"), width("i"), width("−")], [944, 222, 584]);
    }

    #[test]
    fn texts_fit_their_room() {
        let font = Font::bundled();
        let long = "a-model-with-a-name-of-30-letters";
        let short = font.shortened(long, 8.0, 60.0);
        assert!(font.width(&short, 8.0) <= 60.0 && short.contains('…') && short.starts_with("a-m"));
        assert_eq!(font.shortened("short", 8.0, 60.0), "short");
        assert_eq!(
            font.shortened("two    words and   more", 8.0, 50.0),
            "two…more"
        );
        let lines = font.wrapped("exposure drop with sensor noise, n 237", 8.0, 70.0);
        assert!(lines.len() > 1 && lines.iter().all(|line| font.width(line, 8.0) <= 70.0));
        assert_eq!(lines.join(" "), "exposure drop with sensor noise, n 237");
    }
    /// Found by damaged files: a family of 20,000 escape signs in a set of questions took the report 14 seconds, and time grew with the
    /// square of the length.
    #[test]
    fn a_very_long_name_is_shortened_at_once() {
        let font = Font::bundled();
        let long = "⟨U+001B⟩".repeat(100_000);
        let short = font.shortened(&long, 8.0, 60.0);
        assert!(
            font.width(&short, 8.0) <= 60.0 && short.starts_with("⟨U+") && short.ends_with('⟩')
        );
    }
}
