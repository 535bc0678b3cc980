//! Reader of MCAP files: [`McapReader`].
//!
//! A file is read from start to end, record by record (<https://mcap.dev/spec>), because it has no index if its
//! recorder was killed. Message bodies are read on demand and one at a time, so memory does not depend on the size of
//! files and chunks.
//!
//! Streaming decompression of a chunk of an MCAP file: [`OpenChunk`].

use std::collections::HashMap;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom, Take};
use std::mem;
use std::sync::Arc;

use lz4_flex::frame::FrameDecoder;
use zstd::stream::read::Decoder;

use super::Nanoseconds;
use super::channel::Channel;
use super::exposure::relevant_definition;
use super::fields::FieldReader;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Maximum length of a message, in bytes (chosen), to limit memory. A 4K image in colour with 16 bits has 50 MB.
pub const MAX_MESSAGE_BYTES: u64 = 64 << 20;

/// Maximum length of a schema or channel record, in bytes (chosen). Message definitions have some kilobytes.
const MAX_DEFINITION_BYTES: u64 = 1 << 20;

/// Maximum length of the name of a topic, type or serialization, in bytes (chosen).
const MAX_NAME_BYTES: usize = 1024;

/// Maximum number of channels and of schemas (chosen). Further ones are ignored.
const MAX_CHANNELS: usize = 10_000;

/// Size of the read buffer, in bytes (chosen).
const BUFFER_BYTES: usize = 256 << 10;

/// Length of the opcode and length before a record, in bytes.
const RECORD_HEAD: u64 = 9;

/// Length of the numbers before the body of a message, in bytes.
const MESSAGE_HEAD: u64 = 22;

/// Length of the numbers before the compression name of a chunk, in bytes.
const CHUNK_HEAD: u64 = 28;

/// First bytes of a zstd frame (RFC 8878). No CDR message begins with them, because its first byte is 0.
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Opcodes of records.
mod opcode {
    pub(super) const SCHEMA: u8 = 3;

    pub(super) const CHANNEL: u8 = 4;

    pub(super) const MESSAGE: u8 = 5;

    pub(super) const CHUNK: u8 = 6;

    pub(super) const DATA_END: u8 = 15;
}

/// Event while reading a recording.
#[derive(Debug)]
pub enum Event {
    /// A message. Its body may be read next.
    Message(MessageHeader),
    /// End of a chunk. Its messages are intact.
    ChunkRead,
    /// The messages of this chunk may be wrong; the rest of the chunk was skipped.
    ChunkDamaged {
        /// First and last log time of the chunk.
        times: [Nanoseconds; 2],
        problem: String,
    },
    /// The file ends early, or has invalid data instead of a record. No further events follow.
    Cut(String),
}

/// Message without its body.
#[derive(Debug, Clone)]
pub struct MessageHeader {
    pub channel: Arc<Channel>,
    /// Time when it was recorded.
    pub log_time: Nanoseconds,
    /// Length of the body, in bytes.
    pub length: u64,
    /// True if it is in a chunk, whose checksum is checked at the end of the chunk.
    pub is_in_chunk: bool,
}

/// Reader of a recording.
pub struct McapReader<R: Read> {
    source: McapSource<R>,
    /// Length of the file, in bytes.
    length: u64,
    /// Offset in the file of the record after the current one.
    next_record: u64,
    /// Number of bytes of the current record that are not read yet.
    unread: u64,
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, Arc<Channel>>,
    /// Number of messages without a channel record.
    pub messages_without_channel: u64,
    /// Body of the current record, as far as it is read.
    body: Vec<u8>,
    /// Error of a body that could not be read.
    broken: Option<String>,
}

enum McapSource<R: Read> {
    File(BufReader<R>),
    Chunk(OpenChunk<R>),
    Ended,
}

#[derive(Debug)]
struct Schema {
    name: String,
    definition: Vec<u8>,
}

/// Error while reading.
enum Fault {
    /// The data end early or are invalid.
    Broken(String),
    /// The chunk cannot be opened. The file is positioned at its records.
    UnreadableChunk { times: [u64; 2], problem: String },
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Self::Broken(match error.kind() {
            ErrorKind::UnexpectedEof => ends_too_early(),
            _ => error.to_string(),
        })
    }
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Self::Broken(problem)
    }
}

impl<R: Read + Seek> McapReader<R> {
    /// Opens a recording.
    ///
    /// # Errors
    /// If it is not an MCAP file.
    pub fn open(mut file: R) -> Result<Self, String> {
        let length =
            file.seek(SeekFrom::End(0)).and_then(|length| file.rewind().map(|()| length)).map_err(|e| e.to_string())?;
        let mut file = BufReader::with_capacity(BUFFER_BYTES, file);
        if length == 0 {
            return Err("the file is empty, as a recorder leaves it that is killed".to_owned());
        }
        let mut magic = [0; MAGIC.len()];
        if file.read_exact(&mut magic).is_err() || magic != MAGIC {
            return Err("not an MCAP file; a recording of ROS 2 or Foxglove that ends in .mcap expected".to_owned());
        }
        Ok(Self {
            source: McapSource::File(file),
            length,
            next_record: MAGIC.len() as u64,
            unread: 0,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            messages_without_channel: 0,
            body: Vec::new(),
            broken: None,
        })
    }

    /// Reads the next event; `None` at the end.
    pub fn next_event(&mut self) -> Option<Event> {
        loop {
            if matches!(self.source, McapSource::Ended) {
                return None;
            }
            match self.step() {
                Ok(None) => {}
                Ok(Some(event)) => return Some(event),
                Err(fault) => return Some(self.recover(fault)),
            }
        }
    }

    /// Offset in the file of the end of the current record.
    pub fn position(&self) -> u64 {
        self.next_record.min(self.length)
    }

    /// Reads the body of the message of the last event, and decompresses it if the recorder compressed each message.
    /// `None` if it cannot be read; the next event then has the reason.
    pub fn body(&mut self) -> Option<&[u8]> {
        self.read_body(self.unread)?;
        if self.body.starts_with(&ZSTD_MAGIC)
            && let Some(body) = decompress_message(&self.body)
        {
            self.body = body;
        }
        Some(&self.body)
    }

    /// Reads the start of the body, at least `min` bytes if the body is that long; `None` as for [`Self::body`], which
    /// may still be called for the whole body.
    pub fn start_of_body(&mut self, min: u64) -> Option<&[u8]> {
        self.read_body(self.unread.min(min))?;
        if self.body.starts_with(&ZSTD_MAGIC) {
            return self.body();
        }
        Some(&self.body)
    }

    /// Takes out the body that was read.
    pub fn take_body(&mut self) -> Vec<u8> {
        mem::take(&mut self.body)
    }

    /// Appends bytes of the current record to the body, and returns the body.
    fn read_body(&mut self, count: u64) -> Option<&[u8]> {
        let Self { source, body, unread, .. } = self;
        body.reserve_exact(count.min(MAX_MESSAGE_BYTES) as usize);
        let read = match source {
            McapSource::File(file) => file.take(count).read_to_end(body),
            McapSource::Chunk(chunk) => chunk.take(count).read_to_end(body),
            McapSource::Ended => Ok(0),
        };
        let problem = match read {
            Ok(read) => {
                *unread -= read as u64;
                ((read as u64) < count).then(ends_too_early)
            }
            Err(e) => Some(e.to_string()),
        };
        self.broken = problem;
        self.broken.is_none().then_some(&*self.body)
    }

    /// Skips the rest of the current record, and reads the start of the next one.
    fn step(&mut self) -> Result<Option<Event>, Fault> {
        if let Some(problem) = self.broken.take() {
            return Err(problem.into());
        }
        self.skip_rest()?;
        self.body.clear();
        match mem::replace(&mut self.source, McapSource::Ended) {
            McapSource::Chunk(chunk) if chunk.remaining == 0 => return self.end_chunk(chunk),
            source => self.source = source,
        }
        let (opcode, length) = self.read_record_head()?;
        match opcode {
            opcode::MESSAGE => return self.read_message(length),
            opcode::SCHEMA => {
                if let Some(record) = self.read_definition(length)? {
                    self.add_schema(&record)?;
                }
            }
            opcode::CHANNEL => {
                if let Some(record) = self.read_definition(length)? {
                    self.add_channel(&record)?;
                }
            }
            opcode::CHUNK if matches!(self.source, McapSource::File(_)) => self.open_chunk(length)?,
            opcode::DATA_END if matches!(self.source, McapSource::File(_)) => {
                self.source = McapSource::Ended;
            }
            _ => self.unread = length,
        }
        Ok(None)
    }

    /// Converts a fault to an event. Reading continues after a damaged chunk; otherwise it ends.
    fn recover(&mut self, fault: Fault) -> Event {
        self.unread = 0;
        let is_whole = self.next_record <= self.length;
        let source = mem::replace(&mut self.source, McapSource::Ended);
        let (file, times, problem) = match (source, fault) {
            (McapSource::Chunk(chunk), Fault::Broken(problem)) if is_whole => {
                let times = chunk.times;
                (chunk.into_file().ok(), times, problem)
            }
            (McapSource::File(file), Fault::UnreadableChunk { times, problem }) => (Some(file), times, problem),
            (_, Fault::Broken(problem) | Fault::UnreadableChunk { problem, .. }) => {
                return Event::Cut(problem);
            }
        };
        if let Some(mut file) = file
            && file.seek(SeekFrom::Start(self.next_record)).is_ok()
        {
            self.source = McapSource::File(file);
        }
        let times = times.map(u64::cast_signed);
        Event::ChunkDamaged { times, problem }
    }

    /// Skips the rest of the current record.
    fn skip_rest(&mut self) -> Result<(), Fault> {
        let count = mem::take(&mut self.unread);
        match &mut self.source {
            McapSource::File(file) => {
                if self.next_record > self.length {
                    return Err(io::Error::from(ErrorKind::UnexpectedEof).into());
                }
                file.seek_relative(count.cast_signed())?;
            }
            McapSource::Chunk(chunk) => {
                if io::copy(&mut chunk.take(count), &mut io::sink())? < count {
                    return Err(io::Error::from(ErrorKind::UnexpectedEof).into());
                }
            }
            McapSource::Ended => {}
        }
        Ok(())
    }

    /// Reads the opcode and length of the next record.
    fn read_record_head(&mut self) -> Result<(u8, u64), Fault> {
        let mut head = [0; RECORD_HEAD as usize];
        self.read_exact(&mut head)?;
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        match &self.source {
            McapSource::Chunk(chunk) if length > chunk.remaining => {
                return Err(format!("a record of {length} bytes runs past the end of the chunk").into());
            }
            McapSource::Chunk(_) | McapSource::Ended => {}
            McapSource::File(_) => {
                self.next_record = self.next_record.saturating_add(RECORD_HEAD).saturating_add(length);
            }
        }
        Ok((opcode, length))
    }

    fn read_exact(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        match &mut self.source {
            McapSource::File(file) => file.read_exact(bytes),
            McapSource::Chunk(chunk) => chunk.read_exact(bytes),
            McapSource::Ended => Err(ErrorKind::UnexpectedEof.into()),
        }
    }

    /// Reads the start of a message; `None` if its channel is unknown.
    fn read_message(&mut self, length: u64) -> Result<Option<Event>, Fault> {
        let body = length.checked_sub(MESSAGE_HEAD).ok_or_else(too_short)?;
        let mut head = [0; MESSAGE_HEAD as usize];
        self.read_exact(&mut head)?;
        let mut fields = FieldReader::unaligned(&head);
        let (id, _sequence, log_time) = (fields.u16()?, fields.u32()?, fields.u64()?);
        self.unread = body;
        if matches!(self.source, McapSource::File(_)) && self.next_record > self.length {
            return Err(ends_too_early().into());
        }
        let Some(channel) = self.channels.get(&id) else {
            self.messages_without_channel += 1;
            return Ok(None);
        };
        Ok(Some(Event::Message(MessageHeader {
            channel: Arc::clone(channel),
            log_time: log_time.cast_signed(),
            length: body,
            is_in_chunk: matches!(self.source, McapSource::Chunk(_)),
        })))
    }

    /// Reads a schema or channel record; `None` if it is too long, or there are too many.
    fn read_definition(&mut self, length: u64) -> Result<Option<Vec<u8>>, Fault> {
        self.unread = length;
        let known = self.channels.len().max(self.schemas.len());
        if length > MAX_DEFINITION_BYTES || known > MAX_CHANNELS {
            return Ok(None);
        }
        self.read_body(length).ok_or_else(ends_too_early)?;
        Ok(Some(mem::take(&mut self.body)))
    }

    fn add_schema(&mut self, record: &[u8]) -> Result<(), Fault> {
        let mut fields = FieldReader::unaligned(record);
        let (id, name) = (fields.u16()?, fields.text()?);
        let _encoding = fields.text()?;
        let definition = fields.bytes()?;
        if name.len() <= MAX_NAME_BYTES {
            let definition = relevant_definition(definition);
            self.schemas.insert(id, Schema { name, definition });
        }
        Ok(())
    }

    fn add_channel(&mut self, record: &[u8]) -> Result<(), Fault> {
        let mut fields = FieldReader::unaligned(record);
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (topic, serialization) = (fields.text()?, fields.text()?);
        if topic.len().max(serialization.len()) > MAX_NAME_BYTES {
            return Ok(());
        }
        let (name, definition) = match self.schemas.get(&schema) {
            Some(schema) => (&*schema.name, &*schema.definition),
            None => ("", &[][..]),
        };
        let channel = Channel::new(topic, name, &serialization, definition);
        self.channels.insert(id, Arc::new(channel));
        Ok(())
    }

    /// Opens a chunk.
    fn open_chunk(&mut self, length: u64) -> Result<(), Fault> {
        let mut head = [0; CHUNK_HEAD as usize];
        self.read_exact(&mut head)?;
        let mut fields = FieldReader::unaligned(&head);
        let times = [fields.u64()?, fields.u64()?];
        let (content, crc) = (fields.u64()?, fields.u32()?);
        let mut name_length = [0; 4];
        self.read_exact(&mut name_length)?;
        let name_length = u64::from(u32::from_le_bytes(name_length));
        let stored_length = length.checked_sub(CHUNK_HEAD + 4 + name_length + 8).ok_or_else(too_short)?;
        self.unread = name_length.min(MAX_NAME_BYTES as u64);
        let name = self.read_body(self.unread).ok_or_else(ends_too_early)?;
        let compression = String::from_utf8_lossy(name).into_owned();
        self.body.clear();
        let mut stated = [0; 8];
        self.read_exact(&mut stated)?;
        if u64::from_le_bytes(stated) != stored_length {
            let problem = "its length and that of its records differ".to_owned();
            return Err(Fault::UnreadableChunk { times, problem });
        }
        let header = ChunkHeader { times, length: content, crc, compression, stored_length };
        if let McapSource::File(file) = mem::replace(&mut self.source, McapSource::Ended) {
            match OpenChunk::open(&header, file) {
                Ok(chunk) => self.source = McapSource::Chunk(chunk),
                Err((file, problem)) => {
                    self.source = McapSource::File(file);
                    return Err(Fault::UnreadableChunk { times, problem });
                }
            }
        }
        Ok(())
    }

    /// Checks the checksum of a chunk, and continues after it.
    fn end_chunk(&mut self, chunk: OpenChunk<R>) -> Result<Option<Event>, Fault> {
        let (is_intact, times) = (chunk.is_intact(), chunk.times);
        self.source = McapSource::File(chunk.into_file()?);
        Ok(Some(if is_intact {
            Event::ChunkRead
        } else {
            Event::ChunkDamaged { times: times.map(u64::cast_signed), problem: "its checksum differs".to_owned() }
        }))
    }
}

/// Decompresses a message; `None` if it is broken, or longer than [`MAX_MESSAGE_BYTES`].
fn decompress_message(message: &[u8]) -> Option<Vec<u8>> {
    let mut body = Vec::new();
    let decoder = zstd::stream::read::Decoder::with_buffer(message).ok()?;
    let read = decoder.take(MAX_MESSAGE_BYTES + 1).read_to_end(&mut body).ok()?;
    (read as u64 <= MAX_MESSAGE_BYTES).then_some(body)
}

/// Error message for a file or chunk that is shorter than its records.
fn ends_too_early() -> String {
    "its bytes end too early".to_owned()
}

/// Error message for a record that is shorter than its fields.
fn too_short() -> String {
    "a record is shorter than its fields".to_owned()
}

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
pub(super) struct OpenChunk<R: Read> {
    /// First and last log time of the chunk's messages, in nanoseconds.
    pub(super) times: [u64; 2],
    content: ChunkRecords<R>,
    /// Number of decompressed bytes that are not read yet.
    pub(super) remaining: u64,
    hasher: crc32fast::Hasher,
    /// Expected CRC-32; 0 for none.
    crc: u32,
}

/// Records of a chunk, by compression.
enum ChunkRecords<R: Read> {
    Plain(Take<BufReader<R>>),
    Zstd(Decoder<'static, Take<BufReader<R>>>),
    Lz4(Box<FrameDecoder<Take<BufReader<R>>>>),
}

impl<R: Read> OpenChunk<R> {
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
            "" => ChunkRecords::Plain(stored),
            "zstd" => match Decoder::try_with_buffer(stored) {
                Ok(decoder) => ChunkRecords::Zstd(decoder),
                Err((stored, e)) => return Err((stored.into_inner(), e.to_string())),
            },
            "lz4" => ChunkRecords::Lz4(Box::new(FrameDecoder::new(stored))),
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

impl<R: Read + Seek> OpenChunk<R> {
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
            ChunkRecords::Plain(stored) => stored,
            ChunkRecords::Zstd(decoder) => decoder.into_inner(),
            ChunkRecords::Lz4(decoder) => decoder.into_inner(),
        };
        let unread = stored.limit();
        let mut file = stored.into_inner();
        file.seek_relative(unread.cast_signed())?;
        Ok(file)
    }
}

impl<R: Read> Read for OpenChunk<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let length = usize::try_from(self.remaining).unwrap_or(usize::MAX).min(bytes.len());
        let bytes = &mut bytes[..length];
        let count = match &mut self.content {
            ChunkRecords::Plain(stored) => stored.read(bytes),
            ChunkRecords::Zstd(decoder) => decoder.read(bytes),
            ChunkRecords::Lz4(decoder) => decoder.read(bytes),
        }?;
        self.remaining -= count as u64;
        if self.crc != 0 {
            self.hasher.update(&bytes[..count]);
        }
        Ok(count)
    }
}
