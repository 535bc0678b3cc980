//! Macros for types that are written as text and parsed from it: [`words`], [`as_text`].

use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

use serde::de::{Error, Visitor};

/// Implements `Display` for an enum: one word for each value.
#[macro_export]
macro_rules! words {
    ($type:ident { $($value:ident = $word:literal),+ $(,)? }) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(match self { $(Self::$value => $word),+ })
            }
        }
    };
}
pub use words;

/// Implements `Serialize` through `Display`.
#[macro_export]
macro_rules! written_as_text {
    ($($type:ty),+) => {
        $(impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        })+
    };
}
pub use written_as_text;

/// Implements `Serialize` through `Display` and `Deserialize` through `FromStr`.
#[macro_export]
macro_rules! as_text {
    ($($type:ty),+) => {
        $crate::written_as_text!($($type),+);

        $(impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
                deserializer.deserialize_str($crate::types::text::words::Text::default())
            }
        })+
    };
}
pub use as_text;

/// A serde visitor that reads a string through `FromStr`.
pub struct Text<T>(PhantomData<T>);

impl<T> Default for Text<T> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T: FromStr<Err: fmt::Display>> Visitor<'_> for Text<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a string")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        text.parse().map_err(E::custom)
    }
}
