//! Spelling suggestions for unknown names: [`nearest`].

use strsim::{damerau_levenshtein, jaro_winkler};

/// Least similarity of two names, by Jaro and Winkler; chosen.
const ALIKE: f64 = 0.8;

/// The most similar of the known names, whatever the case, and the first of equally similar ones; `None` if none is similar.
pub fn nearest<'a, S: AsRef<str> + 'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a S>,
) -> Option<&'a str> {
    let name = name.to_lowercase();
    let alike = known
        .into_iter()
        .map(AsRef::as_ref)
        .map(|other| (jaro_winkler(&name, &other.to_lowercase()), other));
    let near = alike.filter(|(alike, _)| *alike > ALIKE);
    // `min_by` returns the first of equal elements, `max_by` the last.
    let nearest = near.min_by(|(a, _), (b, _)| b.total_cmp(a));
    nearest.map(|(_, other)| other)
}

/// The longest word for which one edit makes another word; longer ones take two. Chosen.
const SHORT: usize = 6;

/// Whether a word is a known one, or that with a typing error.
pub fn is_nearly(word: &str, known: &str) -> bool {
    let most = if known.len() <= SHORT { 1 } else { 2 };
    damerau_levenshtein(known, word) <= most
}

/// The most similar of the known names, as a [`question`].
pub fn suggestion<'a, S: AsRef<str> + 'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a S>,
) -> String {
    question(nearest(name, known))
}

/// Whether a name was meant, as a question at the end of a message; empty without a name.
pub fn question(meant: Option<&str>) -> String {
    meant.map_or_else(String::new, |meant| format!("; did you mean {meant}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_similar_name_is_found_and_no_other() {
        let known = [
            "lift",
            "gray-gain",
            "speed",
            "angle",
            "ruas-lol",
            "ruas-upe",
        ];
        for (name, meant) in [
            ("lfit", "lift"),
            ("Lift", "lift"),
            ("graygain", "gray-gain"),
            ("sped", "speed"),
            ("angel", "angle"),
            ("ruas", "ruas-lol"),
        ] {
            assert_eq!(nearest(name, &known), Some(meant), "{name}");
        }
        for name in ["zoom", "", "darkir"] {
            assert_eq!(nearest(name, &known), None, "{name}");
        }
        assert_eq!(suggestion("sped", &known), "; did you mean speed?");
        assert_eq!(suggestion("zoom", &known), "");
    }
}
