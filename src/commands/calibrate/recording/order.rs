//! Natural sort order of names with numbers: [`by_numbers`].

use std::cmp::Ordering;

/// Compares names in natural order: `2.tif` comes before `10.tif`. Runs of digits are compared by value, other
/// characters as text. Names that differ only in leading zeros are compared as text.
pub(super) fn by_numbers(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    while !left.is_empty() && !right.is_empty() {
        let (first, second);
        (first, left) = split(left);
        (second, right) = split(right);
        let order = match (value(first), value(second)) {
            (Some(first), Some(second)) => (first.len(), first).cmp(&(second.len(), second)),
            _ => first.cmp(second),
        };
        if order.is_ne() {
            return order;
        }
    }
    (left.len(), a).cmp(&(right.len(), b))
}

/// Splits a name after its first run of digits or of other characters.
fn split(name: &str) -> (&str, &str) {
    let begins_with_digit = name.starts_with(|c: char| c.is_ascii_digit());
    let end = name.find(|c: char| c.is_ascii_digit() != begins_with_digit);
    name.split_at(end.unwrap_or(name.len()))
}

/// Digits of a run without leading zeros; `None` for other characters. Their number and then their text give the order
/// of values.
fn value(run: &str) -> Option<&str> {
    let is_number = run.starts_with(|c: char| c.is_ascii_digit());
    is_number.then(|| run.trim_start_matches('0'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_compared_by_value() {
        let sorted = [
            "1.tif",
            "2.tif",
            "03.tif",
            "10.tif",
            "12.tif",
            "a",
            "a1",
            "a1b",
            "a1b2",
            "a1b10",
            "a007",
            "a7",
            "a8",
            "b",
            // Longer than any number of a type.
            "b99999999999999999999999999999999999998",
            "b99999999999999999999999999999999999999",
            "é2",
            "é10",
        ];
        let mut mixed = sorted;
        mixed.reverse();
        mixed.sort_by(|a, b| by_numbers(a, b));
        assert_eq!(mixed, sorted);
        // The control: the order of texts is another one.
        mixed.sort_unstable();
        assert_ne!(mixed, sorted);
    }
}
