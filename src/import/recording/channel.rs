//! A topic of a recording with the form of its messages: [`Channel`].

use super::encoding::Encoding;
use super::exposure::ExposureFields;

/// A topic as one channel of a recording has it.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    /// Name of the message type, as `sensor_msgs/Image` or `foxglove.RawImage`: without `msg/`.
    pub(crate) schema: String,
    pub(crate) content: Content,
}

/// The use of a channel's messages.
#[derive(Debug, Clone)]
pub(crate) enum Content {
    /// Images.
    Image(Encoding),
    /// Intrinsics of a camera.
    Camera(Encoding),
    /// Exposure times or gains of a camera.
    Exposure(ExposureFields),
    /// Images that are not read, and the reason.
    Unread(String),
    /// Anything else.
    Other,
}

impl Channel {
    /// The channel of a topic. `definition` is the text of the schema.
    pub(super) fn new(topic: String, schema: &str, serialization: &str, definition: &[u8]) -> Self {
        let schema = schema
            .replace("/msg/", "/")
            .replace("::msg::", "/")
            .replace("::", ".");
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
            ) => Content::Image(encoding),
            (
                "sensor_msgs/CameraInfo"
                | "foxglove.CameraCalibration"
                | "foxglove_msgs/CameraCalibration",
                Some(encoding),
            ) => Content::Camera(encoding),
            (schema, None) if schema.ends_with("Image") => Content::Unread(format!(
                "serialization {serialization:?}; cdr, ros1, protobuf or json expected"
            )),
            (schema, _)
                if schema.ends_with("CompressedVideo") || schema.ends_with("FFMPEGPacket") =>
            {
                Content::Unread("video; decode it into images first".to_owned())
            }
            (_, Some(encoding)) => match ExposureFields::from_definition(definition, encoding) {
                Some(fields) => Content::Exposure(fields),
                None => Content::Other,
            },
            _ => Content::Other,
        };
        Self {
            topic,
            schema,
            content,
        }
    }
}

/// The name under which the topics of one camera are: `/front` of `/front/image_raw`, `/front/image_raw/compressed` and
/// `/front/camera_info`.
pub(crate) fn camera_of(topic: &str) -> &str {
    let parent = |topic: &str| topic.rfind('/').unwrap_or(0);
    let transports = [
        "/compressed",
        "/compressedDepth",
        "/theora",
        "/zstd",
        "/raw",
    ];
    let base = transports
        .iter()
        .find_map(|transport| topic.strip_suffix(transport))
        .filter(|base| base[parent(base)..].contains("image"))
        .unwrap_or(topic);
    &base[..parent(base)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_a_camera_have_one_name() {
        for topic in [
            "/a/front/image_raw",
            "/a/front/image_raw/compressed",
            "/a/front/camera_info",
            "/a/front/compressed",
        ] {
            assert_eq!(camera_of(topic), "/a/front", "{topic}");
        }
        assert_eq!(camera_of("/image"), "");
        assert_eq!(camera_of("image"), "");
    }

    #[test]
    fn names_of_types_differ_by_their_writers() {
        let content = |schema: &str, serialization: &str| {
            Channel::new("/t".to_owned(), schema, serialization, b"").content
        };
        for schema in [
            "sensor_msgs/msg/Image",
            "sensor_msgs/Image",
            "sensor_msgs::msg::Image",
            "foxglove::RawImage",
        ] {
            assert!(
                matches!(content(schema, "cdr"), Content::Image(Encoding::Cdr)),
                "{schema}"
            );
        }
        assert!(matches!(
            content("foxglove.RawImage", "flatbuffer"),
            Content::Unread(_)
        ));
        assert!(matches!(
            content("foxglove.CompressedVideo", "protobuf"),
            Content::Unread(_)
        ));
        assert!(matches!(
            content("std_msgs/msg/String", "cdr"),
            Content::Other
        ));
    }
}
