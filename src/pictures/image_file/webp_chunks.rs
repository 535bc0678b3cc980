//! Facts of a WebP file from its chunks: [`WebpProperties`], and the length in its header: [`stated_length`].

/// Facts of a WebP file that decide how it is decoded (WebP container specification; RFC 9649, section 2).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct WebpProperties<'a> {
    /// EXIF data (a TIFF structure), if the file has any.
    pub(super) exif: Option<&'a [u8]>,
    /// ICC profile, if the file has one.
    pub(super) profile: Option<&'a [u8]>,
    /// Number of frames of an animation; 0 without animation.
    pub(super) frames: usize,
}

impl<'a> WebpProperties<'a> {
    /// Reads the chunks in order, up to the end of a truncated file.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut properties = Self::default();
        for (kind, data) in Chunks::new(file) {
            match kind {
                b"ICCP" if properties.profile.is_none() => properties.profile = Some(data),
                b"ANMF" => properties.frames += 1,
                b"EXIF" if properties.exif.is_none() => {
                    // Some programs also write the header of a JPEG segment.
                    properties.exif = Some(data.strip_prefix(b"Exif\0\0").unwrap_or(data));
                }
                _ => {}
            }
        }
        properties
    }
}

/// The length of the file that its header states, in bytes; `None` if the header is truncated.
pub(super) fn stated_length(file: &[u8]) -> Option<u64> {
    let size = file.get(4..8).and_then(|size| size.try_into().ok())?;
    Some(u64::from(u32::from_le_bytes(size)) + 8)
}

/// Iterator over the complete chunks of a file.
struct Chunks<'a>(&'a [u8]);

impl<'a> Chunks<'a> {
    fn new(file: &'a [u8]) -> Self {
        // The header has 12 bytes: RIFF, the size, WEBP.
        Self(file.get(12..).unwrap_or_default())
    }
}

impl<'a> Iterator for Chunks<'a> {
    type Item = (&'a [u8; 4], &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (kind, rest) = self.0.split_first_chunk::<4>()?;
        let (length, rest) = rest.split_first_chunk::<4>()?;
        let length = u32::from_le_bytes(*length) as usize;
        let (data, rest) = rest.split_at_checked(length)?;
        // A chunk of odd length is padded by one byte.
        self.0 = rest.get(length % 2..).unwrap_or_default();
        Some((kind, data))
    }
}
