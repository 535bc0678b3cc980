//! The facts of a WebP file in its chunks: [`WebpOutline`]; and whether it was cut: [`missing`].

/// The facts of a WebP file that decide how it is read (WebP container specification; RFC 9649, section 2).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct WebpOutline<'a> {
    /// The EXIF data, a TIFF structure; `None` if there are none.
    pub(super) exif: Option<&'a [u8]>,
    /// The ICC profile; `None` if there is none.
    pub(super) profile: Option<&'a [u8]>,
    /// The number of pictures of an animation; 0 if the file is no animation.
    pub(super) frames: usize,
}

impl<'a> WebpOutline<'a> {
    /// Reads the chunks one after another; a truncated file is read up to its end.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut outline = Self::default();
        for (kind, data) in Chunks::new(file) {
            match kind {
                b"ICCP" if outline.profile.is_none() => outline.profile = Some(data),
                b"ANMF" => outline.frames += 1,
                b"EXIF" if outline.exif.is_none() => {
                    // Some programs write the header of a JPEG segment, too.
                    outline.exif = Some(data.strip_prefix(b"Exif\0\0").unwrap_or(data));
                }
                _ => {}
            }
        }
        outline
    }
}

/// The number of bytes that a file must have by its header; `None` if it has them.
pub(super) fn missing(file: &[u8]) -> Option<u64> {
    let size = file.get(4..8).and_then(|size| size.try_into().ok())?;
    let whole = u64::from(u32::from_le_bytes(size)) + 8;
    (whole > file.len() as u64).then_some(whole)
}

/// The chunks of a file, up to the point where it breaks off.
struct Chunks<'a>(&'a [u8]);

impl<'a> Chunks<'a> {
    fn new(file: &'a [u8]) -> Self {
        // RIFF, the size, WEBP.
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
        // A chunk of odd length is filled up by one byte.
        self.0 = rest.get(length % 2..).unwrap_or_default();
        Some((kind, data))
    }
}
