//! Fields of a protobuf message by number: [`fields`].

use super::Nanoseconds;
use super::fields::ends_early;

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
