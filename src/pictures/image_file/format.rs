//! Detection of the format of an image file from its first bytes: [`FileFormat`].

use image::ImageFormat;

/// A supported image format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    /// PNG; of an animation, the first frame.
    Png,
    /// JPEG.
    Jpeg,
    /// WebP; of an animation, the first frame.
    WebP,
    /// TIFF; of several pages, the first.
    Tiff,
    /// Windows bitmap.
    Bmp,
    /// OpenEXR, whose samples are linear light.
    OpenExr,
}

/// Names of the supported formats, for messages.
pub const SUPPORTED_FORMATS: &str = "PNG, JPEG, WebP, TIFF, BMP or OpenEXR";

/// Remedy for images in unsupported formats.
const CONVERT: &str = "convert it to PNG, TIFF or JPEG first";
const DEVELOP: &str = "develop it to a 16-bit TIFF or PNG first";

/// Known unsupported formats: offset of the signature, the signature, the name, and the remedy.
const UNSUPPORTED: [(usize, &[u8], &str, &str); 23] = [
    (4, b"ftypavif", "an AVIF image", CONVERT),
    (4, b"ftypavis", "an AVIF image sequence", CONVERT),
    (4, b"ftypheic", HEIC, CONVERT),
    (4, b"ftypheix", HEIC, CONVERT),
    (4, b"ftypheim", HEIC, CONVERT),
    (4, b"ftypheis", HEIC, CONVERT),
    (4, b"ftyphevc", HEIC, CONVERT),
    (4, b"ftyphevx", HEIC, CONVERT),
    (4, b"ftypmif1", "a HEIF image (HEIC or AVIF)", CONVERT),
    (4, b"ftypmsf1", "a HEIF image sequence (HEIC or AVIF)", CONVERT),
    (4, b"ftypcrx ", "a camera's RAW file (CR3)", DEVELOP),
    (4, b"JXL \r\n", "a JPEG XL image", CONVERT),
    (0, b"\xFF\x0A", "a JPEG XL image", CONVERT),
    (4, b"jP  \r\n", "a JPEG 2000 image", CONVERT),
    (0, b"\xFF\x4F\xFF\x51", "a JPEG 2000 image", CONVERT),
    (0, b"GIF8", "a GIF image", CONVERT),
    (0, b"8BPS", "a Photoshop file", CONVERT),
    (8, b"CR\x02", "a camera's RAW file (CR2)", DEVELOP),
    (0, b"IIRO", "a camera's RAW file (ORF)", DEVELOP),
    (0, b"IIU\0", "a camera's RAW file (RW2)", DEVELOP),
    (0, b"FUJIFILMCCD-RAW", "a camera's RAW file (RAF)", DEVELOP),
    (0, b"#?RADIANCE", "a Radiance HDR image", CONVERT),
    (0, b"#?RGBE", "a Radiance HDR image", CONVERT),
];

const HEIC: &str = "a HEIC image";

impl FileFormat {
    /// The format of a file with these bytes.
    ///
    /// # Errors
    /// If the format is not supported. The error names it, if known, and the remedy.
    pub fn detect(file: &[u8]) -> Result<Self, String> {
        if let Some((.., name, remedy)) =
            UNSUPPORTED.iter().find(|(offset, signature, ..)| has_signature(file, *offset, signature))
        {
            return Err(format!("{name}, which is not read; {remedy}"));
        }
        let signatures: [(&[u8], Self); 8] = [
            (super::png_chunks::SIGNATURE, Self::Png),
            (b"\xFF\xD8\xFF", Self::Jpeg),
            (super::exr_layers::SIGNATURE, Self::OpenExr),
            (b"II*\0", Self::Tiff),
            (b"MM\0*", Self::Tiff),
            (b"II+\0", Self::Tiff),
            (b"MM\0+", Self::Tiff),
            (b"BM", Self::Bmp),
        ];
        if file.is_empty() {
            return Err("the file is empty (0 bytes)".to_owned());
        }
        if has_signature(file, 0, b"RIFF") && has_signature(file, 8, b"WEBP") {
            return Ok(Self::WebP);
        }
        signatures
            .into_iter()
            .find(|(signature, _)| file.starts_with(signature))
            .map(|(_, format)| format)
            .ok_or_else(|| format!("not an image: {SUPPORTED_FORMATS} expected"))
    }

    /// The decoder in the crate `image`; `None` for OpenEXR, which has its own decoder.
    pub(super) fn decoder(self) -> Option<ImageFormat> {
        match self {
            Self::Png => Some(ImageFormat::Png),
            Self::Jpeg => Some(ImageFormat::Jpeg),
            Self::WebP => Some(ImageFormat::WebP),
            Self::Tiff => Some(ImageFormat::Tiff),
            Self::Bmp => Some(ImageFormat::Bmp),
            Self::OpenExr => None,
        }
    }

    /// The name of the format, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::WebP => "WebP",
            Self::Tiff => "TIFF",
            Self::Bmp => "BMP",
            Self::OpenExr => "OpenEXR",
        }
    }

    /// The usual file name extension.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpg",
            Self::WebP => "webp",
            Self::Tiff => "tif",
            Self::Bmp => "bmp",
            Self::OpenExr => "exr",
        }
    }
}

fn has_signature(file: &[u8], offset: usize, signature: &[u8]) -> bool {
    file.get(offset..).is_some_and(|rest| rest.starts_with(signature))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_first_bytes() {
        assert_eq!(FileFormat::detect(b"\xFF\xD8\xFF\xE0"), Ok(FileFormat::Jpeg));
        assert_eq!(FileFormat::detect(b"RIFF\x10\0\0\0WEBPVP8 "), Ok(FileFormat::WebP));
        assert_eq!(FileFormat::detect(b"MM\0*\0\0\0\x08"), Ok(FileFormat::Tiff));
        assert_eq!(FileFormat::detect(b"BM\x36\0\0\0"), Ok(FileFormat::Bmp));
        for (file, expected) in [
            (&b"\0\0\0\x18ftypheic\0\0\0\0"[..], "HEIC image, which is not read; convert"),
            (b"\0\0\0\x1cftypavif\0\0\0\0", "AVIF image, which is not read; convert"),
            (b"\0\0\0\x18ftypmif1", "HEIC or AVIF"),
            (b"II*\0\x10\0\0\0CR\x02\0", "RAW file (CR2), which is not read; develop"),
            (b"GIF89a", "GIF"),
            (b"RIFF\x10\0\0\0WAVE", "not an image: PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected"),
            (b"", "the file is empty"),
            (b"ab", "not an image"),
        ] {
            let problem = FileFormat::detect(file).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }
}
