//! The format of an image file, from its first bytes: [`FileFormat`].

use image::ImageFormat;

/// A format that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    /// PNG, of its frames the first.
    Png,
    /// JPEG.
    Jpeg,
    /// WebP, of its frames the first.
    WebP,
    /// TIFF, of its pages the first.
    Tiff,
    /// Windows bitmap.
    Bmp,
    /// OpenEXR, linear light.
    OpenExr,
}

/// The names of the formats that are read, for messages.
pub const READ: &str = "PNG, JPEG, WebP, TIFF, BMP or OpenEXR";

/// Remedy for images in unsupported formats.
const CONVERT: &str = "convert it to PNG, TIFF or JPEG first";
const DEVELOP: &str = "develop it to a 16-bit TIFF or PNG first";

/// Formats that are not read: where their mark stands in the file, the mark, the name, and what to do.
const UNREAD: [(usize, &[u8], &str, &str); 23] = [
    (4, b"ftypavif", "an AVIF image", CONVERT),
    (4, b"ftypavis", "an AVIF image sequence", CONVERT),
    (4, b"ftypheic", HEIC, CONVERT),
    (4, b"ftypheix", HEIC, CONVERT),
    (4, b"ftypheim", HEIC, CONVERT),
    (4, b"ftypheis", HEIC, CONVERT),
    (4, b"ftyphevc", HEIC, CONVERT),
    (4, b"ftyphevx", HEIC, CONVERT),
    (4, b"ftypmif1", "a HEIF image (HEIC or AVIF)", CONVERT),
    (
        4,
        b"ftypmsf1",
        "a HEIF image sequence (HEIC or AVIF)",
        CONVERT,
    ),
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
        let has =
            |at: usize, mark: &[u8]| file.get(at..).is_some_and(|rest| rest.starts_with(mark));
        if let Some((.., name, remedy)) = UNREAD.iter().find(|(at, mark, ..)| has(*at, mark)) {
            return Err(format!("{name}, which is not read; {remedy}"));
        }
        let marks: [(&[u8], Self); 8] = [
            (super::png_chunks::SIGNATURE, Self::Png),
            (b"\xFF\xD8\xFF", Self::Jpeg),
            (super::exr_layers::SIGNATURE, Self::OpenExr),
            (b"II*\0", Self::Tiff),
            (b"MM\0*", Self::Tiff),
            (b"II+\0", Self::Tiff),
            (b"MM\0+", Self::Tiff),
            (b"BM", Self::Bmp),
        ];
        if has(0, b"RIFF") && has(8, b"WEBP") {
            return Ok(Self::WebP);
        }
        marks
            .into_iter()
            .find(|(mark, _)| has(0, mark))
            .map(|(_, format)| format)
            .ok_or_else(|| format!("not an image: {READ} expected"))
    }

    /// The format as the decoder of codes knows it; `None` for a format of light.
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

    /// The usual ending of a file's name.
    pub(super) fn ending(self) -> &'static str {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_first_bytes() {
        let of = |file: &[u8]| FileFormat::detect(file);
        assert_eq!(of(b"\xFF\xD8\xFF\xE0"), Ok(FileFormat::Jpeg));
        assert_eq!(of(b"RIFF\x10\0\0\0WEBPVP8 "), Ok(FileFormat::WebP));
        assert_eq!(of(b"MM\0*\0\0\0\x08"), Ok(FileFormat::Tiff));
        assert_eq!(of(b"BM\x36\0\0\0"), Ok(FileFormat::Bmp));
        for (file, says) in [
            (
                &b"\0\0\0\x18ftypheic\0\0\0\0"[..],
                "HEIC image, which is not read; convert",
            ),
            (
                b"\0\0\0\x1cftypavif\0\0\0\0",
                "AVIF image, which is not read; convert",
            ),
            (b"\0\0\0\x18ftypmif1", "HEIC or AVIF"),
            (
                b"II*\0\x10\0\0\0CR\x02\0",
                "RAW file (CR2), which is not read; develop",
            ),
            (b"GIF89a", "GIF"),
            (
                b"RIFF\x10\0\0\0WAVE",
                "not an image: PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected",
            ),
            (b"", "not an image"),
            (b"ab", "not an image"),
        ] {
            let problem = of(file).unwrap_err();
            assert!(problem.contains(says), "{problem}");
        }
    }
}
