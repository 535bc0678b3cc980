//! Two-dimensional arrays in HDF5 files written by h5py: [`Hdf5Array`].
//!
//! Supports the default output of h5py (HDF5 File Format Specification, version 3.0): superblock versions 0 and 1,
//! symbol-table groups, version 1 object headers, integers and floats, contiguous and chunked storage, the filters
//! deflate, shuffle and fletcher32, and user blocks. Files of `libver="latest"` are refused with a message that says
//! so.

use std::io::Read as _;

use crate::decode_rule::MAX_PIXELS;
use crate::npy::Npy;

/// The first eight bytes of every HDF5 file, after its user block if it has one.
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Maximum number of B-tree nodes visited in a file; chosen. It also ends cyclic trees.
const MAX_NODES: usize = 1 << 16;

/// A two-dimensional array.
#[derive(Debug, PartialEq, Eq)]
pub struct Hdf5Array {
    /// Height and width (rows, columns).
    size: (usize, usize),
    /// Type of the numbers, in the notation of `.npy` files.
    descr: String,
    /// The numbers, row by row.
    data: Vec<u8>,
}

impl Hdf5Array {
    /// Reads the array of this name in the root group, or the only array of the group if it has another name.
    ///
    /// # Errors
    /// If the file is broken, unsupported, or has several arrays but none of this name.
    pub fn parse(file: &[u8], name: &str) -> Result<Self, String> {
        let file = Bytes(without_user_block(file).ok_or("not an HDF5 file")?);
        let objects = file.objects(file.root_header()?)?;
        let named = objects.iter().find(|object| object.name == name);
        let array = match (named, &*objects) {
            (Some(object), _) | (None, [object]) => object.header,
            _ => {
                let names: Vec<&str> = objects.iter().take(8).map(|object| &*object.name).collect();
                let names = names.join(", ");
                return Err(format!("no array {name:?} in the HDF5 file; it holds {names}"));
            }
        };
        ArrayLayout::read(&file, array)?.read_array(&file)
    }

    /// The numbers, through the reader of `.npy` files.
    ///
    /// # Errors
    /// If their type is not supported.
    pub fn numbers(&self) -> Result<Npy<'_>, String> {
        let (rows, columns) = self.size;
        Npy::new(&self.descr, rows, columns, &self.data)
    }
}

/// The bytes of a file or of a part of it. All numbers are little-endian; addresses and lengths have 8 bytes.
#[derive(Clone, Copy)]
struct Bytes<'a>(&'a [u8]);

/// An object of a group: its name and the address of its header.
struct Object {
    name: String,
    header: u64,
}

/// A message of an object header.
struct HeaderMessage<'a> {
    kind: u64,
    data: Bytes<'a>,
}

/// The file from its signature on, to which its addresses are relative. A user block of 512 bytes, or of a power of two
/// above, may come before it.
fn without_user_block(file: &[u8]) -> Option<&[u8]> {
    let starts = std::iter::once(0).chain((9..usize::BITS).map(|exponent| 1 << exponent));
    starts.map_while(|start| file.get(start..)).find(|rest| rest.starts_with(SIGNATURE))
}

fn truncated() -> String {
    "not a whole HDF5 file: it ends too early".to_owned()
}

impl<'a> Bytes<'a> {
    /// The `length` bytes from an offset.
    fn slice(self, at: u64, length: u64) -> Result<&'a [u8], String> {
        usize::try_from(at)
            .ok()
            .zip(usize::try_from(length).ok())
            .and_then(|(start, length)| self.0.get(start..start.checked_add(length)?))
            .ok_or_else(truncated)
    }

    /// An unsigned integer of at most 8 bytes.
    fn number(self, at: u64, length: u64) -> Result<u64, String> {
        let bytes = self.slice(at, length)?;
        Ok(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }

    /// An unsigned integer of 8 bytes as an index; `usize::MAX` if it does not fit.
    fn index(self, at: u64) -> Result<usize, String> {
        Ok(usize::try_from(self.number(at, 8)?).unwrap_or(usize::MAX))
    }

    /// Checks that a structure begins with its signature.
    fn expect_signature(self, at: u64, signature: &[u8]) -> Result<(), String> {
        if self.slice(at, signature.len() as u64)? == signature {
            return Ok(());
        }
        Err(format!("the HDF5 file is broken at byte {at}"))
    }

    /// The address of the object header of the root group.
    fn root_header(self) -> Result<u64, String> {
        let version = self.number(8, 1)?;
        let entry = match version {
            0 => 56,
            1 => 60,
            _ => {
                return Err(format!(
                    "the HDF5 file has the format of libver=\"latest\" (superblock {version}), which is not read; write it with h5py's \
                     default, or as .npy"
                ));
            }
        };
        if (self.number(13, 1)?, self.number(14, 1)?) != (8, 8) {
            return Err("the HDF5 file has addresses of other than 8 bytes".to_owned());
        }
        self.number(entry + 8, 8)
    }

    /// The messages of an object header.
    fn messages(self, header: u64) -> Result<Vec<HeaderMessage<'a>>, String> {
        if self.number(header, 1)? != 1 {
            return Err(
                "the HDF5 file has object headers of libver=\"latest\", which are not read; write it with h5py's default, or as .npy"
                    .to_owned(),
            );
        }
        let count = self.number(header + 2, 2)?;
        let mut blocks = vec![(header.saturating_add(16), self.number(header + 8, 4)?)];
        let mut messages = Vec::new();
        while let Some((start, length)) = blocks.pop() {
            let block = Bytes(self.slice(start, length)?);
            let mut at = 0;
            while at + 8 <= length && (messages.len() as u64) < count {
                let (kind, size) = (block.number(at, 2)?, block.number(at + 2, 2)?);
                let data = Bytes(block.slice(at + 8, size)?);
                if kind == CONTINUATION {
                    blocks.push((data.number(0, 8)?, data.number(8, 8)?));
                }
                messages.push(HeaderMessage { kind, data });
                at += 8 + size;
            }
        }
        Ok(messages)
    }

    /// The objects of a group.
    fn objects(self, group: u64) -> Result<Vec<Object>, String> {
        let messages = self.messages(group)?;
        let table = messages
            .iter()
            .find(|message| message.kind == SYMBOL_TABLE)
            .ok_or("the HDF5 file has groups that are not read; write it with h5py's default")?;
        let (tree, heap) = (table.data.number(0, 8)?, table.data.number(8, 8)?);
        self.expect_signature(heap, b"HEAP")?;
        let names = self.number(heap + 24, 8)?;
        let mut objects = Vec::new();
        for leaf in self.leaves(tree, 0, 8)? {
            self.expect_signature(leaf.address, b"SNOD")?;
            for entry in 0..self.number(leaf.address + 6, 2)? {
                let at = leaf.address + 8 + 40 * entry;
                let start = names.saturating_add(self.number(at, 8)?);
                let name = self.0.get(usize::try_from(start).map_err(|_| truncated())?..).ok_or_else(truncated)?;
                let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
                objects.push(Object {
                    name: String::from_utf8_lossy(&name[..name.len().min(255)]).into_owned(),
                    header: self.number(at + 8, 8)?,
                });
            }
        }
        Ok(objects)
    }

    /// The entries of all leaf nodes of a version 1 B-tree, whose keys have `key_size` bytes.
    fn leaves(self, tree: u64, kind: u64, key_size: u64) -> Result<Vec<Leaf<'a>>, String> {
        let (mut nodes, mut leaves, mut visited) = (vec![tree], Vec::new(), 0);
        while let Some(node) = nodes.pop() {
            visited += 1;
            if visited > MAX_NODES || leaves.len() > MAX_NODES * 64 {
                return Err("the HDF5 file is broken: one of its trees does not end".to_owned());
            }
            self.expect_signature(node, b"TREE")?;
            if self.number(node + 4, 1)? != kind {
                return Err(format!("the HDF5 file is broken at byte {node}"));
            }
            let level = self.number(node + 5, 1)?;
            for entry in 0..self.number(node + 6, 2)? {
                let at = node + 24 + (key_size + 8) * entry;
                let address = self.number(at + key_size, 8)?;
                if level > 0 {
                    nodes.push(address);
                } else {
                    let key = Bytes(self.slice(at, key_size)?);
                    leaves.push(Leaf { key, address });
                }
            }
        }
        Ok(leaves)
    }
}

/// An entry of a leaf node.
struct Leaf<'a> {
    key: Bytes<'a>,
    address: u64,
}

// Types of header messages.
const DATASPACE: u64 = 1;
const DATATYPE: u64 = 3;
const LAYOUT: u64 = 8;
const FILTERS: u64 = 11;
const CONTINUATION: u64 = 16;
const SYMBOL_TABLE: u64 = 17;

/// A filter of the chunk pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ChunkFilter {
    Deflate,
    Shuffle,
    /// A checksum of four bytes at the end, which is not verified.
    Checksum,
}

/// Storage of the numbers of an array.
#[derive(Debug)]
enum Storage {
    /// Contiguous, at an address.
    Contiguous(u64),
    /// Chunks of a height and width, listed in a B-tree.
    Chunked { tree: u64, chunk: (usize, usize) },
}

/// Size, type and storage of an array.
#[derive(Debug)]
struct ArrayLayout {
    size: (usize, usize),
    descr: String,
    /// Size of a number, in bytes.
    number_size: usize,
    storage: Storage,
    filters: Vec<ChunkFilter>,
}

impl ArrayLayout {
    fn read(file: &Bytes<'_>, header: u64) -> Result<Self, String> {
        let messages = file.messages(header)?;
        let message = |kind| messages.iter().find(|message| message.kind == kind).map(|message| message.data);
        let size = size(message(DATASPACE).ok_or_else(not_an_array)?)?;
        let (descr, number_size) = number_type(message(DATATYPE).ok_or_else(not_an_array)?)?;
        let layout = message(LAYOUT).ok_or_else(not_an_array)?;
        let storage = match (layout.number(0, 1)?, layout.number(1, 1)?) {
            (3, 1) => Storage::Contiguous(layout.number(2, 8)?),
            (3, 2) => {
                if layout.number(2, 1)? != 3 {
                    return Err("its chunks have other than two dimensions".to_owned());
                }
                Storage::Chunked {
                    tree: layout.number(3, 8)?,
                    chunk: (layout.number(11, 4)? as usize, layout.number(15, 4)? as usize),
                }
            }
            (version, class) => {
                return Err(format!(
                    "the HDF5 file stores its array in a form that is not read (layout {version}.{class}); write it with h5py's default"
                ));
            }
        };
        Ok(Self {
            size,
            descr,
            number_size,
            storage,
            filters: message(FILTERS).map_or_else(|| Ok(Vec::new()), filters)?,
        })
    }

    fn read_array(self, file: &Bytes<'_>) -> Result<Hdf5Array, String> {
        let (rows, columns) = self.size;
        let bytes = rows * columns * self.number_size;
        let data = match self.storage {
            Storage::Contiguous(at) => file.slice(at, bytes as u64)?.to_vec(),
            Storage::Chunked { tree, chunk } => self.read_chunks(file, tree, chunk)?,
        };
        Ok(Hdf5Array { size: self.size, descr: self.descr, data })
    }

    /// Reads all chunks and returns the numbers row by row.
    fn read_chunks(&self, file: &Bytes<'_>, tree: u64, chunk: (usize, usize)) -> Result<Vec<u8>, String> {
        let ((rows, columns), (chunk_height, chunk_width)) = (self.size, chunk);
        let pixels = (chunk_height as u64).saturating_mul(chunk_width as u64);
        if pixels == 0 || pixels > MAX_PIXELS {
            return Err("the HDF5 file is broken: the size of its chunks".to_owned());
        }
        let chunk_size = chunk_height * chunk_width * self.number_size;
        let mut filled = 0;
        let mut data = vec![0; rows * columns * self.number_size];
        // A key contains the stored length of the chunk, a bit mask of skipped filters, and the offset along each
        // dimension.
        for leaf in file.leaves(tree, 1, 32)? {
            let (top, left) = (leaf.key.index(8)?, leaf.key.index(16)?);
            if top >= rows || left >= columns {
                continue;
            }
            let stored = file.slice(leaf.address, leaf.key.number(0, 4)?)?;
            let samples = self.undo_filters(stored, leaf.key.number(4, 4)?, chunk_size)?;
            // Chunks at the edges reach beyond the array.
            let height = chunk_height.min(rows - top);
            let width = chunk_width.min(columns - left);
            for row in 0..height {
                let from = row * chunk_width * self.number_size;
                let to = ((top + row) * columns + left) * self.number_size;
                let length = width * self.number_size;
                data[to..to + length].copy_from_slice(&samples[from..from + length]);
            }
            filled += height * width;
        }
        if filled == rows * columns {
            return Ok(data);
        }
        Err("not a whole HDF5 file: chunks of its array are missing".to_owned())
    }

    /// Undoes the filters of a chunk and checks its length. Bit i of `skipped` is set if filter i was not used.
    fn undo_filters(&self, stored: &[u8], skipped: u64, chunk_size: usize) -> Result<Vec<u8>, String> {
        let mut bytes = stored.to_vec();
        for (_, filter) in self.filters.iter().enumerate().rev().filter(|(index, _)| skipped >> index & 1 == 0) {
            bytes = match filter {
                ChunkFilter::Checksum => {
                    bytes.truncate(bytes.len().saturating_sub(4));
                    bytes
                }
                ChunkFilter::Deflate => inflate(&bytes, chunk_size + 4)?,
                ChunkFilter::Shuffle => unshuffle(&bytes, self.number_size),
            };
        }
        if bytes.len() == chunk_size {
            return Ok(bytes);
        }
        Err("the HDF5 file is broken: a chunk has another length than it states".to_owned())
    }
}

/// The error for an object that is not an array.
fn not_an_array() -> String {
    "the HDF5 file names something that is no array".to_owned()
}

/// The height and width in a dataspace message.
fn size(message: Bytes<'_>) -> Result<(usize, usize), String> {
    let (version, rank) = (message.number(0, 1)?, message.number(1, 1)?);
    let first = if version == 1 { 8 } else { 4 };
    if rank != 2 {
        return Err(format!("its array has {rank} dimensions; height and width expected"));
    }
    let (rows, columns) = (message.number(first, 8)?, message.number(first + 8, 8)?);
    let pixels = rows.saturating_mul(columns);
    if pixels == 0 || pixels > MAX_PIXELS {
        return Err(format!("its array has {rows} × {columns} numbers; 1 to {MAX_PIXELS} expected"));
    }
    Ok((rows as usize, columns as usize))
}

/// The number type in a datatype message, in the notation of `.npy` files, and its size in bytes.
fn number_type(message: Bytes<'_>) -> Result<(String, usize), String> {
    let (class, bits, width) = (message.number(0, 1)? & 15, message.number(1, 3)?, message.number(4, 4)?);
    let letter = match class {
        0 if bits & 8 == 8 => 'i',
        0 => 'u',
        1 => 'f',
        _ => return Err("its array holds neither integers nor floats".to_owned()),
    };
    if bits & 1 == 1 || !matches!(width, 1 | 2 | 4 | 8) {
        return Err("its numbers are not little-endian with 1, 2, 4 or 8 bytes".to_owned());
    }
    let order = if width == 1 { '|' } else { '<' };
    Ok((format!("{order}{letter}{width}"), width as usize))
}

/// The filters in a filter message, in the order in which the writer applied them.
fn filters(message: Bytes<'_>) -> Result<Vec<ChunkFilter>, String> {
    let (version, count) = (message.number(0, 1)?, message.number(1, 1)?);
    let mut at = if version == 1 { 8 } else { 2 };
    let mut filters = Vec::new();
    for _ in 0..count {
        let id = message.number(at, 2)?;
        filters.push(match id {
            1 => ChunkFilter::Deflate,
            2 => ChunkFilter::Shuffle,
            3 => ChunkFilter::Checksum,
            _ => {
                return Err(format!(
                    "the HDF5 file is compressed by filter {id}, which is not read; write it with compression=\"gzip\""
                ));
            }
        });
        let has_name = version == 1 || id >= 256;
        let (name, rest) = if has_name { (message.number(at + 2, 2)?, at + 4) } else { (0, at + 2) };
        let values = message.number(rest + 2, 2)?;
        at = rest + 4 + name + 4 * values;
        if version == 1 && values % 2 == 1 {
            at += 4;
        }
    }
    Ok(filters)
}

/// Decompresses at most `max` + 1 bytes, so that the caller notices a larger chunk.
fn inflate(bytes: &[u8], max: usize) -> Result<Vec<u8>, String> {
    let mut whole = Vec::new();
    flate2::read::ZlibDecoder::new(bytes)
        .take(max as u64 + 1)
        .read_to_end(&mut whole)
        .map_err(|_| "the HDF5 file is broken: a chunk cannot be decompressed".to_owned())?;
    Ok(whole)
}

/// Reverses the shuffle filter: the input has the first bytes of all numbers, then all second bytes, and so on.
fn unshuffle(bytes: &[u8], number_size: usize) -> Vec<u8> {
    let count = bytes.len() / number_size;
    (0..count)
        .flat_map(|number| (0..number_size).map(move |byte| bytes[byte * count + number]))
        .chain(bytes[count * number_size..].iter().copied())
        .collect()
}

#[cfg(test)]
mod tests;
