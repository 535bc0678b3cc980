//! The one JSON text of a value, for digests: [`canonical`].

use serde::Serialize;
use serde::ser::{self, SerializeMap, SerializeStruct, Serializer};
use serde_json::{Error, Map, Value};

/// The compact JSON of a value, with keys sorted, and `null`s and absent fields left out at every depth, so that a field that
/// is added to a type and is `None` changes nothing.
///
/// Floats are written by serde_json's shortest form that reads back; an `f32` as the `f64` that its shortest decimal names.
///
/// # Errors
/// If a number is infinite or not a number, or a key is no text.
pub(super) fn canonical(value: &impl Serialize) -> Result<String, Error> {
    // A `serde_json::Map` is sorted by its keys.
    serde_json::to_string(&value.serialize(ToValue)?)
}

/// Makes a [`Value`] without `null`s in maps.
struct ToValue;

/// A list or a map that is being filled.
#[derive(Default)]
struct Filling {
    variant: Option<&'static str>,
    list: Vec<Value>,
    map: Map<String, Value>,
    key: String,
}

impl Filling {
    fn of(variant: &'static str) -> Self {
        Self {
            variant: Some(variant),
            ..Self::default()
        }
    }

    fn push(&mut self, value: &(impl Serialize + ?Sized)) -> Result<(), Error> {
        self.list.push(value.serialize(ToValue)?);
        Ok(())
    }

    fn insert(&mut self, key: &str, value: &(impl Serialize + ?Sized)) -> Result<(), Error> {
        let value = value.serialize(ToValue)?;
        if !value.is_null() {
            self.map.insert(key.to_owned(), value);
        }
        Ok(())
    }

    fn wrapped(self, value: Value) -> Value {
        match self.variant {
            None => value,
            Some(variant) => Value::Object(Map::from_iter([(variant.to_owned(), value)])),
        }
    }

    fn into_list(mut self) -> Value {
        let list = std::mem::take(&mut self.list);
        self.wrapped(Value::Array(list))
    }

    fn into_map(mut self) -> Value {
        let map = std::mem::take(&mut self.map);
        self.wrapped(Value::Object(map))
    }
}

fn finite(wide: f64, shortest: &str) -> Result<Value, Error> {
    if !wide.is_finite() {
        return Err(ser::Error::custom("a number in a digest is not finite"));
    }
    // Of an f32 the text names another f64 than itself does.
    let wide = shortest.parse().unwrap_or(wide);
    Ok(Value::from(wide))
}

macro_rules! plain {
    ($($method:ident: $type:ty),+) => {
        $(fn $method(self, value: $type) -> Result<Value, Error> {
            Ok(Value::from(value))
        })+
    };
}

impl Serializer for ToValue {
    type Ok = Value;
    type Error = Error;
    type SerializeSeq = Filling;
    type SerializeTuple = Filling;
    type SerializeTupleStruct = Filling;
    type SerializeTupleVariant = Filling;
    type SerializeMap = Filling;
    type SerializeStruct = Filling;
    type SerializeStructVariant = Filling;

    plain!(serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_str: &str,
        serialize_bytes: &[u8]);

    fn serialize_f32(self, value: f32) -> Result<Value, Error> {
        finite(value.into(), &value.to_string())
    }

    fn serialize_f64(self, value: f64) -> Result<Value, Error> {
        finite(value, &value.to_string())
    }

    fn serialize_char(self, value: char) -> Result<Value, Error> {
        Ok(Value::from(value.to_string()))
    }

    fn serialize_none(self) -> Result<Value, Error> {
        Ok(Value::Null)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Value, Error> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<Value, Error> {
        Ok(Value::Null)
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<Value, Error> {
        Ok(Value::Null)
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
    ) -> Result<Value, Error> {
        Ok(Value::from(variant))
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<Value, Error> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<Value, Error> {
        Ok(Filling::of(variant).wrapped(value.serialize(Self)?))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Filling, Error> {
        Ok(Filling::default())
    }

    fn serialize_tuple(self, _: usize) -> Result<Filling, Error> {
        Ok(Filling::default())
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Filling, Error> {
        Ok(Filling::default())
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Filling, Error> {
        Ok(Filling::of(variant))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Filling, Error> {
        Ok(Filling::default())
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Filling, Error> {
        Ok(Filling::default())
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Filling, Error> {
        Ok(Filling::of(variant))
    }
}

macro_rules! lists {
    ($($name:ident: $method:ident),+) => {
        $(impl ser::$name for Filling {
            type Ok = Value;
            type Error = Error;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Error> {
                self.push(value)
            }

            fn end(self) -> Result<Value, Error> {
                Ok(self.into_list())
            }
        })+
    };
}

lists!(SerializeSeq: serialize_element, SerializeTuple: serialize_element, SerializeTupleStruct: serialize_field,
    SerializeTupleVariant: serialize_field);

impl SerializeMap for Filling {
    type Ok = Value;
    type Error = Error;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Error> {
        self.key = match key.serialize(ToValue)? {
            Value::String(text) => text,
            _ => return Err(ser::Error::custom("a key in a digest is no text")),
        };
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Error> {
        let key = std::mem::take(&mut self.key);
        self.insert(&key, value)
    }

    fn end(self) -> Result<Value, Error> {
        Ok(self.into_map())
    }
}

impl SerializeStruct for Filling {
    type Ok = Value;
    type Error = Error;

    fn serialize_field<T: Serialize + ?Sized>(
        &mut self,
        key: &'static str,
        value: &T,
    ) -> Result<(), Error> {
        self.insert(key, value)
    }

    fn end(self) -> Result<Value, Error> {
        Ok(self.into_map())
    }
}

impl ser::SerializeStructVariant for Filling {
    type Ok = Value;
    type Error = Error;

    fn serialize_field<T: Serialize + ?Sized>(
        &mut self,
        key: &'static str,
        value: &T,
    ) -> Result<(), Error> {
        self.insert(key, value)
    }

    fn end(self) -> Result<Value, Error> {
        Ok(self.into_map())
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
        assert!(canonical(&BTreeMap::from([(1, 2)])).is_err());
    }

    #[test]
    fn a_narrow_number_is_the_decimal_that_it_is_written_as() {
        for number in [0.1_f32, 3.3, 1e-7, 16_777_216.0, f32::MAX] {
            let wide: f64 = number.to_string().parse().unwrap();
            assert_eq!(canonical(&number).unwrap(), canonical(&wide).unwrap());
        }
    }
}
