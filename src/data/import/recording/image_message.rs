//! Message with an image: [`ImageMessage`].
//!
//! Parser for camera calibration messages: [`CameraInfo`].

use std::borrow::Cow;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use super::Nanoseconds;
use super::exposure::Encoding;
use super::fields::{FieldReader, fields};
use darkqa_base::types::Intrinsics;
use darkqa_base::types::text::excerpt;
use darkqa_pictures::raw_image::RawImage;

/// Image of a message with its metadata.
#[derive(Debug)]
pub struct ImageMessage<'a> {
    /// Time of the image; `None` if the message has 0.
    pub stamp: Option<Nanoseconds>,
    /// Name of the coordinate frame of the camera.
    pub frame_id: String,
    pub image: MessageImage<'a>,
}

/// Image data of a message.
#[derive(Debug)]
pub enum MessageImage<'a> {
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
pub fn is_without_image(schema: &str, encoding: Encoding, bytes: &[u8]) -> bool {
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
    pub fn parse(schema: &str, encoding: Encoding, bytes: &'a [u8]) -> Result<Self, String> {
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
fn skip_sequence_number(schema: &str, encoding: Encoding, reader: &mut FieldReader<'_>) -> Result<(), String> {
    if encoding == Encoding::Ros1 && !schema.starts_with("foxglove") {
        reader.u32()?;
    }
    Ok(())
}

/// Time stamp at the start of a message; `None` if the whole message must be read.
pub fn stamp(schema: &str, encoding: Encoding, start: &[u8]) -> Option<Nanoseconds> {
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

/// Intrinsics of a camera, for raw and rectified images of one size in pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInfo {
    pub width: usize,
    pub height: usize,
    /// Intrinsics of raw images, from the matrix K; `None` if K is missing or invalid.
    pub raw: Option<Intrinsics>,
    /// Intrinsics of rectified images, from the matrix P; `None` if P is missing or invalid.
    pub rectified: Option<Intrinsics>,
}

impl CameraInfo {
    /// Parses a `sensor_msgs/CameraInfo` or `foxglove.CameraCalibration` message.
    ///
    /// # Errors
    /// If `bytes` is not such a message.
    pub fn parse(schema: &str, encoding: Encoding, bytes: &[u8]) -> Result<Self, String> {
        match encoding {
            Encoding::Cdr => Self::from_fields(schema, encoding, FieldReader::cdr(bytes)?),
            Encoding::Ros1 => Self::from_fields(schema, encoding, FieldReader::unaligned(bytes)),
            Encoding::Protobuf => {
                let (mut size, mut k, mut p) = ([0; 2], Vec::new(), Vec::new());
                for field in fields(bytes) {
                    match field? {
                        (2, value) => size[0] = value.number() as usize,
                        (3, value) => size[1] = value.number() as usize,
                        (6, value) => k.extend(value.doubles()),
                        (8, value) => p.extend(value.doubles()),
                        _ => {}
                    }
                }
                Ok(Self::new(size, &k, &p))
            }
            Encoding::Json => {
                let message: JsonCamera = serde_json::from_slice(bytes).map_err(|e| e.to_string())?;
                Ok(Self::new([message.width, message.height], &message.k, &message.p))
            }
        }
    }

    /// Parses a CDR or ROS 1 message.
    fn from_fields(schema: &str, encoding: Encoding, mut reader: FieldReader<'_>) -> Result<Self, String> {
        skip_sequence_number(schema, encoding, &mut reader)?;
        let _stamp = reader.time()?;
        let _frame_id = reader.text()?;
        let [first, second] = [reader.u32()?, reader.u32()?].map(|side| side as usize);
        // Foxglove stores the width first, ROS the height.
        let size = if schema.starts_with("foxglove") { [first, second] } else { [second, first] };
        let _distortion_model = reader.text()?;
        let _distortion_parameters = reader.doubles()?;
        let (k, _rotation, p) =
            (read_matrix(&mut reader, 9)?, read_matrix(&mut reader, 9)?, read_matrix(&mut reader, 12)?);
        Ok(Self::new(size, &k, &p))
    }

    /// The calibration from the matrices K (3×3) and P (3×4), each in row-major order.
    fn new([width, height]: [usize; 2], k: &[f64], p: &[f64]) -> Self {
        Self { width, height, raw: intrinsics(k, 3), rectified: intrinsics(p, 4) }
    }

    /// Intrinsics for an image of this size: rectified if the topic name contains `rect`, else raw. `None` if they are
    /// unknown or the calibration is for another size.
    pub fn intrinsics_for(&self, topic: &str, size: (usize, usize)) -> Option<Intrinsics> {
        if (self.width, self.height) != size {
            return None;
        }
        if topic.contains("rect") { self.rectified } else { self.raw }
    }
}

fn read_matrix(reader: &mut FieldReader<'_>, count: usize) -> Result<Vec<f64>, String> {
    (0..count).map(|_| reader.f64()).collect::<Result<Vec<f64>, _>>()
}

/// Intrinsics in a row-major matrix with this number of columns; `None` unless all are finite and both focal lengths
/// positive.
fn intrinsics(matrix: &[f64], columns: usize) -> Option<Intrinsics> {
    let [fx, cx, fy, cy] = [0, 2, columns + 1, columns + 2].map(|i| matrix.get(i).copied().unwrap_or_default());
    let is_valid = [fx, cx, fy, cy].iter().all(|number| number.is_finite()) && fx > 0.0 && fy > 0.0;
    is_valid.then_some(Intrinsics { fx, fy, cx, cy })
}

/// A `foxglove.CameraCalibration` message in JSON.
#[derive(Deserialize)]
struct JsonCamera {
    width: usize,
    height: usize,
    #[serde(rename = "K", alias = "k", default)]
    k: Vec<f64>,
    #[serde(rename = "P", alias = "p", default)]
    p: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intrinsics_of(info: &CameraInfo, topic: &str, size: (usize, usize)) -> Option<(f64, f64, f64, f64)> {
        info.intrinsics_for(topic, size).map(|camera| (camera.fx, camera.fy, camera.cx, camera.cy))
    }

    #[test]
    fn rectified_topics_use_matrix_p() {
        let k = [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0];
        let p = [400.0, 0.0, 300.0, 0.0, 0.0, 401.0, 200.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let info = CameraInfo::new([640, 480], &k, &p);
        assert_eq!(intrinsics_of(&info, "/c/image_raw", (640, 480)), Some((500.0, 501.0, 320.0, 240.0)));
        assert_eq!(intrinsics_of(&info, "/c/image_rect", (640, 480)), Some((400.0, 401.0, 300.0, 200.0)));
        assert_eq!(intrinsics_of(&info, "/c/image_raw", (320, 240)), None);
        assert_eq!(CameraInfo::new([640, 480], &[0.0; 9], &[]).raw, None);
    }
}
