//! The canonical JSON text of a value, for digests: [`canonical`].

use ciborium::Value as Content;
use serde::Serialize;
use serde::ser::Error as _;
use serde_json::{Error, Value};

/// The canonical JSON of a value: keys are sorted, and fields that are `null` or absent are left out at every depth.
/// Adding a field that is `None` therefore changes no digest.
///
/// Floats have the shortest decimal form that parses to the same number, an `f32` that of the `f32`.
///
/// # Errors
/// If a number is infinite or NaN, or a key is not a string.
pub(super) fn canonical(value: &impl Serialize) -> Result<Value, Error> {
    let content = Content::serialized(value).map_err(Error::custom)?;
    if !is_finite(&content) {
        return Err(Error::custom("a number in a digest is not finite"));
    }
    // A `serde_json::Map` is sorted by key.
    let mut value = serde_json::from_str(&serde_json::to_string(value)?)?;
    remove_nulls(&mut value);
    Ok(value)
}

/// True if all numbers are finite; serde_json would write `null` for the others.
fn is_finite(content: &Content) -> bool {
    match content {
        Content::Float(number) => number.is_finite(),
        Content::Array(items) => items.iter().all(is_finite),
        Content::Map(entries) => entries.iter().all(|(_, value)| is_finite(value)),
        _ => true,
    }
}

fn remove_nulls(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(remove_nulls),
        Value::Object(map) => {
            map.retain(|_, value| !value.is_null());
            map.values_mut().for_each(remove_nulls);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[derive(Serialize)]
    enum Part {
        Alone,
        Number(f32),
        Fields { z: Option<u8>, a: u8 },
    }

    #[derive(Serialize)]
    struct Facts {
        wide: f64,
        narrow: f32,
        missing: Option<u8>,
        parts: Vec<Part>,
        seed: u64,
        names: BTreeMap<&'static str, Option<bool>>,
    }

    fn facts() -> Facts {
        Facts {
            wide: 7.5,
            narrow: 0.1,
            missing: None,
            parts: vec![Part::Alone, Part::Number(3.3), Part::Fields { z: None, a: 1 }],
            seed: u64::MAX,
            names: BTreeMap::from([("b", Some(true)), ("a", None)]),
        }
    }

    #[test]
    fn text_is_sorted_and_without_nulls() {
        assert_eq!(
            canonical(&facts()).unwrap().to_string(),
            r#"{"names":{"b":true},"narrow":0.1,"parts":["Alone",{"Number":3.3},{"Fields":{"a":1}}],"seed":18446744073709551615,"wide":7.5}"#
        );
    }

    #[test]
    fn an_added_field_that_is_none_changes_nothing() {
        #[derive(Serialize)]
        struct Before {
            name: &'static str,
        }
        #[derive(Serialize)]
        struct After {
            added: Option<u8>,
            name: &'static str,
        }
        let before = canonical(&[Before { name: "a" }]).unwrap();
        let [none, some] = [None, Some(0)].map(|added| canonical(&[After { added, name: "a" }]).unwrap());
        assert_eq!(before, none);
        assert_ne!(before, some);
    }

    #[test]
    fn a_value_without_a_json_text_is_an_error() {
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(canonical(&[Some(number)]).is_err());
            assert!(canonical(&(number as f32)).is_err());
        }
        assert!(canonical(&BTreeMap::from([([1], 2)])).is_err());
    }

    #[test]
    fn an_f32_is_written_as_its_shortest_decimal() {
        for number in [0.1_f32, 3.3, 1e-7, 16_777_216.0, f32::MAX] {
            let wide: f64 = number.to_string().parse().unwrap();
            assert_eq!(canonical(&number).unwrap(), canonical(&wide).unwrap());
        }
    }
}
