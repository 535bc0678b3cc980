//! Repair of JSON that servers write and a parser refuses: [`repaired`].

/// Numbers that Python writes and JSON does not have.
const NON_NUMBERS: [&[u8]; 3] = [b"NaN", b"Infinity", b"-Infinity"];

/// The JSON text with every unpaired surrogate escape (`\ud800`–`\udfff`) replaced by `\ufffd`, and every `NaN` and
/// `Infinity` outside of strings by `null`; `None` if nothing was replaced.
///
/// Servers that cut a reply inside an emoji send unpaired surrogates. The grammar of JSON allows them (RFC 8259,
/// section 8.2), but a Rust string cannot contain them. Servers in Python send log probabilities that are no numbers.
/// Without the repair, a paid reply would be lost.
pub(crate) fn repaired(json: &str) -> Option<String> {
    let bytes = json.as_bytes();
    let mut text = String::new();
    // Bytes before `copied_to` are in `text` already.
    let (mut copied_to, mut position) = (0, 0);
    let mut in_string = false;
    while position < bytes.len() {
        let (length, replacement) = match bytes[position] {
            b'"' => {
                in_string = !in_string;
                (1, None)
            }
            b'\\' => escape(bytes, position),
            _ if in_string => (1, None),
            _ => NON_NUMBERS
                .iter()
                .find(|word| bytes[position..].starts_with(word))
                .map_or((1, None), |word| (word.len(), Some("null"))),
        };
        if let Some(replacement) = replacement {
            text.push_str(json.get(copied_to..position)?);
            text.push_str(replacement);
            copied_to = position + length;
        }
        position += length;
    }
    if copied_to == 0 {
        return None;
    }
    text.push_str(json.get(copied_to..)?);
    Some(text)
}

/// Length of the escape at a byte position, a whole surrogate pair included, and its replacement if it is an unpaired
/// surrogate.
fn escape(bytes: &[u8], position: usize) -> (usize, Option<&'static str>) {
    match utf16_unit(bytes, position) {
        Some(0xD800..=0xDBFF) if matches!(utf16_unit(bytes, position + 6), Some(0xDC00..=0xDFFF)) => (12, None),
        Some(0xD800..=0xDFFF) => (6, Some("\\ufffd")),
        // Other escapes: the backslash and the byte after it, which may be a backslash or a quotation mark.
        _ => (2, None),
    }
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
            (r#""\udc00\ud83d\ud83d\ude00""#, Some(r#""\ufffd\ufffd\ud83d\ude00""#)),
            (r#""\ud83d\ude00 \\ud83d \n""#, None),
            (r#""\ud83""#, None),
            (r#""NaN \" NaN""#, None),
            ("é\\", None),
        ] {
            assert_eq!(repaired(json).as_deref(), expected, "{json}");
        }
    }

    #[test]
    fn non_numbers_become_null() {
        let json = r#"{"text":"NaN","a":NaN,"b":[-Infinity,Infinity,-1]}"#;
        let expected = r#"{"text":"NaN","a":null,"b":[null,null,-1]}"#;
        assert_eq!(repaired(json).as_deref(), Some(expected));
    }
}
