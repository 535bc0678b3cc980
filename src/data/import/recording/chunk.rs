//! Streaming decompression of a chunk of an MCAP file: [`Chunk`].

use std::io::{self, BufReader, Read, Seek, Take};

use lz4_flex::frame::FrameDecoder;
use zstd::stream::read::Decoder;

/// Maximum compression ratio of a chunk, not counting the first [`ALWAYS_ALLOWED`] bytes (chosen). Repeated black raw
/// images reach ratios of some thousands.
const MAX_RATIO: u64 = 10_000;

/// Decompressed size in bytes that is allowed at any compression ratio (chosen).
const ALWAYS_ALLOWED: u64 = 64 << 20;

/// Header of a chunk.
#[derive(Debug)]
pub(super) struct ChunkHeader {
    /// First and last log time of the chunk's messages, in nanoseconds.
    pub(super) times: [u64; 2],
    /// Length of the records after decompression, in bytes.
    pub(super) length: u64,
    /// CRC-32 of the records after decompression; 0 for none.
    pub(super) crc: u32,
    /// Name of the compression, `zstd` or `lz4`; empty for none.
    pub(super) compression: String,
    /// Length of the records in the file, in bytes.
    pub(super) stored_length: u64,
}

/// An open chunk.
pub(super) struct Chunk<R: Read> {
    /// First and last log time of the chunk's messages, in nanoseconds.
    pub(super) times: [u64; 2],
    content: Content<R>,
    /// Number of decompressed bytes that are not read yet.
    pub(super) remaining: u64,
    hasher: crc32fast::Hasher,
    /// Expected CRC-32; 0 for none.
    crc: u32,
}

/// Records of a chunk, by compression.
enum Content<R: Read> {
    Plain(Take<BufReader<R>>),
    Zstd(Decoder<'static, Take<BufReader<R>>>),
    Lz4(Box<FrameDecoder<Take<BufReader<R>>>>),
}

impl<R: Read> Chunk<R> {
    /// Opens the chunk whose records begin at the position of `file`.
    ///
    /// # Errors
    /// If the compression is unknown, its decoder cannot be created, or the ratio exceeds [`MAX_RATIO`]. The error
    /// contains `file`.
    pub(super) fn open(header: &ChunkHeader, file: BufReader<R>) -> Result<Self, (BufReader<R>, String)> {
        let allowed = header.stored_length.saturating_mul(MAX_RATIO).saturating_add(ALWAYS_ALLOWED);
        if header.length > allowed {
            let problem =
                format!("{} bytes from {} compressed ones are not believable", header.length, header.stored_length);
            return Err((file, problem));
        }
        let stored = file.take(header.stored_length);
        let content = match &*header.compression {
            "" => Content::Plain(stored),
            "zstd" => match Decoder::try_with_buffer(stored) {
                Ok(decoder) => Content::Zstd(decoder),
                Err((stored, e)) => return Err((stored.into_inner(), e.to_string())),
            },
            "lz4" => Content::Lz4(Box::new(FrameDecoder::new(stored))),
            other => {
                let problem = format!("compression {other:?}; zstd, lz4 or none expected");
                return Err((stored.into_inner(), problem));
            }
        };
        Ok(Self {
            times: header.times,
            content,
            remaining: header.length,
            hasher: crc32fast::Hasher::new(),
            crc: header.crc,
        })
    }
}

impl<R: Read + Seek> Chunk<R> {
    /// True if the chunk has no CRC-32, or the bytes read so far match it. Call it after all bytes are read.
    pub(super) fn is_intact(&self) -> bool {
        self.crc == 0 || self.crc == self.hasher.clone().finalize()
    }

    /// Returns the file, positioned at the end of the chunk's records.
    ///
    /// # Errors
    /// If the seek fails.
    pub(super) fn into_file(self) -> io::Result<BufReader<R>> {
        let stored = match self.content {
            Content::Plain(stored) => stored,
            Content::Zstd(decoder) => decoder.into_inner(),
            Content::Lz4(decoder) => decoder.into_inner(),
        };
        let unread = stored.limit();
        let mut file = stored.into_inner();
        file.seek_relative(unread.cast_signed())?;
        Ok(file)
    }
}

impl<R: Read> Read for Chunk<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let length = usize::try_from(self.remaining).unwrap_or(usize::MAX).min(bytes.len());
        let bytes = &mut bytes[..length];
        let count = match &mut self.content {
            Content::Plain(stored) => stored.read(bytes),
            Content::Zstd(decoder) => decoder.read(bytes),
            Content::Lz4(decoder) => decoder.read(bytes),
        }?;
        self.remaining -= count as u64;
        if self.crc != 0 {
            self.hasher.update(&bytes[..count]);
        }
        Ok(count)
    }
}
