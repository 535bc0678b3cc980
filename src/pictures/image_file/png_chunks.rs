//! Facts of a PNG file from its chunks: [`PngProperties`], and the first fault in them: [`fault`].
//!
//! Facts of a WebP file from its chunks: [`WebpProperties`], and the length in its header: [`stated_length`].

use std::borrow::Cow;

use crate::colour::{ColourTag, Gamma};

/// The first eight bytes of every PNG file.
pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Facts of a PNG file that decide how it is decoded (PNG specification, third edition).
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct PngProperties<'a> {
    /// EXIF data (a TIFF structure), if the file has any.
    pub(super) exif: Option<&'a [u8]>,
    /// Number of frames of an animation; 0 without animation.
    pub(super) frames: usize,
    /// Bits per sample.
    pub(super) bits: u8,
    /// The colour information with the highest priority.
    pub(super) colour: ColourTag,
}

/// Fault in the chunks of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PngFault {
    /// The file is truncated.
    Cut,
    /// A checksum is wrong.
    Checksum,
}

impl<'a> PngProperties<'a> {
    /// Reads the chunks in order, up to the end of a truncated file.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut properties = Self::default();
        let mut colour = ColourChunks::default();
        for Chunk { kind, data, .. } in PngChunks::new(file) {
            match kind {
                b"IHDR" => properties.bits = data.get(8).copied().unwrap_or(0),
                b"IDAT" => colour.has_samples = true,
                b"eXIf" if properties.exif.is_none() => properties.exif = Some(data),
                b"acTL" => {
                    let frames = data.first_chunk::<4>();
                    properties.frames = frames.map_or(0, |n| u32::from_be_bytes(*n) as usize);
                }
                _ => colour.add(*kind, data),
            }
        }
        properties.colour = colour.tag();
        properties
    }
}

/// Colour information from the chunks before the samples; later chunks are ignored.
#[derive(Default)]
struct ColourChunks<'a> {
    has_samples: bool,
    code_points: Option<[u8; 4]>,
    profile: Option<&'a [u8]>,
    is_srgb: bool,
    gamma: Gamma,
}

impl<'a> ColourChunks<'a> {
    fn add(&mut self, kind: [u8; 4], data: &'a [u8]) {
        if self.has_samples {
            return;
        }
        let four = data.first_chunk::<4>();
        match &kind {
            b"cICP" => self.code_points = four.copied(),
            b"iCCP" => self.profile = Some(data),
            b"sRGB" => self.is_srgb = true,
            b"gAMA" => self.gamma.exponent = four.map(|bytes| u32::from_be_bytes(*bytes)),
            b"cHRM" => {
                let numbers: Vec<u32> = data.as_chunks::<4>().0.iter().map(|four| u32::from_be_bytes(*four)).collect();
                self.gamma.primaries = numbers.try_into().ok();
            }
            _ => {}
        }
    }

    /// The colour information with the highest priority.
    fn tag(self) -> ColourTag {
        match (self.code_points, self.profile) {
            (Some(points), _) => ColourTag::CodePoints(points),
            (None, Some(profile)) => ColourTag::DeflatedProfile(profile.to_vec()),
            (None, None) if self.is_srgb => ColourTag::Srgb,
            (None, None) if self.gamma != Gamma::default() => ColourTag::Gamma(self.gamma),
            (None, None) => ColourTag::None,
        }
    }
}

/// The file without chunks that do not affect the samples, because the decoder would decompress profiles and texts of
/// any size.
pub(super) fn without_metadata(file: &[u8]) -> Cow<'_, [u8]> {
    const NEEDED: [&[u8; 4]; 5] = [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"];
    let mut chunks = PngChunks::new(file);
    if chunks.by_ref().all(|chunk| NEEDED.contains(&chunk.kind)) {
        return Cow::Borrowed(file);
    }
    let mut reduced = SIGNATURE.to_vec();
    let mut chunks = PngChunks::new(file);
    for chunk in chunks.by_ref().filter(|chunk| NEEDED.contains(&chunk.kind)) {
        reduced.extend((chunk.data.len() as u32).to_be_bytes());
        reduced.extend(chunk.body);
        reduced.extend(chunk.checksum.to_be_bytes());
    }
    // A truncated file keeps the part of its last chunk.
    reduced.extend(chunks.0);
    Cow::Owned(reduced)
}

/// The first fault in the chunks of a PNG file up to the last chunk, `IEND`; `None` without a fault.
pub(super) fn fault(file: &[u8]) -> Option<PngFault> {
    for chunk in PngChunks::new(file) {
        if crc32fast::hash(chunk.body) != chunk.checksum {
            return Some(PngFault::Checksum);
        }
        if chunk.kind == b"IEND" {
            return None;
        }
    }
    Some(PngFault::Cut)
}

/// A chunk of a PNG file.
struct Chunk<'a> {
    kind: &'a [u8; 4],
    data: &'a [u8],
    /// Kind and data, which the checksum covers.
    body: &'a [u8],
    checksum: u32,
}

/// Iterator over the complete chunks of a file.
struct PngChunks<'a>(&'a [u8]);

impl<'a> PngChunks<'a> {
    fn new(file: &'a [u8]) -> Self {
        Self(file.strip_prefix(SIGNATURE).unwrap_or_default())
    }
}

impl<'a> Iterator for PngChunks<'a> {
    type Item = Chunk<'a>;

    fn next(&mut self) -> Option<Chunk<'a>> {
        let (length, rest) = self.0.split_first_chunk::<4>()?;
        let length = (u32::from_be_bytes(*length) as usize).saturating_add(4);
        let (body, rest) = rest.split_at_checked(length)?;
        let (checksum, rest) = rest.split_first_chunk::<4>()?;
        let (kind, data) = body.split_first_chunk::<4>()?;
        self.0 = rest;
        Some(Chunk { kind, data, body, checksum: u32::from_be_bytes(*checksum) })
    }
}

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
        for (kind, data) in WebpChunks::new(file) {
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
struct WebpChunks<'a>(&'a [u8]);

impl<'a> WebpChunks<'a> {
    fn new(file: &'a [u8]) -> Self {
        // The header has 12 bytes: RIFF, the size, WEBP.
        Self(file.get(12..).unwrap_or_default())
    }
}

impl<'a> Iterator for WebpChunks<'a> {
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
