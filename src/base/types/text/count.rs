//! Counts with their nouns: [`counted`], [`plural`].

/// A count with its noun; the plural adds an s: `1 pair`, `2 pairs`.
#[must_use]
pub fn counted(number: usize, noun: &str) -> String {
    plural(number, noun, &format!("{noun}s"))
}

/// A count with its noun, given in singular and plural: `1 reply`, `2 replies`.
#[must_use]
pub fn plural(number: usize, one: &str, several: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { several })
}
