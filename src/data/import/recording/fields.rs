//! Reader of the fields of a serialized message, in the order of its definition: [`FieldReader`].
//!
//! CDR follows OMG DDSI-RTPS 2.3, section 10, with the alignment of XCDR1 or XCDR2 (DDS-XTypes 1.3, section 7.4.3). ROS
//! 1 and the records of MCAP are little-endian and have no alignment.
//!
//! Fields of a protobuf message by number: [`fields`].

use super::Nanoseconds;

/// Reader of fields.
#[derive(Debug, Clone)]
pub(super) struct FieldReader<'a> {
    bytes: &'a [u8],
    /// Offset of the next byte.
    offset: usize,
    rules: SerializationRules,
}

/// Rules of a serialization.
#[derive(Debug, Clone, Copy)]
struct SerializationRules {
    is_big_endian: bool,
    /// Maximum alignment of a number, in bytes; 1 for none.
    max_alignment: usize,
    /// True if texts end with a zero byte, which is part of their length.
    has_terminator: bool,
}

impl<'a> FieldReader<'a> {
    /// Reader of little-endian fields without alignment: messages of ROS 1 and records of MCAP.
    pub(super) fn unaligned(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            offset: 0,
            rules: SerializationRules { is_big_endian: false, max_alignment: 1, has_terminator: false },
        }
    }

    /// Reader of a CDR message, which begins with a header of four bytes.
    ///
    /// # Errors
    /// If the message is not plain CDR.
    pub(super) fn cdr(message: &'a [u8]) -> Result<Self, String> {
        let Some((&[zero, kind, _, _], bytes)) = message.split_first_chunk() else {
            return Err(ends_early());
        };
        let (is_big_endian, max_alignment) = match (zero, kind) {
            (0, 0) => (true, 8),
            (0, 1) => (false, 8),
            (0, 6) => (true, 4),
            (0, 7) => (false, 4),
            _ => {
                return Err(format!(
                    "CDR representation {zero:#04x}{kind:02x}; plain CDR (0 or 1) or CDR2 (6 or 7) expected"
                ));
            }
        };
        Ok(Self { bytes, offset: 0, rules: SerializationRules { is_big_endian, max_alignment, has_terminator: true } })
    }

    /// Reads this number of bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let taken =
            self.offset.checked_add(count).and_then(|end| self.bytes.get(self.offset..end)).ok_or_else(ends_early)?;
        self.offset += count;
        Ok(taken)
    }

    /// Skips the padding before a number of this size.
    fn align(&mut self, size: usize) {
        self.offset = self.offset.next_multiple_of(size.min(self.rules.max_alignment));
    }

    /// Reads the bytes of a number as little-endian.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.align(N);
        let mut bytes: [u8; N] = self.take(N)?.try_into().map_err(|_| ends_early())?;
        if self.rules.is_big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(super) fn u8(&mut self) -> Result<u8, String> {
        self.number().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, String> {
        self.number().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, String> {
        self.number().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, String> {
        self.number().map(u64::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, String> {
        self.number().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, String> {
        self.number().map(f64::from_le_bytes)
    }

    /// Reads a sequence of bytes.
    pub(super) fn bytes(&mut self) -> Result<&'a [u8], String> {
        let count = self.u32()?;
        self.take(count as usize)
    }

    /// Reads a text. Bytes that are not UTF-8 are replaced.
    pub(super) fn text(&mut self) -> Result<String, String> {
        let mut bytes = self.bytes()?;
        if self.rules.has_terminator {
            bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        }
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    /// Reads a sequence of 8-byte floats.
    pub(super) fn doubles(&mut self) -> Result<Vec<f64>, String> {
        let count = self.u32()?;
        // If the count is too large, the first missing number ends the loop.
        (0..count).map(|_| self.f64()).collect()
    }

    /// Reads a time in seconds and nanoseconds. Seconds are signed in ROS 2 and unsigned in ROS 1; the two differ only
    /// after 2038.
    pub(super) fn time(&mut self) -> Result<Nanoseconds, String> {
        let (seconds, rest) = (self.u32()?, self.u32()?);
        Ok(i64::from(seconds.cast_signed()) * 1_000_000_000 + i64::from(rest))
    }
}

/// Error message for a message that is shorter than its fields.
fn ends_early() -> String {
    "the message ends before its last field".to_owned()
}

/// Value of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value<'a> {
    Varint(u64),
    Fixed64([u8; 8]),
    Bytes(&'a [u8]),
    Fixed32([u8; 4]),
}

impl<'a> Value<'a> {
    /// Bytes of a text, a nested message or packed numbers; empty for numbers.
    pub(super) fn bytes(self) -> &'a [u8] {
        match self {
            Self::Bytes(bytes) => bytes,
            _ => &[],
        }
    }

    /// Integer of any wire type; 0 for bytes.
    pub(super) fn number(self) -> u64 {
        match self {
            Self::Varint(number) => number,
            Self::Fixed64(bytes) => u64::from_le_bytes(bytes),
            Self::Fixed32(bytes) => u64::from(u32::from_le_bytes(bytes)),
            Self::Bytes(_) => 0,
        }
    }

    pub(super) fn text(self) -> String {
        String::from_utf8_lossy(self.bytes()).into_owned()
    }

    /// Floats of 8 bytes: a packed list, or a single one.
    pub(super) fn doubles(self) -> Vec<f64> {
        match self {
            Self::Fixed64(bytes) => vec![f64::from_le_bytes(bytes)],
            Self::Bytes(bytes) => bytes.as_chunks::<8>().0.iter().map(|number| f64::from_le_bytes(*number)).collect(),
            _ => Vec::new(),
        }
    }

    /// Parses a `google.protobuf.Timestamp`.
    pub(super) fn time(self) -> Result<Nanoseconds, String> {
        let mut time = 0_i64;
        for field in fields(self.bytes()) {
            match field? {
                (1, seconds) => {
                    let seconds = seconds.number().cast_signed();
                    time = time.saturating_add(seconds.saturating_mul(1_000_000_000));
                }
                (2, rest) => time = time.saturating_add(rest.number().cast_signed()),
                _ => {}
            }
        }
        Ok(time)
    }
}

/// Fields of a message in order, with their numbers. Stops after the first broken field.
pub(super) fn fields(message: &[u8]) -> impl Iterator<Item = Result<(u64, Value<'_>), String>> {
    let mut rest = message;
    std::iter::from_fn(move || {
        (!rest.is_empty()).then(|| {
            let field = parse_field(&mut rest);
            if field.is_err() {
                rest = &[];
            }
            field
        })
    })
}

fn parse_field<'a>(rest: &mut &'a [u8]) -> Result<(u64, Value<'a>), String> {
    let tag = varint(rest)?;
    let value = match tag & 7 {
        0 => Value::Varint(varint(rest)?),
        1 => Value::Fixed64(fixed(rest)?),
        2 => {
            let length = usize::try_from(varint(rest)?).map_err(|_| ends_early())?;
            Value::Bytes(rest.split_off(..length).ok_or_else(ends_early)?)
        }
        5 => Value::Fixed32(fixed(rest)?),
        kind => return Err(format!("protobuf field of wire type {kind}")),
    };
    Ok((tag >> 3, value))
}

fn fixed<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], String> {
    let (bytes, after) = rest.split_first_chunk().ok_or_else(ends_early)?;
    *rest = after;
    Ok(*bytes)
}

fn varint(rest: &mut &[u8]) -> Result<u64, String> {
    let mut number = 0;
    for shift in (0..64).step_by(7) {
        let byte = *rest.split_off_first().ok_or_else(ends_early)?;
        number |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(number);
        }
    }
    Err("protobuf number of more than 64 bits".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_by_the_representation() {
        // A byte, then a double at 8 in XCDR1 and at 4 in XCDR2.
        let mut first = vec![0, 1, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0];
        first.extend(2.5_f64.to_le_bytes());
        let mut reader = FieldReader::cdr(&first).unwrap();
        assert_eq!((reader.u8(), reader.f64()), (Ok(7), Ok(2.5)));
        let mut second = vec![0, 6, 0, 0, 7, 0, 0, 0];
        second.extend(2.5_f64.to_be_bytes());
        let mut reader = FieldReader::cdr(&second).unwrap();
        assert_eq!((reader.u8(), reader.f64()), (Ok(7), Ok(2.5)));
    }

    #[test]
    fn only_cdr_texts_end_with_zero() {
        let text = [0, 0, 0, 0, 0, 0, 0, 3, b'a', b'b', 0];
        assert_eq!(FieldReader::cdr(&text).unwrap().text().unwrap(), "ab");
        let text = [2, 0, 0, 0, b'a', b'b'];
        assert_eq!(FieldReader::unaligned(&text).text().unwrap(), "ab");
    }

    #[test]
    fn lengths_beyond_the_message_are_refused() {
        for length in [4_u32, u32::MAX] {
            let bytes = [&length.to_le_bytes()[..], b"abc"].concat();
            assert!(FieldReader::unaligned(&bytes).bytes().is_err());
            assert!(FieldReader::unaligned(&bytes).doubles().is_err());
        }
        assert!(FieldReader::cdr(&[0, 1]).is_err());
        assert!(FieldReader::cdr(&[0, 3, 0, 0]).unwrap_err().contains("plain CDR"));
    }

    fn time(seconds: i32, rest: u32) -> i64 {
        let bytes = [seconds.to_le_bytes(), rest.to_le_bytes()].concat();
        FieldReader::unaligned(&bytes).time().unwrap()
    }

    #[test]
    fn negative_and_late_times_are_read() {
        assert_eq!(time(-1, 500_000_000), -500_000_000);
        assert_eq!(time(i32::MAX, 999_999_999), 2_147_483_647_999_999_999);
    }

    #[test]
    fn fields_of_every_wire_type_are_read() {
        let message = [
            8, 0x96, 1, // 1: 150
            0x12, 2, b'h', b'i', // 2: "hi"
            0x1d, 7, 0, 0, 0, // 3: 7
            0x21, 0, 0, 0, 0, 0, 0, 0xf8, 0x3f, // 4: 1.5
        ];
        let found: Vec<(u64, Value<'_>)> = fields(&message).map(Result::unwrap).collect();
        assert_eq!(found[0], (1, Value::Varint(150)));
        assert_eq!(found[1].1.text(), "hi");
        assert_eq!(found[2].1.number(), 7);
        assert_eq!(found[3].1.doubles(), [1.5]);
    }

    #[test]
    fn broken_fields_end_the_message() {
        for message in [&[0x12, 9, 1][..], &[0xff; 11], &[0x0b], &[0x0d, 1]] {
            let found: Vec<_> = fields(message).collect();
            assert_eq!(found.len(), 1);
            assert!(found[0].is_err());
        }
    }
}
