//! Spelling suggestions for unknown names: [`nearest`].

use strsim::{damerau_levenshtein, jaro_winkler};

/// Minimum Jaro–Winkler similarity of two names for a suggestion; chosen.
const MIN_SIMILARITY: f64 = 0.8;

/// The most similar of the known names, ignoring case; the first of equally similar ones, and `None` if none is
/// similar.
pub fn nearest<'a, S: AsRef<str> + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> Option<&'a str> {
    let name = name.to_lowercase();
    known
        .into_iter()
        .map(AsRef::as_ref)
        .map(|other| (jaro_winkler(&name, &other.to_lowercase()), other))
        .filter(|(similarity, _)| *similarity > MIN_SIMILARITY)
        // `min_by` returns the first of equal elements, `max_by` the last.
        .min_by(|(a, _), (b, _)| b.total_cmp(a))
        .map(|(_, other)| other)
}

/// Length in bytes up to which a word may have one typing error; longer words may have two. Chosen.
const SHORT_WORD: usize = 6;

/// True if a word equals a known one except for one typing error, or two in a long word.
pub fn is_nearly(word: &str, known: &str) -> bool {
    let most_errors = if known.len() <= SHORT_WORD { 1 } else { 2 };
    damerau_levenshtein(known, word) <= most_errors
}

/// [`did_you_mean`] for the most similar of the known names.
pub fn suggestion<'a, S: AsRef<str> + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> String {
    did_you_mean(nearest(name, known))
}

/// The end of a message that suggests a name: `; did you mean NAME?`. Empty without a name.
pub fn did_you_mean(meant: Option<&str>) -> String {
    meant.map_or_else(String::new, |meant| format!("; did you mean {meant}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_similar_names_are_suggested() {
        let known = ["lift", "gray-gain", "speed", "angle", "ruas-lol", "ruas-upe"];
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
