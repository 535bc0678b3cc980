//! Exposure times and gains in messages of any type: [`Exposure`].
//!
//! Camera drivers have no common message for exposure. Two kinds of ROS messages are therefore read: flat messages that
//! begin with a header and have a field with “exposure” or “gain” in its name, and messages with JSON in a field
//! `json_data`, as of RealSense cameras.
//!
//! Supported serializations of messages: [`Encoding`].

use serde_json::{Map, Value, json};

use super::Nanoseconds;
use super::fields::FieldReader;

/// Maximum length of a definition that is searched, in bytes (chosen).
const MAX_DEFINITION_BYTES: usize = 64 << 10;

/// Exposure of one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposure {
    /// Time of the image.
    pub stamp: Nanoseconds,
    /// Values by field name, in the units of the driver.
    pub values: Map<String, Value>,
}

/// Fields of a message after its header, in order.
#[derive(Debug, Clone)]
pub struct ExposureFields {
    encoding: Encoding,
    fields: Vec<(Primitive, String)>,
}

/// Type of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Primitive {
    /// Unsigned integer of this number of bytes.
    Unsigned(usize),
    /// Signed integer of this number of bytes.
    Signed(usize),
    /// Float of this number of bytes.
    Float(usize),
    Text,
}

/// Returns a definition if it may have fields about exposure, else an empty one to save memory.
pub(super) fn relevant_definition(definition: &[u8]) -> Vec<u8> {
    let text = definition.to_ascii_lowercase();
    let is_relevant = definition.len() <= MAX_DEFINITION_BYTES
        && [&b"exposure"[..], b"gain", b"json_data"]
            .iter()
            .any(|word| text.windows(word.len()).any(|part| part == *word));
    if is_relevant { definition.to_vec() } else { Vec::new() }
}

impl ExposureFields {
    /// Parses a ROS message definition; `None` if the message has no header or nothing about exposure.
    pub(super) fn from_definition(definition: &[u8], encoding: Encoding) -> Option<Self> {
        if !matches!(encoding, Encoding::Cdr | Encoding::Ros1) {
            return None;
        }
        let text = std::str::from_utf8(definition).ok()?;
        // The definitions of nested types follow after a line of equals signs.
        let mut lines = text
            .split("\n===")
            .next()?
            .lines()
            .map(|line| line.split('#').next().unwrap_or_default().trim())
            .filter(|line| !line.is_empty() && !line.contains('='))
            .filter_map(|line| line.split_once(char::is_whitespace));
        let (header, _) = lines.next()?;
        if !matches!(header, "std_msgs/Header" | "std_msgs/msg/Header" | "Header") {
            return None;
        }
        let fields: Vec<(Primitive, String)> = lines
            .map_while(|(kind, rest)| {
                let name = rest.split_whitespace().next()?;
                Some((Primitive::from_name(kind)?, name.to_owned()))
            })
            .collect();
        let has_exposure = fields.iter().any(|(_, name)| is_about_exposure(name) || name == "json_data");
        has_exposure.then_some(Self { encoding, fields })
    }

    /// Parses a message; `None` if it has no values about exposure.
    ///
    /// # Errors
    /// If the message is shorter than its fields.
    pub fn parse(&self, bytes: &[u8]) -> Result<Option<Exposure>, String> {
        let mut reader = match self.encoding {
            Encoding::Ros1 => FieldReader::unaligned(bytes),
            _ => FieldReader::cdr(bytes)?,
        };
        if self.encoding == Encoding::Ros1 {
            reader.u32()?;
        }
        let stamp = reader.time()?;
        let _frame_id = reader.text()?;
        let mut values = Map::new();
        for (kind, name) in &self.fields {
            let value = kind.read(&mut reader)?;
            match value {
                Value::String(text) if name == "json_data" => {
                    let object: Map<String, Value> = serde_json::from_str(&text).unwrap_or_default();
                    values.extend(object.into_iter().filter(|(name, _)| is_about_exposure(name)));
                }
                value if is_about_exposure(name) => {
                    values.insert(name.clone(), value);
                }
                _ => {}
            }
        }
        Ok((!values.is_empty()).then_some(Exposure { stamp, values }))
    }
}

fn is_about_exposure(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.contains("exposure") || name.contains("gain")
}

impl Primitive {
    fn from_name(kind: &str) -> Option<Self> {
        Some(match kind {
            "bool" | "byte" | "char" | "uint8" => Self::Unsigned(1),
            "uint16" => Self::Unsigned(2),
            "uint32" => Self::Unsigned(4),
            "uint64" => Self::Unsigned(8),
            "int8" => Self::Signed(1),
            "int16" => Self::Signed(2),
            "int32" => Self::Signed(4),
            "int64" => Self::Signed(8),
            "float32" => Self::Float(4),
            "float64" => Self::Float(8),
            "string" => Self::Text,
            _ => return None,
        })
    }

    fn read(self, reader: &mut FieldReader<'_>) -> Result<Value, String> {
        Ok(match self {
            Self::Unsigned(1) => json!(reader.u8()?),
            Self::Unsigned(2) => json!(reader.u16()?),
            Self::Unsigned(4) => json!(reader.u32()?),
            Self::Unsigned(_) => json!(reader.u64()?),
            Self::Signed(1) => json!(reader.u8()?.cast_signed()),
            Self::Signed(2) => json!(reader.u16()?.cast_signed()),
            Self::Signed(4) => json!(reader.u32()?.cast_signed()),
            Self::Signed(_) => json!(reader.u64()?.cast_signed()),
            // Through the shortest decimal, so that 2.1 does not become 2.0999999046325684.
            Self::Float(4) => reader.f32()?.to_string().parse::<f64>().map_or(Value::Null, |number| json!(number)),
            Self::Float(_) => json!(reader.f64()?),
            Self::Text => json!(reader.text()?),
        })
    }
}

/// Serialization of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Cdr,
    Ros1,
    Protobuf,
    Json,
}

impl Encoding {
    /// Serialization with this name in a channel; `None` if it is not supported.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        match name {
            "cdr" => Some(Self::Cdr),
            "ros1" => Some(Self::Ros1),
            "protobuf" => Some(Self::Protobuf),
            "json" => Some(Self::Json),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: [u8; 17] = [0, 1, 0, 0, 5, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 0];

    #[test]
    fn exposure_fields_are_found_by_definition() {
        let definition =
            b"std_msgs/Header header\nuint64 camera_time # ns\nuint32 exposure_time\nfloat32 gain\n===\nMSG: x";
        let fields = ExposureFields::from_definition(definition, Encoding::Cdr).unwrap();
        // The 8-byte number is aligned to 16 after the CDR header.
        let message =
            [&HEADER[..], &[0; 3], &9_u64.to_le_bytes(), &20_000_u32.to_le_bytes(), &2.1_f32.to_le_bytes()].concat();
        let exposure = fields.parse(&message).unwrap().unwrap();
        assert_eq!(exposure.stamp, 5_000_000_007);
        assert_eq!(Value::Object(exposure.values), json!({"exposure_time": 20_000, "gain": 2.1}));
        assert!(fields.parse(&message[..30]).is_err());
    }

    #[test]
    fn json_data_is_read() {
        let definition = b"std_msgs/Header header\nstring json_data";
        let fields = ExposureFields::from_definition(definition, Encoding::Cdr).unwrap();
        let text = b"{\"actual_exposure\":156,\"temperature\":40}\0";
        let message = [&HEADER[..], &[0; 3], &(text.len() as u32).to_le_bytes(), &text[..]].concat();
        let exposure = fields.parse(&message).unwrap().unwrap();
        assert_eq!(Value::Object(exposure.values), json!({"actual_exposure": 156}));
    }

    #[test]
    fn other_messages_have_no_exposure() {
        for definition in
            ["float32 gain", "std_msgs/Header header\nfloat32 speed", "std_msgs/Header header\nCovariance gain"]
        {
            let fields = ExposureFields::from_definition(definition.as_bytes(), Encoding::Cdr);
            assert!(fields.is_none(), "{definition}");
        }
    }
}
