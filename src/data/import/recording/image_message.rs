//! Message with an image: [`ImageMessage`].

use std::borrow::Cow;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use super::Nanoseconds;
use super::encoding::Encoding;
use super::fields::FieldReader;
use super::protobuf::fields;
use crate::pictures::raw_image::RawImage;
use crate::types::text::excerpt;

/// Image of a message with its metadata.
#[derive(Debug)]
pub(crate) struct ImageMessage<'a> {
    /// Time of the image; `None` if the message has 0.
    pub(crate) stamp: Option<Nanoseconds>,
    /// Name of the coordinate frame of the camera.
    pub(crate) frame_id: String,
    pub(crate) image: MessageImage<'a>,
}

/// Image data of a message.
#[derive(Debug)]
pub(crate) enum MessageImage<'a> {
    /// Rows of samples.
    Raw(RawImage<'a>),
    /// A JPEG or PNG file.
    File {
        /// Format given in the message.
        format: String,
        bytes: Cow<'a, [u8]>,
    },
}

impl MessageImage<'_> {
    /// True for an image without pixels or bytes, as drivers send it while they start.
    fn is_empty(&self) -> bool {
        match self {
            Self::Raw(image) => image.width == 0 || image.height == 0 || image.data.is_empty(),
            Self::File { bytes, .. } => bytes.is_empty(),
        }
    }
}

/// Maximum length of a message without an image, in bytes (chosen): a header, names, and fields of base64 or protobuf.
const MAX_EMPTY_BYTES: usize = 4096;

/// True if the image of a message has no pixels.
pub(crate) fn is_without_image(schema: &str, encoding: Encoding, bytes: &[u8]) -> bool {
    bytes.len() <= MAX_EMPTY_BYTES
        && ImageMessage::parse(schema, encoding, bytes).is_ok_and(|message| message.image.is_empty())
}

/// True if a message has an image of an encoding or format that is never read, such as depth. All images of its topic
/// are then alike.
pub(super) fn has_unread_kind(schema: &str, encoding: Encoding, bytes: &[u8]) -> bool {
    let Ok(message) = ImageMessage::parse_any(schema, encoding, bytes) else {
        return false;
    };
    !message.image.is_empty()
        && match &message.image {
            MessageImage::Raw(image) => !image.encoding.is_empty() && !image.has_known_encoding(),
            MessageImage::File { format, .. } => check_format(format).is_err(),
        }
}

impl<'a> ImageMessage<'a> {
    /// Parses a message of a type with images ([`ChannelContent::Image`](super::ChannelContent)).
    ///
    /// # Errors
    /// If it is not a message of this type, or has depth or a color mosaic in an image file.
    pub(crate) fn parse(schema: &str, encoding: Encoding, bytes: &'a [u8]) -> Result<Self, String> {
        let message = Self::parse_any(schema, encoding, bytes)?;
        if let MessageImage::File { format, .. } = &message.image {
            check_format(format)?;
        }
        Ok(message)
    }

    /// Parses a message, also one of a format that is not read.
    fn parse_any(schema: &str, encoding: Encoding, bytes: &'a [u8]) -> Result<Self, String> {
        match encoding {
            Encoding::Cdr => Self::from_fields(schema, encoding, FieldReader::cdr(bytes)?),
            Encoding::Ros1 => Self::from_fields(schema, encoding, FieldReader::unaligned(bytes)),
            Encoding::Protobuf => Self::from_protobuf(schema, bytes),
            Encoding::Json => Self::from_json(schema, bytes),
        }
    }

    fn from_fields(schema: &str, encoding: Encoding, mut reader: FieldReader<'a>) -> Result<Self, String> {
        skip_sequence_number(schema, encoding, &mut reader)?;
        let (stamp, frame_id) = (reader.time()?, reader.text()?);
        let image = match schema {
            "sensor_msgs/Image" => {
                let [height, width] = [reader.u32()?, reader.u32()?].map(|side| side as usize);
                MessageImage::Raw(RawImage {
                    width,
                    height,
                    encoding: reader.text()?,
                    is_big_endian: reader.u8()? != 0,
                    step: reader.u32()? as usize,
                    data: reader.bytes()?.into(),
                })
            }
            "sensor_msgs/CompressedImage" => {
                MessageImage::File { format: reader.text()?, bytes: reader.bytes()?.into() }
            }
            _ if schema.ends_with("RawImage") => {
                let [width, height] = [reader.u32()?, reader.u32()?].map(|side| side as usize);
                MessageImage::Raw(RawImage {
                    width,
                    height,
                    encoding: reader.text()?,
                    is_big_endian: false,
                    step: reader.u32()? as usize,
                    data: reader.bytes()?.into(),
                })
            }
            _ => {
                let bytes = reader.bytes()?.into();
                let format = reader.text()?;
                MessageImage::File { format, bytes }
            }
        };
        Ok(Self { stamp: (stamp != 0).then_some(stamp), frame_id, image })
    }

    /// Parses a protobuf message, with the field numbers of `foxglove/RawImage.proto` and
    /// `foxglove/CompressedImage.proto`.
    fn from_protobuf(schema: &str, bytes: &'a [u8]) -> Result<Self, String> {
        let is_raw = schema.ends_with("RawImage");
        let (mut stamp, mut frame_id, mut format) = (0, String::new(), String::new());
        let mut data: &[u8] = &[];
        let [mut width, mut height, mut step] = [0_usize; 3];
        for field in fields(bytes) {
            let (number, value) = field?;
            let size = || usize::try_from(value.number()).unwrap_or(usize::MAX);
            match (is_raw, number) {
                (_, 1) => stamp = value.time()?,
                (true, 2) => width = size(),
                (true, 3) => height = size(),
                (true, 4) | (false, 3) => format = value.text(),
                (true, 5) => step = size(),
                (true, 6) | (false, 2) => data = value.bytes(),
                (true, 7) | (false, 4) => frame_id = value.text(),
                _ => {}
            }
        }
        let image = if is_raw {
            MessageImage::Raw(RawImage {
                width,
                height,
                step,
                encoding: format,
                is_big_endian: false,
                data: data.into(),
            })
        } else {
            MessageImage::File { format, bytes: data.into() }
        };
        Ok(Self { stamp: (stamp != 0).then_some(stamp), frame_id, image })
    }

    fn from_json(schema: &str, bytes: &[u8]) -> Result<Self, String> {
        let message: JsonImage<'_> = serde_json::from_slice(bytes).map_err(|e| format!("not a {schema}: {e}"))?;
        let data = match message.data {
            JsonData::Text(text) => STANDARD.decode(&*text).map_err(|e| format!("data in base64 expected: {e}"))?,
            JsonData::Numbers(numbers) => numbers,
        };
        let image = if is_raw(schema) {
            MessageImage::Raw(RawImage {
                width: message.width,
                height: message.height,
                step: message.step,
                encoding: message.encoding,
                is_big_endian: message.is_bigendian != 0,
                data: data.into(),
            })
        } else {
            MessageImage::File { format: message.format, bytes: data.into() }
        };
        let JsonHeader { stamp: header_stamp, frame_id: header_frame_id } = message.header;
        let JsonTime { sec, nsec } = message.timestamp.unwrap_or(header_stamp);
        let stamp = sec.saturating_mul(1_000_000_000).saturating_add(nsec);
        Ok(Self { stamp: (stamp != 0).then_some(stamp), frame_id: message.frame_id.unwrap_or(header_frame_id), image })
    }
}

/// True for types with rows of samples, false for those with image files.
fn is_raw(schema: &str) -> bool {
    schema.ends_with("RawImage") || schema == "sensor_msgs/Image"
}

/// Refuses a format without colour samples: `compressed_image_transport` writes `bayer_rggb8; png compressed ` for a
/// mosaic that it did not convert, and `16UC1; png compressed ` for depth.
fn check_format(format: &str) -> Result<(), String> {
    let (source, target) = format.split_once(';').unwrap_or((format, ""));
    let kind = match source.trim() {
        _ if format.contains("compressedDepth") => "depth",
        source if source.starts_with("16UC1") || source.starts_with("32FC1") => "depth",
        source if source.starts_with("bayer") && !target.contains("bgr") && !target.contains("rgb") => {
            "a mosaic in an image file; take its topic that is not compressed"
        }
        _ => return Ok(()),
    };
    Err(format!("format {:?} is {kind}, not an image", excerpt(format, 60)))
}

/// A message with an image in JSON. Messages of Foxglove have `timestamp` and `frame_id`, those of ROS a `header`.
#[derive(Deserialize)]
struct JsonImage<'a> {
    timestamp: Option<JsonTime>,
    frame_id: Option<String>,
    #[serde(default)]
    header: JsonHeader,
    #[serde(default)]
    width: usize,
    #[serde(default)]
    height: usize,
    #[serde(default)]
    step: usize,
    #[serde(default)]
    encoding: String,
    #[serde(default)]
    format: String,
    #[serde(default)]
    is_bigendian: u8,
    #[serde(borrow)]
    data: JsonData<'a>,
}

/// Bytes in JSON: in base64, or as a list of numbers.
#[derive(Deserialize)]
#[serde(untagged)]
enum JsonData<'a> {
    Text(#[serde(borrow)] Cow<'a, str>),
    Numbers(Vec<u8>),
}

#[derive(Default, Deserialize)]
struct JsonHeader {
    #[serde(default)]
    stamp: JsonTime,
    #[serde(default)]
    frame_id: String,
}

#[derive(Default, Deserialize)]
struct JsonTime {
    #[serde(alias = "secs")]
    sec: i64,
    #[serde(alias = "nanosec", alias = "nsecs")]
    nsec: i64,
}

/// Skips the sequence number at the start of a ROS 1 header. ROS 2 dropped it, and messages of Foxglove have no header.
pub(super) fn skip_sequence_number(
    schema: &str,
    encoding: Encoding,
    reader: &mut FieldReader<'_>,
) -> Result<(), String> {
    if encoding == Encoding::Ros1 && !schema.starts_with("foxglove") {
        reader.u32()?;
    }
    Ok(())
}

/// Time stamp at the start of a message; `None` if the whole message must be read.
pub(crate) fn stamp(schema: &str, encoding: Encoding, start: &[u8]) -> Option<Nanoseconds> {
    match encoding {
        Encoding::Cdr => FieldReader::cdr(start).ok()?.time().ok(),
        Encoding::Ros1 => {
            let mut reader = FieldReader::unaligned(start);
            skip_sequence_number(schema, encoding, &mut reader).ok()?;
            reader.time().ok()
        }
        Encoding::Protobuf => match fields(start).next()?.ok()? {
            (1, value) => value.time().ok(),
            _ => None,
        },
        Encoding::Json => None,
    }
}
