//! Counts with their nouns, and amounts with their units: [`counted`], [`plural`], [`money`], [`hours`], [`bytes`].

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

/// Formats an amount in dollars with two decimals, or four below one dollar.
#[must_use]
pub fn money(dollars: f64) -> String {
    if dollars > 0.0 && dollars < 0.995 { format!("${dollars:.4}") } else { format!("${dollars:.2}") }
}

/// Formats a time, as in `2.0 h`, `6 min` or `40 s`.
#[must_use]
pub fn hours(seconds: f64) -> String {
    match seconds {
        s if s >= 3600.0 => format!("{:.1} h", s / 3600.0),
        s if s >= 60.0 => format!("{:.0} min", s / 60.0),
        s => format!("{s:.0} s"),
    }
}

/// Formats a number of bytes in MB or GB.
#[must_use]
pub fn bytes(bytes: f64) -> String {
    match bytes {
        b if b >= 1e9 => format!("{:.1} GB", b / 1e9),
        b => format!("{:.1} MB", b / 1e6),
    }
}
