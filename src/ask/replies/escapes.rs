//! Replacement of unpaired UTF-16 surrogates in JSON escapes: [`repaired`].

/// The JSON text with every unpaired surrogate escape (`\ud800`–`\udfff`) replaced by `\ufffd`; `None` if nothing was replaced.
///
/// Servers that cut a reply inside an emoji send unpaired surrogates. The grammar of JSON allows them (RFC 8259, section 8.2), but a
/// Rust string cannot contain them. Without the repair, a paid reply would be lost.
pub(in crate::ask) fn repaired(json: &str) -> Option<String> {
    let bytes = json.as_bytes();
    let mut text = String::new();
    // Bytes before `copied_to` are in `text` already.
    let (mut copied_to, mut position) = (0, 0);
    while position < bytes.len() {
        if bytes[position] != b'\\' {
            position += 1;
            continue;
        }
        position += match utf16_unit(bytes, position) {
            Some(0xD800..=0xDBFF)
                if matches!(utf16_unit(bytes, position + 6), Some(0xDC00..=0xDFFF)) =>
            {
                12
            }
            Some(0xD800..=0xDFFF) => {
                text.push_str(json.get(copied_to..position)?);
                text.push_str("\\ufffd");
                copied_to = position + 6;
                6
            }
            // Other escapes: skip the backslash and the byte after it, which may be a backslash too.
            _ => 2,
        };
    }
    if copied_to == 0 {
        return None;
    }
    text.push_str(json.get(copied_to..)?);
    Some(text)
}

/// The UTF-16 code unit of the escape `\uXXXX` at a byte position; `None` if no such escape starts there.
fn utf16_unit(bytes: &[u8], position: usize) -> Option<u16> {
    let escape = bytes.get(position..position + 6)?;
    let digits = escape.strip_prefix(b"\\u")?;
    u16::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_unpaired_surrogates_are_replaced() {
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
