//! The one JSON text of a value, for digests: [`canonical`].

use ciborium::Value as Content;
use serde::Serialize;
use serde::ser::Error as _;
use serde_json::{Error, Value};

/// The compact JSON of a value, with keys sorted, and `null`s and absent fields left out at every depth, so that a field that
/// is added to a type and is `None` changes nothing.
///
/// Floats are written by serde_json's shortest form that reads back; an `f32` as the `f64` that its shortest decimal names.
///
/// # Errors
/// If a number is infinite or not a number, or a key is no text.
pub(super) fn canonical(value: &impl Serialize) -> Result<String, Error> {
    let content = Content::serialized(value).map_err(Error::custom)?;
    if !is_finite(&content) {
        return Err(Error::custom("a number in a digest is not finite"));
    }
    // A `serde_json::Map` is sorted by its keys.
    let mut value = serde_json::from_str(&serde_json::to_string(value)?)?;
    leave_nulls_out(&mut value);
    serde_json::to_string(&value)
}

/// Whether all numbers are finite; JSON has `null` for those that are not.
fn is_finite(content: &Content) -> bool {
    match content {
        Content::Float(number) => number.is_finite(),
        Content::Array(items) => items.iter().all(is_finite),
        Content::Map(entries) => entries.iter().all(|(_, value)| is_finite(value)),
        _ => true,
    }
}

fn leave_nulls_out(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(leave_nulls_out),
        Value::Object(map) => {
            map.retain(|_, value| !value.is_null());
            map.values_mut().for_each(leave_nulls_out);
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
            parts: vec![
                Part::Alone,
                Part::Number(3.3),
                Part::Fields { z: None, a: 1 },
            ],
            seed: u64::MAX,
            names: BTreeMap::from([("b", Some(true)), ("a", None)]),
        }
    }

    #[test]
    fn text_is_sorted_and_without_nulls() {
        assert_eq!(
            canonical(&facts()).unwrap(),
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
        let after = |added| canonical(&[After { added, name: "a" }]).unwrap();
        assert_eq!(before, after(None));
        assert_ne!(before, after(Some(0)));
    }

    #[test]
    fn what_has_no_text_is_an_error() {
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(canonical(&[Some(number)]).is_err());
            assert!(canonical(&(number as f32)).is_err());
        }
        assert!(canonical(&BTreeMap::from([([1], 2)])).is_err());
    }

    #[test]
    fn a_narrow_number_is_the_decimal_that_it_is_written_as() {
        for number in [0.1_f32, 3.3, 1e-7, 16_777_216.0, f32::MAX] {
            let wide: f64 = number.to_string().parse().unwrap();
            assert_eq!(canonical(&number).unwrap(), canonical(&wide).unwrap());
        }
    }
}
