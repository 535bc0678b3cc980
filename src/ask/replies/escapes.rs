//! Repair of JSON escapes that stand for no character: [`repaired`].

/// The text with every unpaired surrogate `\ud800`–`\udfff` replaced by `\ufffd`; `None` if there is none.
///
/// Servers that cut a reply within an emoji send such surrogates. JSON allows them, but a text cannot contain them, and a
/// reply that was paid for must not be lost.
pub(in crate::ask) fn repaired(json: &str) -> Option<String> {
    let bytes = json.as_bytes();
    let mut text = String::new();
    let (mut copied, mut at) = (0, 0);
    while at < bytes.len() {
        if bytes[at] != b'\\' {
            at += 1;
            continue;
        }
        at += match unit(bytes, at) {
            Some(0xD800..=0xDBFF) if matches!(unit(bytes, at + 6), Some(0xDC00..=0xDFFF)) => 12,
            Some(0xD800..=0xDFFF) => {
                text.push_str(json.get(copied..at)?);
                text.push_str("\\ufffd");
                copied = at + 6;
                6
            }
            // Any other escape has at least two bytes; further bytes begin no escape.
            _ => 2,
        };
    }
    if copied == 0 {
        return None;
    }
    text.push_str(json.get(copied..)?);
    Some(text)
}

/// The UTF-16 unit of an escape `\uXXXX` at this position; `None` if there is none.
fn unit(bytes: &[u8], at: usize) -> Option<u16> {
    let escape = bytes.get(at..at + 6)?;
    let digits = escape.strip_prefix(b"\\u")?;
    u16::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unpaired_surrogates_are_replaced_and_pairs_are_not() {
        for (json, expected) in [
            (r#""B \ud83d""#, Some(r#""B \ufffd""#)),
            (
                r#""\udc00\ud83d\ud83d\ude00""#,
                Some(r#""\ufffd\ufffd\ud83d\ude00""#),
            ),
            (r#""\ud83d\ude00 \\ud83d \n""#, None),
            (r#""\ud83""#, None),
            ("é\\", None),
        ] {
            assert_eq!(repaired(json).as_deref(), expected, "{json}");
        }
    }
}
