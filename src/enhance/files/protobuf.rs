//! Schema-free decoding of the fields of a protobuf message: [`fields`].
//!
//! The encoding is specified in <https://protobuf.dev/programming-guides/encoding/>. Groups, which ONNX never used, are
//! refused.

use std::ops::Range;

/// Error for bytes that are not a protobuf message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Malformed;

/// Value of a field. Ranges are byte positions in the whole buffer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum FieldValue {
    Varint(u64),
    Fixed32(Range<usize>),
    Fixed64(Range<usize>),
    /// A length-delimited value: a string, bytes, a message or packed numbers.
    Bytes(Range<usize>),
}

/// Iterates over the fields of the message at the position `within` of `buffer`, as pairs of field number and value.
/// Ends after the first error.
pub(super) fn fields(buffer: &[u8], within: Range<usize>) -> Fields<'_> {
    let message = buffer.get(..within.end).unwrap_or_default();
    Fields { message, at: within.start }
}

/// Iterates over the contents of the length-delimited fields with number `wanted`, up to the first malformed field.
pub(super) fn byte_fields(buffer: &[u8], within: Range<usize>, wanted: u64) -> impl Iterator<Item = Range<usize>> {
    fields(buffer, within).filter_map(move |field| match field {
        Ok((number, FieldValue::Bytes(bytes))) if number == wanted => Some(bytes),
        _ => None,
    })
}

/// Appends a length-delimited field to a message.
pub(super) fn push_bytes(message: &mut Vec<u8>, number: u64, bytes: &[u8]) {
    push_varint(message, number << 3 | 2);
    push_varint(message, bytes.len() as u64);
    message.extend(bytes);
}

fn push_varint(message: &mut Vec<u8>, mut value: u64) {
    while value > 127 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

/// Iterator returned by [`fields`].
pub(super) struct Fields<'a> {
    /// The buffer up to the end of the message.
    message: &'a [u8],
    /// Position of the next field.
    at: usize,
}

impl Iterator for Fields<'_> {
    type Item = Result<(u64, FieldValue), Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.message.len() {
            return None;
        }
        let field = self.field();
        if field.is_none() {
            self.at = self.message.len();
        }
        Some(field.ok_or(Malformed))
    }
}

impl Fields<'_> {
    /// Position of the next field in the buffer.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    fn field(&mut self) -> Option<(u64, FieldValue)> {
        let key = self.varint()?;
        let value = match key & 7 {
            0 => FieldValue::Varint(self.varint()?),
            1 => FieldValue::Fixed64(self.take(8)?),
            2 => {
                let length = usize::try_from(self.varint()?).ok()?;
                FieldValue::Bytes(self.take(length)?)
            }
            5 => FieldValue::Fixed32(self.take(4)?),
            _ => return None,
        };
        // Field numbers begin at 1.
        Some((key >> 3, value)).filter(|(number, _)| *number > 0)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = *self.message.get(self.at)?;
            self.at += 1;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, length: usize) -> Option<Range<usize>> {
        let end = self.at.checked_add(length)?;
        let range = self.at..end;
        self.message.get(range.clone())?;
        self.at = end;
        Some(range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Vec<(u64, FieldValue)>, Malformed> {
        fields(bytes, 0..bytes.len()).collect()
    }

    #[test]
    fn fields_of_every_type_are_decoded() {
        let bytes = [
            8, 0x96, 1, // field 1: 150
            0x12, 2, b'h', b'i', // field 2: "hi"
            0x1d, 0, 0, 0, 0, // field 3: four bytes
            0x21, 0, 0, 0, 0, 0, 0, 0, 0, // field 4: eight bytes
        ];
        let expected = vec![
            (1, FieldValue::Varint(150)),
            (2, FieldValue::Bytes(5..7)),
            (3, FieldValue::Fixed32(8..12)),
            (4, FieldValue::Fixed64(13..21)),
        ];
        assert_eq!(read(&bytes), Ok(expected));
    }

    #[test]
    fn malformed_fields_end_the_iteration() {
        let cases: [&[u8]; 7] = [
            &[8],                                                      // no value
            &[0x12, 3, 0, 0],                                          // two bytes of three
            &[0x12, 0xff, 0xff, 0xff],                                 // length without an end
            &[0x0b],                                                   // a group
            &[0, 1],                                                   // field 0
            &[8, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1], // eleven bytes of varint
            &[0x12, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1],   // a length of 2^64 − 1
        ];
        for bytes in cases {
            assert_eq!(read(bytes), Err(Malformed), "{bytes:?}");
        }
    }
}
