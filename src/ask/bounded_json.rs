//! Robust parsing of the JSON in replies: bounded memory, and a repair of what servers write wrong.
//!
//! Parsing of JSON from a server with bounded memory: [`parse`].
//!
//! A body of 16 MB of small objects would take 1.5 GB as a tree of values, and no reply needs so many. Lists and
//! objects are read to their end, but values beyond the bounds are dropped, so that a field after a long list is still
//! found.
//!
//! Repair of JSON that servers write and a parser refuses: [`repaired`].

use std::cell::Cell;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

/// Maximum number of values in one text; chosen: they take at most 150 MB.
const MAX_VALUES: usize = 200_000;

/// Maximum number of items in a list, and of fields in an object; chosen.
pub const MAX_ITEMS: usize = 10_000;

/// Parses a text that is one JSON value, [repaired] if necessary.
///
/// # Errors
/// If the text is not a single complete JSON value.
pub fn parse(text: &str) -> serde_json::Result<Value> {
    parse_valid(text).or_else(|error| repaired(text).and_then(|text| parse_valid(&text).ok()).ok_or(error))
}

/// Parses a text that is one valid JSON value.
fn parse_valid(text: &str) -> serde_json::Result<Value> {
    let mut json = serde_json::Deserializer::from_str(text);
    let value = bounded(&mut json)?;
    json.end()?;
    Ok(value)
}

/// Parses the JSON value at the start of a text; the rest of the text is ignored.
///
/// # Errors
/// If the text does not start with a complete JSON value.
pub fn parse_start(text: &str) -> serde_json::Result<Value> {
    bounded(&mut serde_json::Deserializer::from_str(text))
}

fn bounded<'j>(json: impl Deserializer<'j, Error = serde_json::Error>) -> serde_json::Result<Value> {
    let left = Cell::new(MAX_VALUES);
    Bounded { left: &left }.deserialize(json)
}

/// Deserializes a value, and keeps at most `left` values in it.
struct Bounded<'l> {
    left: &'l Cell<usize>,
}

impl Bounded<'_> {
    /// Reserves room for one more value in a list or object of `len` values; `None` at a bound.
    fn reserve(&self, len: usize) -> Option<Self> {
        let left = self.left.get().checked_sub(1)?;
        (len < MAX_ITEMS).then(|| {
            self.left.set(left);
            Self { left: self.left }
        })
    }
}

impl<'j> DeserializeSeed<'j> for Bounded<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'j>>(self, json: D) -> Result<Value, D::Error> {
        json.deserialize_any(self)
    }
}

impl<'j> Visitor<'j> for Bounded<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E: Error>(self, value: String) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'j>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        while let Some(seed) = self.reserve(items.len()) {
            match list.next_element_seed(seed)? {
                Some(item) => items.push(item),
                None => return Ok(items.into()),
            }
        }
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(items.into())
    }

    fn visit_map<A: MapAccess<'j>>(self, mut object: A) -> Result<Value, A::Error> {
        let mut fields = Map::new();
        while let Some(seed) = self.reserve(fields.len()) {
            match object.next_key::<String>()? {
                Some(name) => fields.insert(name, object.next_value_seed(seed)?),
                None => return Ok(fields.into()),
            };
        }
        while object.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(fields.into())
    }
}

/// Numbers that Python writes and JSON does not have.
const NON_NUMBERS: [&[u8]; 3] = [b"NaN", b"Infinity", b"-Infinity"];

/// The JSON text with every unpaired surrogate escape (`\ud800`–`\udfff`) replaced by `\ufffd`, and every `NaN` and
/// `Infinity` outside of strings by `null`; `None` if nothing was replaced.
///
/// Servers that cut a reply inside an emoji send unpaired surrogates. The grammar of JSON allows them (RFC 8259,
/// section 8.2), but a Rust string cannot contain them. Servers in Python send log probabilities that are no numbers.
/// Without the repair, a paid reply would be lost.
fn repaired(json: &str) -> Option<String> {
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
    use serde_json::json;

    use super::*;

    #[test]
    fn small_values_match_serde() {
        for text in [
            r#"{"a":[1,-2,3.5,1e300,true,null,"x\n\ud83d\ude00"],"b":{},"c":[[]],"a ":18446744073709551615}"#,
            "[]",
            "\"x\"",
            " 7 ",
            r#"{"a":1,"a":2}"#,
        ] {
            assert_eq!(parse(text).unwrap(), serde_json::from_str::<Value>(text).unwrap());
        }
        for text in ["", "{", "[1,]", "{} x", "[1e999]", "nul"] {
            let expected = serde_json::from_str::<Value>(text).unwrap_err();
            assert_eq!(parse(text).unwrap_err().to_string(), expected.to_string());
        }
        assert_eq!(parse_start("{\"a\":1} and more").unwrap(), json!({"a": 1}));
        assert!(parse(&"[".repeat(1000)).is_err());
    }

    #[test]
    fn a_field_after_a_long_list_is_found() {
        let items = "{\"a\":1},".repeat(50_000);
        let text = format!("{{\"x\":[{items}1],\"y\":2}}");
        let value = parse(&text).unwrap();
        assert_eq!(value["y"], 2);
        assert_eq!(value["x"].as_array().unwrap().len(), MAX_ITEMS);
        // Values beyond the bounds must be valid JSON too.
        assert!(parse(&text.replace(",1]", ",]")).is_err());
    }

    #[test]
    fn the_number_of_values_is_bounded() {
        fn count(value: &Value) -> usize {
            match value {
                Value::Array(items) => 1 + items.iter().map(count).sum::<usize>(),
                Value::Object(fields) => 1 + fields.values().map(count).sum::<usize>(),
                _ => 1,
            }
        }
        let list = format!("[{}1]", "[1],".repeat(1_000));
        let text = format!("[{}1]", format!("{list},").repeat(300));
        assert!(count(&parse(&text).unwrap()) <= 1 + MAX_VALUES);
    }

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
