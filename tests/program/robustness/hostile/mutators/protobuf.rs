//! Damage to messages of Protocol Buffers, as models of ONNX are.

use super::words::TEXTS;
use crate::robustness::hostile::random::Random;

/// A field of a message.
#[derive(Clone)]
struct Field {
    /// Its number and the kind of its value.
    tag: u64,
    value: Value,
}

#[derive(Clone)]
enum Value {
    Number(u64),
    Fixed(Vec<u8>),
    Bytes(Vec<u8>),
    Message(Vec<Field>),
}

/// Integers at the ends of what a varint may be.
const NUMBERS: [u64; 10] = [0, 1, 2, 7, 255, 65_536, 0x7FFF_FFFF, 0xFFFF_FFFF, 1 << 62, u64::MAX];

/// Damages one field of a message or of a message in it; false if the file is no message.
pub(super) fn mutate(file: &mut Vec<u8>, random: &mut Random) -> bool {
    let Some(mut fields) = message(file, 0) else {
        return false;
    };
    let mut left = random.below(count(&fields));
    change_at(&mut fields, &mut left, random);
    let mut lie = random.percent(25).then(|| random.below(count(&fields)));
    *file = written(&fields, &mut lie, *random.pick(&NUMBERS));
    true
}

/// The fields of a message; `None` if the bytes are none.
fn message(mut bytes: &[u8], depth: usize) -> Option<Vec<Field>> {
    let mut fields = Vec::new();
    while !bytes.is_empty() {
        let tag = varint(&mut bytes)?;
        let fixed = |bytes: &mut &[u8], length| {
            let (value, rest) = bytes.split_at_checked(length)?;
            *bytes = rest;
            Some(Value::Fixed(value.to_vec()))
        };
        let value = match tag & 7 {
            0 => Value::Number(varint(&mut bytes)?),
            1 => fixed(&mut bytes, 8)?,
            5 => fixed(&mut bytes, 4)?,
            2 => {
                let length = varint(&mut bytes)?;
                let (inner, rest) = bytes.split_at_checked(usize::try_from(length).ok()?)?;
                bytes = rest;
                let fields = if depth < 12 { message(inner, depth + 1) } else { None };
                match fields {
                    Some(fields) if !fields.is_empty() => Value::Message(fields),
                    _ => Value::Bytes(inner.to_vec()),
                }
            }
            _ => return None,
        };
        if tag >> 3 == 0 {
            return None;
        }
        fields.push(Field { tag, value });
    }
    Some(fields)
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for place in 0..10 {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7F) << (7 * place).min(63);
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// The number of fields of a message and of the messages in it; at least 1.
fn count(fields: &[Field]) -> usize {
    fields
        .iter()
        .map(|field| match &field.value {
            Value::Message(fields) => 1 + count(fields),
            _ => 1,
        })
        .sum::<usize>()
        .max(1)
}

/// Damages the field that `left` fields stand before.
fn change_at(fields: &mut Vec<Field>, left: &mut usize, random: &mut Random) -> bool {
    for place in 0..fields.len() {
        if *left == 0 {
            change(fields, place, random);
            return true;
        }
        *left -= 1;
        if let Value::Message(inner) = &mut fields[place].value
            && change_at(inner, left, random)
        {
            return true;
        }
    }
    false
}

fn change(fields: &mut Vec<Field>, place: usize, random: &mut Random) {
    match random.below(6) {
        0 => drop(fields.remove(place)),
        1 => {
            let times = *random.pick(&[1, 2, 500]);
            let copies = vec![fields[place].clone(); times];
            fields.splice(place..place, copies);
        }
        2 => fields[place].tag = (random.next() % 30) << 3 | fields[place].tag & 7,
        _ => match &mut fields[place].value {
            Value::Number(number) => *number = *random.pick(&NUMBERS),
            Value::Fixed(bytes) => {
                let length = bytes.len();
                bytes.copy_from_slice(&random.pick(&NUMBERS).to_le_bytes()[..length]);
            }
            Value::Bytes(bytes) if random.percent(50) => {
                *bytes = random.pick(&TEXTS).as_bytes().to_vec();
            }
            Value::Bytes(bytes) => bytes.truncate(bytes.len() / 2),
            value @ Value::Message(_) => *value = Value::Bytes(vec![0x0A; random.below(9)]),
        },
    }
}

/// The bytes of a message. The field that `lie` fields stand before states `length` in place of its own.
fn written(fields: &[Field], lie: &mut Option<usize>, length: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    for field in fields {
        let lies = *lie == Some(0);
        *lie = lie.and_then(|left| left.checked_sub(1));
        push(&mut bytes, field.tag);
        let inner = match &field.value {
            Value::Number(number) => {
                push(&mut bytes, *number);
                continue;
            }
            Value::Fixed(fixed) => {
                bytes.extend(fixed);
                continue;
            }
            Value::Bytes(inner) => inner.clone(),
            Value::Message(fields) => written(fields, lie, length),
        };
        push(&mut bytes, if lies { length } else { inner.len() as u64 });
        bytes.extend(inner);
    }
    bytes
}

fn push(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}
