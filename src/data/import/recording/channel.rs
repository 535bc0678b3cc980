//! Topic of a recording with the type of its messages: [`Channel`].
//!
//! Image data of messages that are no JPEG, PNG or WebP file: [`ForeignData`].

use std::iter::successors;

use super::exposure::{Encoding, ExposureFields};
use darkqa_base::types::text::excerpt;

/// Channel of a recording.
#[derive(Debug, Clone)]
pub struct Channel {
    pub topic: String,
    /// Name of the message type without `msg/`, such as `sensor_msgs/Image` or `foxglove.RawImage`.
    pub schema: String,
    pub content: ChannelContent,
}

/// Kind of a channel's messages.
#[derive(Debug, Clone)]
pub enum ChannelContent {
    /// Images.
    Image(Encoding),
    /// Intrinsics of a camera.
    Camera(Encoding),
    /// Exposure times or gains of a camera.
    Exposure(ExposureFields),
    /// Video, with the frames of a stream in its messages.
    Video(Encoding),
    /// Images that cannot be read, with the reason.
    Unsupported(String),
    /// Anything else.
    Other,
}

impl Channel {
    /// The channel of a topic. `definition` is the text of the message definition.
    pub(super) fn new(topic: String, schema: &str, serialization: &str, definition: &[u8]) -> Self {
        let schema = schema.replace("/msg/", "/").replace("::msg::", "/").replace("::", ".");
        let encoding = Encoding::from_name(serialization);
        let content = match (&*schema, encoding) {
            (
                "sensor_msgs/Image"
                | "sensor_msgs/CompressedImage"
                | "foxglove.RawImage"
                | "foxglove.CompressedImage"
                | "foxglove_msgs/RawImage"
                | "foxglove_msgs/CompressedImage",
                Some(encoding),
            ) => ChannelContent::Image(encoding),
            (
                "sensor_msgs/CameraInfo" | "foxglove.CameraCalibration" | "foxglove_msgs/CameraCalibration",
                Some(encoding),
            ) => ChannelContent::Camera(encoding),
            (schema, None) if schema.ends_with("Image") => ChannelContent::Unsupported(format!(
                "serialization {serialization:?}; cdr, ros1, protobuf or json expected"
            )),
            (schema, encoding) if schema.ends_with("CompressedVideo") || schema.ends_with("FFMPEGPacket") => {
                match encoding {
                    Some(encoding) => ChannelContent::Video(encoding),
                    None => ChannelContent::Unsupported(format!(
                        "video in serialization {serialization:?}; record images as JPEG or PNG"
                    )),
                }
            }
            (_, Some(encoding)) => match ExposureFields::from_definition(definition, encoding) {
                Some(fields) => ChannelContent::Exposure(fields),
                None => ChannelContent::Other,
            },
            _ => ChannelContent::Other,
        };
        Self { topic, schema, content }
    }
}

/// Common prefix of the topics of one camera: `/front` for `/front/image_raw`, `/front/image_raw/compressed` and
/// `/front/camera_info`.
pub fn camera_name(topic: &str) -> &str {
    let transports = ["/compressed", "/compressedDepth", "/theora", "/zstd", "/raw"];
    let base = transports
        .iter()
        .find_map(|transport| topic.strip_suffix(transport))
        .filter(|base| base[parent_length(base)..].contains("image"))
        .unwrap_or(topic);
    &base[..parent_length(base)]
}

/// Names under which the intrinsics of an image topic may be found: first its camera, then each folder from the topic's
/// own up to the one beside `image` or `image_…`, such as `…/Color_0` for RealSense's
/// `…/Color_0/image/data/compressed`.
pub fn intrinsics_names(topic: &str) -> Vec<&str> {
    let folders = || successors(Some(parent(topic)), |folder| (!folder.is_empty()).then(|| parent(folder)));
    let is_image = |folder: &str| {
        let name = folder[parent_length(folder)..].trim_start_matches('/');
        name == "image" || name.starts_with("image_")
    };
    // A topic outside such a folder belongs to no camera above its own.
    let count = folders().position(is_image).map_or(0, |image| image + 2);
    let mut names = vec![camera_name(topic)];
    for folder in folders().take(count) {
        if !names.contains(&folder) {
            names.push(folder);
        }
    }
    names
}

/// Camera of a topic with intrinsics: its folder, without `info`, which RealSense's bags of ROS 1 add.
pub fn camera_of_info(topic: &str) -> &str {
    let camera = camera_name(topic);
    camera.strip_suffix("/info").unwrap_or(camera)
}

fn parent(topic: &str) -> &str {
    &topic[..parent_length(topic)]
}

fn parent_length(topic: &str) -> usize {
    topic.rfind('/').unwrap_or(0)
}

/// Maximum number of characters of a format in a message.
const MAX_FORMAT: usize = 60;

/// Video codecs by parts of their names in formats, in lower case and without punctuation.
const CODECS: [(&str, &str); 13] = [
    ("264", "H.264"),
    ("avc", "H.264"),
    ("265", "H.265"),
    ("hevc", "H.265"),
    ("hvc1", "H.265"),
    ("hev1", "H.265"),
    ("av1", "AV1"),
    ("av01", "AV1"),
    ("vp8", "VP8"),
    ("vp9", "VP9"),
    ("mpeg4", "MPEG-4"),
    ("mp4v", "MPEG-4"),
    ("theora", "Theora"),
];

/// Kind of image data that is not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForeignData {
    Empty,
    /// Frames of a video, with the name of the codec.
    Video(&'static str),
    /// A file or stream of another kind.
    Other(&'static str),
    Unknown,
}

impl ForeignData {
    /// Detects the kind by the first bytes, or else by the format that the message states. `ending` is the file ending
    /// of an image format that is known but not read; empty if there is none.
    pub fn detect(format: &str, bytes: &[u8], ending: &'static str) -> Self {
        if bytes.is_empty() {
            return Self::Empty;
        }
        if !ending.is_empty() {
            return Self::Other(ending);
        }
        let stated = stated_codec(format);
        match bytes {
            [0, 0, 0, 1, unit, ..] | [0, 0, 1, unit, ..] => Self::Video(stated.unwrap_or_else(|| codec_of_unit(*unit))),
            [_, _, _, _, b'f', b't', b'y', b'p', brand @ ..] => match brand {
                [b'a', b'v', b'i', ..] => Self::Other("AVIF"),
                [b'h', b'e', ..] | [b'm', b'i', b'f', ..] => Self::Other("HEIF"),
                _ => stated.map_or(Self::Unknown, Self::Video),
            },
            [0x28, 0xb5, 0x2f, 0xfd, ..] => {
                Self::Other("raw samples compressed with zstd, as RealSense's recorder writes YUYV and Y16")
            }
            [0xff, 0x0a, ..] | [0, 0, 0, 12, b'J', b'X', b'L', b' ', ..] => Self::Other("JPEG XL"),
            _ => stated.map_or(Self::Unknown, Self::Video),
        }
    }

    /// Description for messages, with the format that the message states.
    pub fn words(self, format: &str) -> String {
        let format = match format.trim() {
            "" => "no format stated".to_owned(),
            format => format!("format {:?}", excerpt(format, MAX_FORMAT)),
        };
        match self {
            Self::Empty => format!("an empty image ({format})"),
            Self::Video(codec) => format!("{codec} video ({format}), not images"),
            Self::Other(kind) => format!("{kind} ({format}); JPEG, PNG or WebP expected"),
            Self::Unknown => {
                format!("data of an unknown kind ({format}); JPEG, PNG or WebP expected")
            }
        }
    }
}

/// The video codec that a format names, such as `h264` or `hevc; yuv420p`.
fn stated_codec(format: &str) -> Option<&'static str> {
    let format = format.to_ascii_lowercase().replace(['.', '-', '_'], "");
    CODECS.iter().find(|(name, _)| format.contains(name)).map(|(_, codec)| *codec)
}

/// The codec of a stream in Annex B format, by the type of its first unit: parameter sets or a delimiter.
fn codec_of_unit(unit: u8) -> &'static str {
    match (unit & 0x1f, unit >> 1 & 0x3f, unit & 0x81) {
        // Layer 0 and temporal layer 1, as those of H.265 have it, is no valid type in H.264.
        (_, 32..=35, 0) => "H.265",
        (7..=9, ..) => "H.264",
        _ => "H.264 or H.265",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_a_camera_have_one_name() {
        for topic in
            ["/a/front/image_raw", "/a/front/image_raw/compressed", "/a/front/camera_info", "/a/front/compressed"]
        {
            assert_eq!(camera_name(topic), "/a/front", "{topic}");
        }
        assert_eq!(camera_name("/image"), "");
        assert_eq!(camera_name("image"), "");
    }

    #[test]
    fn intrinsics_are_looked_for_beside_the_image() {
        let names = intrinsics_names;
        let colour = "/device_0/sensor_1/Color_0";
        assert_eq!(
            names("/device_0/sensor_1/Color_0/image/data/compressed"),
            ["/device_0/sensor_1/Color_0/image/data", "/device_0/sensor_1/Color_0/image", colour]
        );
        assert!(names("/device_0/sensor_1/Color_0/image/data").contains(&colour));
        assert_eq!(camera_of_info("/device_0/sensor_1/Color_0/info/camera_info"), colour);
        assert_eq!(names("/front/image_raw/compressed"), ["/front", "/front/image_raw"]);
        // Controls: no camera above the image's own.
        assert_eq!(names("/stereo/left/image_raw"), ["/stereo/left"]);
        assert_eq!(names("/images/front/raw"), ["/images/front"]);
        assert_eq!(names("/image"), [""]);
        assert_eq!(names("/image/compressed"), ["", "/image"]);
        assert_eq!(names("image/compressed"), ["", "image"]);
        assert_eq!(camera_of_info("/front/camera_info"), "/front");
    }

    fn content(schema: &str, serialization: &str) -> ChannelContent {
        Channel::new("/t".to_owned(), schema, serialization, b"").content
    }

    #[test]
    fn all_spellings_of_type_names_are_known() {
        for schema in ["sensor_msgs/msg/Image", "sensor_msgs/Image", "sensor_msgs::msg::Image", "foxglove::RawImage"] {
            assert!(matches!(content(schema, "cdr"), ChannelContent::Image(Encoding::Cdr)), "{schema}");
        }
        assert!(matches!(content("foxglove.RawImage", "flatbuffer"), ChannelContent::Unsupported(_)));
        assert!(matches!(content("foxglove.CompressedVideo", "protobuf"), ChannelContent::Video(Encoding::Protobuf)));
        assert!(matches!(content("foxglove.CompressedVideo", "flatbuffer"), ChannelContent::Unsupported(_)));
        assert!(matches!(content("std_msgs/msg/String", "cdr"), ChannelContent::Other));
    }

    #[test]
    fn video_is_named_by_format_or_bytes() {
        for (format, bytes, codec) in [
            ("h264", &b"x"[..], "H.264"),
            ("H.265", b"x", "H.265"),
            ("video/hevc; yuv420p", b"x", "H.265"),
            ("libx264", b"\0\0\0\x01\x67", "H.264"),
            ("", b"\0\0\0\x01\x67\x42", "H.264"),
            ("", b"\0\0\x01\x09\xf0", "H.264"),
            ("", b"\0\0\0\x01\x40\x01", "H.265"),
            ("", b"\0\0\0\x01\x46\x01", "H.265"),
            ("jpeg", b"\0\0\0\x01\x41", "H.264 or H.265"),
        ] {
            let found = ForeignData::detect(format, bytes, "");
            assert_eq!(found, ForeignData::Video(codec), "{format} {bytes:?}");
        }
    }

    #[test]
    fn other_data_are_no_video() {
        for (format, bytes, ending, expected) in [
            ("h264", &b""[..], "", "an empty image (format \"h264\")"),
            ("", b"", "", "an empty image (no format stated)"),
            ("avif", b"\0\0\0 ftypavif", "", "AVIF (format \"avif\"); JPEG, PNG or WebP expected"),
            ("", b"\0\0\0 ftypheic", "", "HEIF (no format stated); JPEG, PNG or WebP expected"),
            ("tiff", b"II*\0", "tif", "tif (format \"tiff\"); JPEG, PNG or WebP expected"),
            ("jpeg", b"xyz", "", "data of an unknown kind (format \"jpeg\"); JPEG, PNG or WebP expected"),
        ] {
            let found = ForeignData::detect(format, bytes, ending);
            assert!(!matches!(found, ForeignData::Video(_)), "{format}");
            assert_eq!(found.words(format), expected);
        }
        let zstd = ForeignData::detect("YUYV; zstd; 16", &[0x28, 0xb5, 0x2f, 0xfd, 0], "");
        assert!(zstd.words("YUYV; zstd; 16").contains("RealSense"), "{zstd:?}");
    }
}
