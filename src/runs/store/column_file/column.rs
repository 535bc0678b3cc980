//! A column of a Parquet file, and its values: [`Column`], [`Cell`].

use std::borrow::Cow;
use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as PhysicalType};
use parquet::errors::Result;
use parquet::schema::types::{Type, TypePtr};

/// A column of a table whose rows are `R`.
pub struct Column<R> {
    /// The name in the file.
    pub name: &'static str,
    /// The type of the values.
    pub kind: CellKind,
    /// Whether a value may be null.
    pub presence: Presence,
    /// Returns the value of a row.
    pub value: for<'r> fn(&'r R) -> Cell<'r>,
}

/// The type of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// A text that many rows share, such as a name.
    Text,
    /// A text of any length, which counts against the size of a row group.
    LongText,
    /// 16 bytes that are unique to the row.
    Key,
    /// 32 bytes.
    Digest,
    /// A signed integer of 8 bits.
    Int8,
    /// A signed integer of 16 bits.
    Int16,
    /// A signed integer of 32 bits.
    Int32,
    /// A floating-point number of 64 bits.
    Double,
    /// True or false.
    Bool,
}

/// Whether a value may be null.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// Every row has a value.
    Always,
    /// Some rows may have none.
    MayBeNull,
}

/// The value of a row in a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell<'r> {
    /// No value.
    Null,
    /// A value of [`CellKind::Text`] and [`CellKind::LongText`].
    Text(Cow<'r, str>),
    /// A value of [`CellKind::Key`] and [`CellKind::Digest`].
    Bytes(&'r [u8]),
    /// A value of the kinds of integers.
    Int(i128),
    /// A value of [`CellKind::Double`].
    Double(f64),
    /// A value of [`CellKind::Bool`].
    Bool(bool),
}

impl<'r> Cell<'r> {
    /// A borrowed text; null for `None`.
    pub fn text(text: Option<&'r str>) -> Self {
        text.map_or(Self::Null, |text| Self::Text(text.into()))
    }

    /// An integer; null for `None`.
    pub fn int<T: TryInto<i128>>(number: Option<T>) -> Self {
        number.and_then(|number| number.try_into().ok()).map_or(Self::Null, Self::Int)
    }
}

impl CellKind {
    /// The number of bits of an integer kind; `None` for other kinds.
    fn bits(self) -> Option<u32> {
        match self {
            Self::Int8 => Some(8),
            Self::Int16 => Some(16),
            Self::Int32 => Some(32),
            _ => None,
        }
    }

    /// Converts a number to the stored type; `None` if it does not fit into the column.
    pub(super) fn to_stored(self, number: i128) -> Option<i32> {
        let max = (1_i128 << (self.bits()? - 1)) - 1;
        (-max - 1..=max).contains(&number).then_some(number as i32)
    }
}

impl<R> Column<R> {
    /// The column in the schema of the file.
    pub(super) fn field(&self) -> Result<TypePtr> {
        let (physical, length) = match self.kind {
            CellKind::Text | CellKind::LongText => (PhysicalType::BYTE_ARRAY, 0),
            CellKind::Key => (PhysicalType::FIXED_LEN_BYTE_ARRAY, 16),
            CellKind::Digest => (PhysicalType::FIXED_LEN_BYTE_ARRAY, 32),
            CellKind::Int8 | CellKind::Int16 | CellKind::Int32 => (PhysicalType::INT32, 0),
            CellKind::Double => (PhysicalType::DOUBLE, 0),
            CellKind::Bool => (PhysicalType::BOOLEAN, 0),
        };
        let (logical, converted) = match self.kind {
            CellKind::Text | CellKind::LongText => (Some(LogicalType::String), ConvertedType::UTF8),
            CellKind::Int8 => (Some(LogicalType::integer(8, true)), ConvertedType::INT_8),
            CellKind::Int16 => (Some(LogicalType::integer(16, true)), ConvertedType::INT_16),
            _ => (None, ConvertedType::NONE),
        };
        let repetition = match self.presence {
            Presence::Always => Repetition::REQUIRED,
            Presence::MayBeNull => Repetition::OPTIONAL,
        };
        Type::primitive_type_builder(self.name, physical)
            .with_repetition(repetition)
            .with_length(length)
            .with_logical_type(logical)
            .with_converted_type(converted)
            .build()
            .map(Arc::new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_do_not_fit_are_none() {
        for (kind, number, stored) in [
            (CellKind::Int8, 127, Some(127)),
            (CellKind::Int8, 128, None),
            (CellKind::Int8, -128, Some(-128)),
            (CellKind::Int16, -32769, None),
            (CellKind::Int32, 2_147_483_647, Some(i32::MAX)),
            (CellKind::Int32, 2_147_483_648, None),
            (CellKind::Int32, i128::from(u64::MAX), None),
            (CellKind::Text, 1, None),
        ] {
            assert_eq!(kind.to_stored(number), stored, "{kind:?} {number}");
        }
        assert_eq!(Cell::int(Some(u64::MAX)), Cell::Int(u64::MAX.into()));
        assert_eq!(Cell::int(None::<u8>), Cell::Null);
    }
}
