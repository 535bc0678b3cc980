//! The names of colours: [`Color`], and [`Palette`], which names every 8-bit sRGB colour by a table.
//!
//! The names are the eleven basic terms of Berlin and Kay (1969). The table has one name for each 8 × 8 × 8 block of codes,
//! so that no floating-point number decides an answer. The decision tree over CIELAB in `color_tree.rs` generates it, and a
//! test checks that. Where neighbouring names overlap (beige, teal, light greys), a colour has no name, and no
//! question about it is asked.

use serde::{Deserialize, Serialize};

use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::Digest;

/// The built-in table: one line for each pair of red and green, one letter for each blue.
const BUILT_IN: &str = include_str!("colors.txt");

/// Number of blocks along each channel.
const SIDE: usize = 32;

/// A basic colour term.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Color {
    Black,
    Grey,
    White,
    Red,
    Orange,
    Yellow,
    Green,
    Blue,
    Purple,
    Pink,
    Brown,
}

impl Color {
    /// All terms, in the order in which they are offered as choices.
    pub const ALL: [Self; 11] = [
        Self::Black,
        Self::Grey,
        Self::White,
        Self::Red,
        Self::Orange,
        Self::Yellow,
        Self::Green,
        Self::Blue,
        Self::Purple,
        Self::Pink,
        Self::Brown,
    ];

    /// The name in lower case, such as `black`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Black => "black",
            Self::Grey => "grey",
            Self::White => "white",
            Self::Red => "red",
            Self::Orange => "orange",
            Self::Yellow => "yellow",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Purple => "purple",
            Self::Pink => "pink",
            Self::Brown => "brown",
        }
    }

    /// The letter that stands for the colour in a table.
    fn letter(self) -> u8 {
        match self {
            Self::Black => b'k',
            Self::Grey => b'a',
            Self::White => b'w',
            Self::Red => b'r',
            Self::Orange => b'o',
            Self::Yellow => b'y',
            Self::Green => b'g',
            Self::Blue => b'b',
            Self::Purple => b'p',
            Self::Pink => b'i',
            Self::Brown => b'n',
        }
    }
}

/// Number of bins of a histogram of names: the eleven terms and one for colours without a name.
pub const BINS: usize = 12;
/// Bin of the colours without a name.
pub const NONE: usize = 11;

/// A table that names every 8-bit sRGB colour.
#[derive(Clone, PartialEq, Eq)]
pub struct Palette {
    /// Bin of each block; red is the slowest index.
    bins: Vec<u8>,
}

impl Palette {
    /// Returns the built-in table.
    ///
    /// # Errors
    /// Never: a test parses the same text.
    pub fn built_in() -> Result<Self> {
        Self::parse(BUILT_IN)
    }

    /// Reads a table: 1,024 lines (red, then green) of 32 letters (blue), each `k` black, `a` grey, `w` white, `r` red, `o`
    /// orange, `y` yellow, `g` green, `b` blue, `p` purple, `i` pink, `n` brown, `.` no name. Lines with `#` are ignored.
    ///
    /// # Errors
    /// [`Error::Data`] if the text has another form.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |problem: String| Error::data("colour table", problem);
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        if lines.len() != SIDE * SIDE {
            return Err(wrong(format!(
                "{} lines; {} expected",
                lines.len(),
                SIDE * SIDE
            )));
        }
        let mut bins = vec![0; SIDE * SIDE * SIDE];
        for (i, (line, row)) in lines.iter().zip(bins.chunks_exact_mut(SIDE)).enumerate() {
            if line.len() != SIDE {
                return Err(wrong(format!(
                    "row {} has {} letters; {SIDE} expected",
                    i + 1,
                    line.len()
                )));
            }
            for (letter, bin) in line.bytes().zip(row) {
                let color = Color::ALL.iter().position(|color| color.letter() == letter);
                *bin = match (letter, color) {
                    (b'.', _) => NONE as u8,
                    (_, Some(color)) => color as u8,
                    (_, None) => {
                        let letter = char::from(letter);
                        return Err(wrong(format!(
                            "row {}: {letter:?} is not a colour letter",
                            i + 1
                        )));
                    }
                };
            }
        }
        Ok(Self { bins })
    }

    /// The bin of a colour, from 0 to 11.
    #[must_use]
    pub fn bin(&self, [red, green, blue]: [u8; 3]) -> usize {
        let block = |channel: u8| usize::from(channel >> 3);
        self.bins[(block(red) * SIDE + block(green)) * SIDE + block(blue)].into()
    }

    /// The name of a colour; `None` if people do not agree on one.
    #[must_use]
    pub fn color(&self, rgb: [u8; 3]) -> Option<Color> {
        Color::ALL.get(self.bin(rgb)).copied()
    }

    /// The digest of the bins; comments of the table do not change it.
    #[must_use]
    pub fn digest(&self) -> Digest {
        Digest::from_bytes(&self.bins[..])
    }
}

impl std::fmt::Debug for Palette {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Palette({})", self.digest())
    }
}

#[cfg(test)]
mod tests {
    use super::super::color_tree;
    use super::*;

    /// The table that the tree generates.
    fn generated() -> String {
        let mut text = String::from(
            "# The name of every sRGB colour, one letter for each 8 x 8 x 8 block of codes; see colors.rs.\n",
        );
        for red in 0..SIDE {
            for green in 0..SIDE {
                for blue in 0..SIDE {
                    let middle = [red, green, blue].map(|block| (block * 8 + 4) as u8);
                    let letter = color_tree::name(middle).map_or(b'.', Color::letter);
                    text.push(letter.into());
                }
                text.push('\n');
            }
        }
        text
    }

    #[test]
    fn the_table_is_what_the_tree_generates() {
        assert!(
            generated() == BUILT_IN,
            "remake it: cargo test remake_the_table -- --ignored"
        );
    }

    #[test]
    #[ignore = "writes src/colors.txt"]
    fn remake_the_table() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/colors.txt");
        std::fs::write(path, generated()).unwrap();
    }

    #[test]
    fn plain_colours_have_their_names() {
        let palette = Palette::built_in().unwrap();
        for (rgb, name) in [
            ([200, 30, 30], "red"),
            ([150, 100, 60], "brown"),
            ([120, 170, 220], "blue"),
            ([110, 110, 50], "green"),
            ([100, 20, 30], "red"),
            ([240, 200, 205], "pink"),
            ([220, 180, 50], "yellow"),
            ([240, 130, 30], "orange"),
            ([20, 70, 30], "green"),
            ([150, 110, 200], "purple"),
            ([240, 240, 238], "white"),
            ([128, 128, 128], "grey"),
            ([20, 20, 20], "black"),
            ([60, 40, 25], "brown"),
        ] {
            let found = palette.color(rgb).map(Color::name);
            assert_eq!(found, Some(name), "{rgb:?}");
        }
        for beige_or_teal in [[225, 210, 185], [0, 128, 128]] {
            assert_eq!(palette.color(beige_or_teal), None);
        }
    }

    #[test]
    fn the_table_is_pinned() {
        // Another table gives other answers: change the version of the rules with it.
        let digest = Palette::built_in().unwrap().digest().to_string();
        assert_eq!(&digest[..16], "c8406c9facdd6ee5");
    }

    #[test]
    fn broken_tables_say_what_is_wrong() {
        let cut = BUILT_IN.lines().take(9).collect::<Vec<_>>().join("\n");
        let unknown_letter = BUILT_IN.replacen("\nk", "\nz", 1);
        let short = BUILT_IN.replacen("kkkk", "kkk", 1);
        for (text, says) in [
            (cut, "8 lines"),
            (unknown_letter, "'z' is not a colour letter"),
            (short, "31 letters"),
        ] {
            let error = Palette::parse(&text).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
