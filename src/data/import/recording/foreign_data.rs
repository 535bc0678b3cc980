//! Image data of messages that are no JPEG, PNG or WebP file: [`ForeignData`].

use crate::types::text::excerpt;

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
pub(crate) enum ForeignData {
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
    pub(crate) fn detect(format: &str, bytes: &[u8], ending: &'static str) -> Self {
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
    pub(crate) fn words(self, format: &str) -> String {
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
