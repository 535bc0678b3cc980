//! The facts of a PNG file in its chunks: [`PngOutline`]; and the first fault in them: [`fault`].

use std::borrow::Cow;

use crate::colour::{ColourTag, Gamma};

/// The first eight bytes of every PNG file.
pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The facts of a PNG file that decide how its samples are read (PNG specification, third edition).
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct PngOutline<'a> {
    /// The EXIF data, a TIFF structure; `None` if there are none.
    pub(super) exif: Option<&'a [u8]>,
    /// The number of pictures of an animation; 0 if the file is no animation.
    pub(super) frames: usize,
    /// The number of bits of a sample.
    pub(super) bits: u8,
    /// The colour information that counts.
    pub(super) colour: ColourTag,
}

/// Fault in the chunks of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PngFault {
    /// The file ends before the last chunk does.
    Cut,
    Checksum,
}

impl<'a> PngOutline<'a> {
    /// Reads the chunks one after another; a truncated file is read up to its end.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut outline = Self::default();
        let mut colour = ColourChunks::default();
        for Chunk { kind, data, .. } in Chunks::new(file) {
            match kind {
                b"IHDR" => outline.bits = data.get(8).copied().unwrap_or(0),
                b"IDAT" => colour.is_closed = true,
                b"eXIf" if outline.exif.is_none() => outline.exif = Some(data),
                b"acTL" => {
                    let frames = data.first_chunk::<4>();
                    outline.frames = frames.map_or(0, |n| u32::from_be_bytes(*n) as usize);
                }
                _ => colour.add(*kind, data),
            }
        }
        outline.colour = colour.tag();
        outline
    }
}

/// The chunks of colour information. Those behind the samples do not count.
#[derive(Default)]
struct ColourChunks<'a> {
    is_closed: bool,
    code_points: Option<[u8; 4]>,
    profile: Option<&'a [u8]>,
    is_srgb: bool,
    gamma: Gamma,
}

impl<'a> ColourChunks<'a> {
    fn add(&mut self, kind: [u8; 4], data: &'a [u8]) {
        if self.is_closed {
            return;
        }
        let four = data.first_chunk::<4>();
        match &kind {
            b"cICP" => self.code_points = four.copied(),
            b"iCCP" => self.profile = Some(data),
            b"sRGB" => self.is_srgb = true,
            b"gAMA" => self.gamma.exponent = four.map(|bytes| u32::from_be_bytes(*bytes)),
            b"cHRM" => {
                let numbers: Vec<u32> = data
                    .as_chunks::<4>()
                    .0
                    .iter()
                    .map(|four| u32::from_be_bytes(*four))
                    .collect();
                self.gamma.primaries = numbers.try_into().ok();
            }
            _ => {}
        }
    }

    /// The first of them in the order in which they count.
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

/// The file without chunks that decide no samples. The decoder would decompress profiles and texts, to any size.
pub(super) fn samples_alone(file: &[u8]) -> Cow<'_, [u8]> {
    const NEEDED: [&[u8; 4]; 5] = [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"];
    let mut chunks = Chunks::new(file);
    if chunks.by_ref().all(|chunk| NEEDED.contains(&chunk.kind)) {
        return Cow::Borrowed(file);
    }
    let mut alone = SIGNATURE.to_vec();
    let mut chunks = Chunks::new(file);
    for chunk in chunks.by_ref().filter(|chunk| NEEDED.contains(&chunk.kind)) {
        alone.extend((chunk.data.len() as u32).to_be_bytes());
        alone.extend(chunk.body);
        alone.extend(chunk.checksum.to_be_bytes());
    }
    // The rest of a cut file: a part of its last chunk.
    alone.extend(chunks.0);
    Cow::Owned(alone)
}

/// The first fault in the chunks of a PNG file, up to the last chunk, `IEND`; `None` if there is none.
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
    /// Kind and data, the bytes that the checksum covers.
    body: &'a [u8],
    checksum: u32,
}

/// The chunks of a file, up to the point where it breaks off.
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
        Some(Chunk {
            kind,
            data,
            body,
            checksum: u32::from_be_bytes(*checksum),
        })
    }
}
