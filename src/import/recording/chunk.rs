//! The content of a chunk, decompressed while it is read: [`Chunk`].

use std::io::{self, BufReader, Read, Seek, Take};

use lz4_flex::frame::FrameDecoder;
use zstd::stream::read::Decoder;

/// How many times as long as its compressed bytes the content of a chunk may be, beyond [`ALWAYS_ALLOWED`] (chosen). Repeated black
/// frames of a raw image reach some thousands.
const LARGEST_RATIO: u64 = 10_000;

/// Bytes of content that are allowed whatever the ratio (chosen).
const ALWAYS_ALLOWED: u64 = 64 << 20;

/// The facts in front of the records of a chunk.
#[derive(Debug)]
pub(super) struct ChunkHeader {
    /// The least and the greatest log time of its messages, in nanoseconds.
    pub(super) times: [u64; 2],
    /// Bytes of the records after decompression.
    pub(super) length: u64,
    /// CRC-32 of the records after decompression; 0 for none.
    pub(super) crc: u32,
    /// The name of the compression; empty for none.
    pub(super) compression: String,
    /// Bytes of the records as they are stored.
    pub(super) stored: u64,
}

/// An open chunk.
pub(super) struct Chunk<R: Read> {
    pub(super) times: [u64; 2],
    content: Content<R>,
    /// Bytes of content that are not read yet.
    pub(super) left: u64,
    digest: crc32fast::Hasher,
    crc: u32,
}

enum Content<R: Read> {
    Plain(Take<BufReader<R>>),
    Zstd(Decoder<'static, Take<BufReader<R>>>),
    Lz4(Box<FrameDecoder<Take<BufReader<R>>>>),
}

impl<R: Read> Chunk<R> {
    /// Opens the chunk whose records begin at the place of `file`. The error has the file back.
    pub(super) fn open(
        header: &ChunkHeader,
        file: BufReader<R>,
    ) -> Result<Self, (BufReader<R>, String)> {
        let allowed = header
            .stored
            .saturating_mul(LARGEST_RATIO)
            .saturating_add(ALWAYS_ALLOWED);
        if header.length > allowed {
            let problem = format!(
                "{} bytes from {} compressed ones are not believable",
                header.length, header.stored
            );
            return Err((file, problem));
        }
        let stored = file.take(header.stored);
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
            left: header.length,
            digest: crc32fast::Hasher::new(),
            crc: header.crc,
        })
    }
}

impl<R: Read + Seek> Chunk<R> {
    /// Whether the digest of the content that was read is that of the chunk.
    pub(super) fn is_intact(&self) -> bool {
        self.crc == 0 || self.crc == self.digest.clone().finalize()
    }

    /// The file, at the end of the chunk's records.
    ///
    /// # Errors
    /// If the file cannot be read.
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
        let most = usize::try_from(self.left)
            .unwrap_or(usize::MAX)
            .min(bytes.len());
        let bytes = &mut bytes[..most];
        let count = match &mut self.content {
            Content::Plain(stored) => stored.read(bytes),
            Content::Zstd(decoder) => decoder.read(bytes),
            Content::Lz4(decoder) => decoder.read(bytes),
        }?;
        self.left -= count as u64;
        if self.crc != 0 {
            self.digest.update(&bytes[..count]);
        }
        Ok(count)
    }
}
