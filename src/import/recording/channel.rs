//! Topic of a recording with the type of its messages: [`Channel`].

use super::encoding::Encoding;
use super::exposure::ExposureFields;

/// Channel of a recording.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    /// Name of the message type without `msg/`, such as `sensor_msgs/Image` or `foxglove.RawImage`.
    pub(crate) schema: String,
    pub(crate) content: ChannelContent,
}

/// Kind of a channel's messages.
#[derive(Debug, Clone)]
pub(crate) enum ChannelContent {
    /// Images.
    Image(Encoding),
    /// Intrinsics of a camera.
    Camera(Encoding),
    /// Exposure times or gains of a camera.
    Exposure(ExposureFields),
    /// Images that cannot be read, with the reason.
    Unsupported(String),
    /// Anything else.
    Other,
}

impl Channel {
    /// The channel of a topic. `definition` is the text of the message definition.
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
            ) => ChannelContent::Image(encoding),
            (
                "sensor_msgs/CameraInfo"
                | "foxglove.CameraCalibration"
                | "foxglove_msgs/CameraCalibration",
                Some(encoding),
            ) => ChannelContent::Camera(encoding),
            (schema, None) if schema.ends_with("Image") => ChannelContent::Unsupported(format!(
                "serialization {serialization:?}; cdr, ros1, protobuf or json expected"
            )),
            (schema, _)
                if schema.ends_with("CompressedVideo") || schema.ends_with("FFMPEGPacket") =>
            {
                ChannelContent::Unsupported("video; decode it into images first".to_owned())
            }
            (_, Some(encoding)) => match ExposureFields::from_definition(definition, encoding) {
                Some(fields) => ChannelContent::Exposure(fields),
                None => ChannelContent::Other,
            },
            _ => ChannelContent::Other,
        };
        Self {
            topic,
            schema,
            content,
        }
    }
}

/// Common prefix of the topics of one camera: `/front` for `/front/image_raw`, `/front/image_raw/compressed` and `/front/camera_info`.
pub(crate) fn camera_name(topic: &str) -> &str {
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
        .filter(|base| base[parent_length(base)..].contains("image"))
        .unwrap_or(topic);
    &base[..parent_length(base)]
}

fn parent_length(topic: &str) -> usize {
    topic.rfind('/').unwrap_or(0)
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
            assert_eq!(camera_name(topic), "/a/front", "{topic}");
        }
        assert_eq!(camera_name("/image"), "");
        assert_eq!(camera_name("image"), "");
    }

    fn content(schema: &str, serialization: &str) -> ChannelContent {
        Channel::new("/t".to_owned(), schema, serialization, b"").content
    }

    #[test]
    fn all_spellings_of_type_names_are_known() {
        for schema in [
            "sensor_msgs/msg/Image",
            "sensor_msgs/Image",
            "sensor_msgs::msg::Image",
            "foxglove::RawImage",
        ] {
            assert!(
                matches!(content(schema, "cdr"), ChannelContent::Image(Encoding::Cdr)),
                "{schema}"
            );
        }
        assert!(matches!(
            content("foxglove.RawImage", "flatbuffer"),
            ChannelContent::Unsupported(_)
        ));
        assert!(matches!(
            content("foxglove.CompressedVideo", "protobuf"),
            ChannelContent::Unsupported(_)
        ));
        assert!(matches!(
            content("std_msgs/msg/String", "cdr"),
            ChannelContent::Other
        ));
    }
}
