//! A reader of MCAP files: [`McapReader`].
//!
//! It reads a file from start to end, record by record (<https://mcap.dev/spec>), because a file whose recorder was killed has no index.
//! Bodies of messages are read only on demand, and one at a time, so that memory does not depend on the size of files and chunks.

use std::collections::HashMap;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::mem;
use std::sync::Arc;

use super::Nanoseconds;
use super::channel::Channel;
use super::chunk::{Chunk, ChunkHeader};
use super::exposure::kept_definition;
use super::fields::FieldReader;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// The largest message that is read, in bytes (chosen): 4K in colour with 16 bits has 50 MB. Memory is bounded by it.
pub(crate) const LARGEST_MESSAGE: u64 = 64 << 20;

/// The largest record of a schema or channel that is read, in bytes (chosen); definitions of messages have some kilobytes.
const LARGEST_DEFINITION: u64 = 1 << 20;

/// The longest name of a topic, type or serialization in bytes (chosen), and the most channels and schemas: more are not read.
const LONGEST_NAME: usize = 1024;
const MOST_CHANNELS: usize = 10_000;

/// Bytes that are read from a file at once (chosen).
const BUFFER: usize = 256 << 10;

/// Bytes of opcode and length in front of a record, and of the numbers in front of a message's body and of a chunk's name.
const RECORD_HEAD: u64 = 9;
const MESSAGE_HEAD: u64 = 22;
const CHUNK_HEAD: u64 = 28;

/// The first bytes of a zstd frame (RFC 8878). No message begins with them: the first byte of CDR is 0.
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// The problem of a bag in SQLite, with the remedy.
pub(crate) const SQLITE_BAG: &str = "a bag of ROS 2 in SQLite; convert it: rosbags-convert --src FOLDER --dst NEW --dst-storage mcap";

/// The problem of a file that is compressed as a whole, with the remedy.
pub(crate) const COMPRESSED_FILE: &str = "compressed as a whole; unpack it first: zstd -d FILE";

/// Opcodes of the records that are read.
mod opcode {
    pub(super) const SCHEMA: u8 = 3;
    pub(super) const CHANNEL: u8 = 4;
    pub(super) const MESSAGE: u8 = 5;
    pub(super) const CHUNK: u8 = 6;
    pub(super) const DATA_END: u8 = 15;
}

/// The next thing in a recording.
#[derive(Debug)]
pub(crate) enum Event {
    /// A message, whose body may be read next.
    Message(Message),
    /// All messages since the last chunk are intact.
    ChunkRead,
    /// The messages since the last chunk may be wrong; the rest of the chunk was skipped.
    ChunkDamaged {
        /// Log times of the chunk.
        times: [Nanoseconds; 2],
        problem: String,
    },
    /// The file ends before its end record, or has something else where a record is expected. Nothing follows.
    Cut(String),
}

/// A message without its body.
#[derive(Debug, Clone)]
pub(crate) struct Message {
    pub(crate) channel: Arc<Channel>,
    /// Time at which it was recorded.
    pub(crate) log_time: Nanoseconds,
    /// Bytes of the body.
    pub(crate) length: u64,
    /// Whether it is in a chunk, whose checksum is compared when the chunk ends.
    pub(crate) is_in_chunk: bool,
}

/// A recording that is being read.
pub(crate) struct McapReader<R: Read> {
    source: Source<R>,
    /// Bytes of the file.
    length: u64,
    /// Place in the file of the record after the current one.
    next_record: u64,
    /// Bytes of the current record that are not read.
    unread: u64,
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, Arc<Channel>>,
    /// Messages whose channel is not described.
    pub(crate) without_channel: u64,
    body: Vec<u8>,
    /// The problem of a body that could not be read.
    broken: Option<String>,
}

enum Source<R: Read> {
    File(BufReader<R>),
    Chunk(Chunk<R>),
    Ended,
}

#[derive(Debug)]
struct Schema {
    name: String,
    definition: Vec<u8>,
}

/// A problem while reading.
enum Fault {
    /// The bytes end, or are not as expected.
    Broken(String),
    /// The chunk cannot be opened; the file is at its records.
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
    pub(crate) fn open(mut file: R) -> Result<Self, String> {
        let length = file.seek(SeekFrom::End(0));
        let length = length
            .and_then(|length| file.rewind().map(|()| length))
            .map_err(|e| e.to_string())?;
        let mut file = BufReader::with_capacity(BUFFER, file);
        if length == 0 {
            return Err("the file is empty, as a recorder leaves it that is killed".to_owned());
        }
        let mut magic = [0; MAGIC.len()];
        let read = file.read_exact(&mut magic);
        if read.is_err() || magic != MAGIC {
            return Err(not_mcap(&magic));
        }
        Ok(Self {
            source: Source::File(file),
            length,
            next_record: MAGIC.len() as u64,
            unread: 0,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            without_channel: 0,
            body: Vec::new(),
            broken: None,
        })
    }

    /// The next event; `None` at the end.
    pub(crate) fn next(&mut self) -> Option<Event> {
        loop {
            if matches!(self.source, Source::Ended) {
                return None;
            }
            match self.step() {
                Ok(None) => {}
                Ok(Some(event)) => return Some(event),
                Err(fault) => return Some(self.recover(fault)),
            }
        }
    }

    /// Bytes of the file up to the end of the current record.
    pub(crate) fn position(&self) -> u64 {
        self.next_record.min(self.length)
    }

    /// The body of the message of the last event, unpacked if its recorder compressed each message alone; `None` if it cannot be read:
    /// then the next event gives the reason.
    pub(crate) fn body(&mut self) -> Option<&[u8]> {
        self.read_body(self.unread)?;
        if self.body.starts_with(&ZSTD_MAGIC)
            && let Some(body) = unpacked(&self.body)
        {
            self.body = body;
        }
        Some(&self.body)
    }

    /// The first bytes of the body, at least `least` if it has as many; `None` as of [`Self::body`], which has them again.
    pub(crate) fn start_of_body(&mut self, least: u64) -> Option<&[u8]> {
        self.read_body(self.unread.min(least))?;
        if self.body.starts_with(&ZSTD_MAGIC) {
            return self.body();
        }
        Some(&self.body)
    }

    /// The body that was read, taken out.
    pub(crate) fn take_body(&mut self) -> Vec<u8> {
        mem::take(&mut self.body)
    }

    /// Appends bytes of the current record to the body, and returns all of it.
    fn read_body(&mut self, count: u64) -> Option<&[u8]> {
        let Self {
            source,
            body,
            unread,
            ..
        } = self;
        body.reserve_exact(count.min(LARGEST_MESSAGE) as usize);
        let read = match source {
            Source::File(file) => file.take(count).read_to_end(body),
            Source::Chunk(chunk) => chunk.take(count).read_to_end(body),
            Source::Ended => Ok(0),
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

    /// Reads to the end of the current record, and the start of the next one.
    fn step(&mut self) -> Result<Option<Event>, Fault> {
        if let Some(problem) = self.broken.take() {
            return Err(problem.into());
        }
        self.skip_rest()?;
        self.body.clear();
        match mem::replace(&mut self.source, Source::Ended) {
            Source::Chunk(chunk) if chunk.left == 0 => return self.end_chunk(chunk),
            source => self.source = source,
        }
        let (opcode, length) = self.record_head()?;
        match opcode {
            opcode::MESSAGE => return self.message(length),
            opcode::SCHEMA => {
                if let Some(record) = self.definition(length)? {
                    self.schema(&record)?;
                }
            }
            opcode::CHANNEL => {
                if let Some(record) = self.definition(length)? {
                    self.channel(&record)?;
                }
            }
            opcode::CHUNK if matches!(self.source, Source::File(_)) => self.chunk(length)?,
            opcode::DATA_END if matches!(self.source, Source::File(_)) => {
                self.source = Source::Ended;
            }
            _ => self.unread = length,
        }
        Ok(None)
    }

    /// The event for a fault, after which reading goes on behind the damaged chunk or ends.
    fn recover(&mut self, fault: Fault) -> Event {
        self.unread = 0;
        let is_whole = self.next_record <= self.length;
        let source = mem::replace(&mut self.source, Source::Ended);
        let (file, times, problem) = match (source, fault) {
            (Source::Chunk(chunk), Fault::Broken(problem)) if is_whole => {
                let times = chunk.times;
                (chunk.into_file().ok(), times, problem)
            }
            (Source::File(file), Fault::UnreadableChunk { times, problem }) => {
                (Some(file), times, problem)
            }
            (_, Fault::Broken(problem) | Fault::UnreadableChunk { problem, .. }) => {
                return Event::Cut(problem);
            }
        };
        if let Some(mut file) = file
            && file.seek(SeekFrom::Start(self.next_record)).is_ok()
        {
            self.source = Source::File(file);
        }
        let times = times.map(u64::cast_signed);
        Event::ChunkDamaged { times, problem }
    }

    /// Skips the rest of the current record.
    fn skip_rest(&mut self) -> Result<(), Fault> {
        let count = mem::take(&mut self.unread);
        match &mut self.source {
            Source::File(file) => {
                if self.next_record > self.length {
                    return Err(io::Error::from(ErrorKind::UnexpectedEof).into());
                }
                file.seek_relative(count.cast_signed())?;
            }
            Source::Chunk(chunk) => {
                if io::copy(&mut chunk.take(count), &mut io::sink())? < count {
                    return Err(io::Error::from(ErrorKind::UnexpectedEof).into());
                }
            }
            Source::Ended => {}
        }
        Ok(())
    }

    /// The opcode and length of the next record.
    fn record_head(&mut self) -> Result<(u8, u64), Fault> {
        let mut head = [0; RECORD_HEAD as usize];
        self.read_exact(&mut head)?;
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        match &self.source {
            Source::Chunk(chunk) if length > chunk.left => {
                return Err(
                    format!("a record of {length} bytes runs past the end of the chunk").into(),
                );
            }
            Source::Chunk(_) | Source::Ended => {}
            Source::File(_) => {
                self.next_record = self
                    .next_record
                    .saturating_add(RECORD_HEAD)
                    .saturating_add(length);
            }
        }
        Ok((opcode, length))
    }

    fn read_exact(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        match &mut self.source {
            Source::File(file) => file.read_exact(bytes),
            Source::Chunk(chunk) => chunk.read_exact(bytes),
            Source::Ended => Err(ErrorKind::UnexpectedEof.into()),
        }
    }

    fn message(&mut self, length: u64) -> Result<Option<Event>, Fault> {
        let body = length.checked_sub(MESSAGE_HEAD).ok_or_else(too_short)?;
        let mut head = [0; MESSAGE_HEAD as usize];
        self.read_exact(&mut head)?;
        let mut fields = FieldReader::unaligned(&head);
        let (id, _sequence, log_time) = (fields.u16()?, fields.u32()?, fields.u64()?);
        self.unread = body;
        if matches!(self.source, Source::File(_)) && self.next_record > self.length {
            return Err(ends_too_early().into());
        }
        let Some(channel) = self.channels.get(&id) else {
            self.without_channel += 1;
            return Ok(None);
        };
        Ok(Some(Event::Message(Message {
            channel: Arc::clone(channel),
            log_time: log_time.cast_signed(),
            length: body,
            is_in_chunk: matches!(self.source, Source::Chunk(_)),
        })))
    }

    /// The bytes of a schema or channel; `None` if it is too large, or too many are known.
    fn definition(&mut self, length: u64) -> Result<Option<Vec<u8>>, Fault> {
        self.unread = length;
        let known = self.channels.len().max(self.schemas.len());
        if length > LARGEST_DEFINITION || known > MOST_CHANNELS {
            return Ok(None);
        }
        self.read_body(length).ok_or_else(ends_too_early)?;
        Ok(Some(mem::take(&mut self.body)))
    }

    fn schema(&mut self, record: &[u8]) -> Result<(), Fault> {
        let mut fields = FieldReader::unaligned(record);
        let (id, name) = (fields.u16()?, fields.text()?);
        let _encoding = fields.text()?;
        let definition = fields.bytes()?;
        if name.len() <= LONGEST_NAME {
            let definition = kept_definition(definition);
            self.schemas.insert(id, Schema { name, definition });
        }
        Ok(())
    }

    fn channel(&mut self, record: &[u8]) -> Result<(), Fault> {
        let mut fields = FieldReader::unaligned(record);
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (topic, serialization) = (fields.text()?, fields.text()?);
        if topic.len().max(serialization.len()) > LONGEST_NAME {
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
    fn chunk(&mut self, length: u64) -> Result<(), Fault> {
        let mut head = [0; CHUNK_HEAD as usize];
        self.read_exact(&mut head)?;
        let mut fields = FieldReader::unaligned(&head);
        let times = [fields.u64()?, fields.u64()?];
        let (content, crc) = (fields.u64()?, fields.u32()?);
        let mut name_length = [0; 4];
        self.read_exact(&mut name_length)?;
        let name_length = u64::from(u32::from_le_bytes(name_length));
        let stored = length
            .checked_sub(CHUNK_HEAD + 4 + name_length + 8)
            .ok_or_else(too_short)?;
        self.unread = name_length.min(LONGEST_NAME as u64);
        let name = self.read_body(self.unread).ok_or_else(ends_too_early)?;
        let compression = String::from_utf8_lossy(name).into_owned();
        self.body.clear();
        let mut stated = [0; 8];
        self.read_exact(&mut stated)?;
        if u64::from_le_bytes(stated) != stored {
            let problem = "its length and that of its records differ".to_owned();
            return Err(Fault::UnreadableChunk { times, problem });
        }
        let header = ChunkHeader {
            times,
            length: content,
            crc,
            compression,
            stored,
        };
        if let Source::File(file) = mem::replace(&mut self.source, Source::Ended) {
            match Chunk::open(&header, file) {
                Ok(chunk) => self.source = Source::Chunk(chunk),
                Err((file, problem)) => {
                    self.source = Source::File(file);
                    return Err(Fault::UnreadableChunk { times, problem });
                }
            }
        }
        Ok(())
    }

    fn end_chunk(&mut self, chunk: Chunk<R>) -> Result<Option<Event>, Fault> {
        let (is_intact, times) = (chunk.is_intact(), chunk.times);
        self.source = Source::File(chunk.into_file()?);
        Ok(Some(if is_intact {
            Event::ChunkRead
        } else {
            Event::ChunkDamaged {
                times: times.map(u64::cast_signed),
                problem: "its checksum differs".to_owned(),
            }
        }))
    }
}

/// The content of a compressed message; `None` if it is broken, or larger than [`LARGEST_MESSAGE`].
fn unpacked(message: &[u8]) -> Option<Vec<u8>> {
    let mut body = Vec::new();
    let decoder = zstd::stream::read::Decoder::with_buffer(message).ok()?;
    let read = decoder
        .take(LARGEST_MESSAGE + 1)
        .read_to_end(&mut body)
        .ok()?;
    (read as u64 <= LARGEST_MESSAGE).then_some(body)
}

/// The problem of a file or chunk that is shorter than its records.
fn ends_too_early() -> String {
    "its bytes end too early".to_owned()
}

/// The problem of a record that is shorter than its fields.
fn too_short() -> String {
    "a record is shorter than its fields".to_owned()
}

/// The problem of a file that does not begin as an MCAP file, by its first bytes.
fn not_mcap(start: &[u8]) -> String {
    if start.starts_with(b"#ROSBAG") {
        return "a bag of ROS 1; `darkqa-eval import rosbag FILE` shows how to convert it"
            .to_owned();
    }
    if start.starts_with(b"SQLite f") {
        return SQLITE_BAG.to_owned();
    }
    if start.starts_with(&ZSTD_MAGIC) {
        return COMPRESSED_FILE.to_owned();
    }
    "not an MCAP file; a recording of ROS 2 or Foxglove that ends in .mcap expected".to_owned()
}
