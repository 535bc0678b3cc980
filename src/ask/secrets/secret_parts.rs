//! Detection of parts of keys, and of keys in base64, in text: [`SecretParts`].

use std::collections::HashSet;
use std::ops::Range;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD_NO_PAD;

/// Number of consecutive letters and digits that identify a part of a key; chosen. A random text of 64 kB contains such
/// a part with a probability of 1e-6.
const PART: usize = 8;

/// Minimum length of a part without digits; chosen. Keys of gateways contain words that also occur in replies.
const MIN_WORD_PART: usize = 10;

/// Replacement of a key.
pub(super) const MASK: &str = "[secret]";

/// All sequences of [`PART`] consecutive letters and digits of keys, in plain text and in base64; in lower case.
#[derive(Clone, Default)]
pub(super) struct SecretParts(HashSet<[u8; PART]>);

impl SecretParts {
    /// Collects the parts of these keys.
    pub(super) fn new<'s>(keys: impl Iterator<Item = &'s str>) -> Self {
        let mut parts = HashSet::new();
        for key in keys {
            let in_base64 = (0..3).map(|offset| base64_letters(key, offset));
            for form in in_base64.chain([key.to_owned()]) {
                let letters: Vec<u8> = letters(&form).map(|letter| letter.value).collect();
                let windows = letters.windows(PART);
                parts.extend(windows.filter_map(|part| <[u8; PART]>::try_from(part).ok()));
            }
        }
        Self(parts)
    }

    /// Replaces each part by `[secret]`, including any other characters between its letters.
    pub(super) fn masked(&self, text: String) -> String {
        let ranges = self.find(&text);
        if ranges.is_empty() {
            return text;
        }
        let mut masked = String::with_capacity(text.len());
        let mut copied = 0;
        for range in ranges {
            masked += &text[copied..range.start];
            masked += MASK;
            copied = range.end;
        }
        masked + &text[copied..]
    }

    /// Byte ranges of the parts in a text.
    fn find(&self, text: &str) -> Vec<Range<usize>> {
        if self.0.is_empty() {
            return Vec::new();
        }
        let letters: Vec<Letter> = letters(text).collect();
        let mut runs: Vec<Range<usize>> = Vec::new();
        for (index, window) in letters.windows(PART).enumerate() {
            let part: [u8; PART] = std::array::from_fn(|i| window[i].value);
            if !self.0.contains(&part) {
                continue;
            }
            match runs.last_mut() {
                Some(run) if run.end >= index => run.end = index + PART,
                _ => runs.push(index..index + PART),
            }
        }
        runs.into_iter()
            .map(|run| &letters[run])
            .filter(|run| {
                let has_digit = run.iter().any(|letter| letter.value.is_ascii_digit());
                let has_letter = run.iter().any(|letter| letter.value.is_ascii_alphabetic());
                (has_digit && has_letter) || run.len() >= MIN_WORD_PART
            })
            .map(|run| run[0].start..run[run.len() - 1].end)
            .collect()
    }
}

/// Base64 encoding of a key after `offset` unknown bytes, without the letters that depend on other bytes.
fn base64_letters(key: &str, offset: usize) -> String {
    let bytes = [&[0; 2][..offset], key.as_bytes()].concat();
    let encoded = STANDARD_NO_PAD.encode(&bytes);
    let unknown = usize::from(!bytes.len().is_multiple_of(3));
    let known = (offset * 8).div_ceil(6)..encoded.len() - unknown;
    encoded[known].to_owned()
}

/// Letter or digit in a text.
struct Letter {
    /// ASCII code, in lower case.
    value: u8,
    /// Byte offset of its start.
    start: usize,
    /// Byte offset of its end.
    end: usize,
}

/// ASCII letters and digits of a text, including escaped ones such as `\u0073` in JSON or `%73` in a URL. The letter of
/// other escapes, such as `\n`, does not count.
fn letters(text: &str) -> impl Iterator<Item = Letter> {
    let bytes = text.as_bytes();
    let mut start = 0;
    std::iter::from_fn(move || {
        while start < bytes.len() {
            let (value, length) = letter(&bytes[start..]);
            let end = start + length;
            let found = value.is_ascii_alphanumeric().then(|| Letter { value: value.to_ascii_lowercase(), start, end });
            start = end;
            if found.is_some() {
                return found;
            }
        }
        None
    })
}

/// First character of these bytes, unescaped, and its length in bytes.
fn letter(bytes: &[u8]) -> (u8, usize) {
    match bytes {
        [b'\\', b'u', b'0', b'0', ..] => escaped(bytes, 4..6).unwrap_or((0, 1)),
        [b'\\', other, ..] if other.is_ascii() => (0, 2),
        [b'%', ..] => escaped(bytes, 1..3).unwrap_or((0, 1)),
        _ => (bytes[0], 1),
    }
}

/// The byte with this hexadecimal code, and the end of the code.
fn escaped(bytes: &[u8], digits: Range<usize>) -> Option<(u8, usize)> {
    let end = digits.end;
    let digits = std::str::from_utf8(bytes.get(digits)?).ok()?;
    let code = u8::from_str_radix(digits, 16).ok()?;
    Some((code, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "sk-proj-Ab12Cd34Ef56Gh78Ij90";

    fn masked(text: &str) -> String {
        SecretParts::new([KEY].into_iter()).masked(text.to_owned())
    }

    #[test]
    fn keys_in_base64_are_masked_at_any_offset() {
        for before in ["", "a", "ab", "Bearer ", "user:"] {
            for after in ["", "x", "xy"] {
                let encoded = STANDARD_NO_PAD.encode(format!("{before}{KEY}{after}"));
                let text = masked(&format!("It is {encoded}, ok"));
                let [head, tail] = text.split(MASK).collect::<Vec<_>>()[..] else {
                    panic!("{text}");
                };
                let left = head.len() + tail.len() - "It is , ok".len();
                // The rest encodes the surrounding text and at most two bytes of the key.
                let around = (before.len() + after.len()) * 4 / 3;
                assert!(left <= around + 5, "{encoded}: {text}");
            }
        }
    }

    #[test]
    fn keys_in_parts_are_masked() {
        for (text, expected) in [
            ("sk-proj-Ab12Cd34 and Ef56Gh78Ij90", "[secret] and [secret]"),
            ("s k - p r o j - A b 1 2 C d 3 4", "[secret]"),
            ("sk-proj-Ab12\nCd34Ef56\nGh78Ij90.", "[secret]."),
            ("AB12CD34EF56", "[secret]"),
            ("é Ab12\u{200b}Cd34Ef\\u0035\\u0036Gh7%38 é", "é [secret] é"),
        ] {
            assert_eq!(masked(text), expected);
        }
    }

    #[test]
    fn other_text_is_unchanged() {
        for text in ["sk-proj", "the project Ab12", "Zm9v12345678", "%zz \\ud83d %", "é\\"] {
            assert_eq!(masked(text), text);
        }
        let words = SecretParts::new(["bathroom-gateway-key-4711"].into_iter());
        assert_eq!(words.masked("bathroom".to_owned()), "bathroom");
        assert_eq!(words.masked("gateway-key-4711".to_owned()), MASK);
    }
}
