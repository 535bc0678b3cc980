//! Facts of a PNG file from its chunks: [`PngProperties`], and the first fault in them: [`fault`].

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
        for Chunk { kind, data, .. } in Chunks::new(file) {
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
    let mut chunks = Chunks::new(file);
    if chunks.by_ref().all(|chunk| NEEDED.contains(&chunk.kind)) {
        return Cow::Borrowed(file);
    }
    let mut reduced = SIGNATURE.to_vec();
    let mut chunks = Chunks::new(file);
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
    for chunk in Chunks::new(file) {
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
struct Chunks<'a>(&'a [u8]);

impl<'a> Chunks<'a> {
    fn new(file: &'a [u8]) -> Self {
        Self(file.strip_prefix(SIGNATURE).unwrap_or_default())
    }
}

impl<'a> Iterator for Chunks<'a> {
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
