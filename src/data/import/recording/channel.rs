//! Topic of a recording with the type of its messages: [`Channel`].

use std::iter::successors;

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
pub(crate) fn camera_name(topic: &str) -> &str {
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
pub(crate) fn intrinsics_names(topic: &str) -> Vec<&str> {
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
pub(crate) fn camera_of_info(topic: &str) -> &str {
    let camera = camera_name(topic);
    camera.strip_suffix("/info").unwrap_or(camera)
}

fn parent(topic: &str) -> &str {
    &topic[..parent_length(topic)]
}

fn parent_length(topic: &str) -> usize {
    topic.rfind('/').unwrap_or(0)
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
}
