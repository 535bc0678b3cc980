//! Escapes of JSON that stand for no character: [`mended`].

/// The text with every `\ud800`–`\udfff` that has no other half replaced by `\ufffd`; `None` where there is none.
///
/// Servers that cut a reply within an emoji send such halves. JSON allows them, text cannot hold them, and a reply that
/// was paid for must not be lost over one.
pub(super) fn mended(json: &str) -> Option<String> {
    let bytes = json.as_bytes();
    let mut out = String::new();
    let (mut copied, mut at) = (0, 0);
    while at < bytes.len() {
        if bytes[at] != b'\\' {
            at += 1;
            continue;
        }
        at += match unit(bytes, at) {
            Some(0xD800..=0xDBFF) if matches!(unit(bytes, at + 6), Some(0xDC00..=0xDFFF)) => 12,
            Some(0xD800..=0xDFFF) => {
                out.push_str(json.get(copied..at)?);
                out.push_str("\\ufffd");
                copied = at + 6;
                6
            }
            // Any other escape is of two bytes at least; what follows them is no escape.
            _ => 2,
        };
    }
    if copied == 0 {
        return None;
    }
    out.push_str(json.get(copied..)?);
    Some(out)
}

/// The UTF-16 unit that an escape `\uXXXX` at this place stands for.
fn unit(bytes: &[u8], at: usize) -> Option<u16> {
    let escape = bytes.get(at..at + 6)?;
    let digits = escape.strip_prefix(b"\\u")?;
    u16::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_replaced_and_pairs_kept() {
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
            assert_eq!(mended(json).as_deref(), expected, "{json}");
        }
    }
}
