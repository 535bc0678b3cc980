//! Two-dimensional arrays in HDF5 files, as h5py writes them: [`Hdf5Array`].
//!
//! Supports the library's default output (HDF5 File Format Specification, version 3.0): superblocks 0 and 1, groups as symbol tables,
//! object headers of version 1, integers and floats, arrays in one piece or in chunks, with the filters deflate, shuffle and fletcher32.
//! Files of `libver="latest"` are refused by name.

use std::io::Read as _;

use crate::npy::Npy;
use crate::reading_rule::MOST_PIXELS;

/// The first eight bytes of every file.
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// The most nodes of trees that are visited in a file; chosen. It also ends trees that go in a circle.
const MOST_NODES: usize = 1 << 16;

/// An array of two dimensions.
#[derive(Debug, PartialEq, Eq)]
pub struct Hdf5Array {
    /// Height and width (rows, columns).
    size: (usize, usize),
    /// The type of the numbers, as `.npy` files state it.
    descr: String,
    /// The numbers, row by row.
    data: Vec<u8>,
}

impl Hdf5Array {
    /// Reads the array of this name in the root group; if there is none, the only array of the group.
    ///
    /// # Errors
    /// If the file is broken, or holds anything else. The error names the fault.
    pub fn parse(file: &[u8], name: &str) -> Result<Self, String> {
        let file = Bytes(file);
        let root = file.root()?;
        let objects = file.objects(root)?;
        let named = objects.iter().find(|object| object.name == name);
        let array = match (named, &*objects) {
            (Some(object), _) | (None, [object]) => object.header,
            _ => {
                let names: Vec<&str> = objects.iter().take(8).map(|object| &*object.name).collect();
                let names = names.join(", ");
                return Err(format!(
                    "no array {name:?} in the HDF5 file; it holds {names}"
                ));
            }
        };
        let layout = ArrayLayout::read(&file, array)?;
        layout.array(&file)
    }

    /// The numbers as those of a `.npy` file.
    ///
    /// # Errors
    /// If their type is none that is read.
    pub fn numbers(&self) -> Result<Npy<'_>, String> {
        Npy::new(&self.descr, self.size, &self.data)
    }
}

/// The bytes of a file. All numbers are little-endian; addresses and lengths have 8 bytes.
#[derive(Clone, Copy)]
struct Bytes<'a>(&'a [u8]);

/// An object of a group: its name and the address of its header.
struct Object {
    name: String,
    header: u64,
}

/// A message of an object header.
struct Message<'a> {
    kind: u64,
    data: Bytes<'a>,
}

fn cut() -> String {
    "not a whole HDF5 file: it ends too early".to_owned()
}

impl<'a> Bytes<'a> {
    /// Some bytes.
    fn part(self, at: u64, length: u64) -> Result<&'a [u8], String> {
        let part = || {
            let at = usize::try_from(at).ok()?;
            let end = at.checked_add(usize::try_from(length).ok()?)?;
            self.0.get(at..end)
        };
        part().ok_or_else(cut)
    }

    /// A whole number of at most 8 bytes.
    fn number(self, at: u64, length: u64) -> Result<u64, String> {
        let bytes = self.part(at, length)?;
        Ok(bytes
            .iter()
            .rev()
            .fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }

    /// Checks that bytes begin with a mark.
    fn expect(self, at: u64, mark: &[u8]) -> Result<(), String> {
        if self.part(at, mark.len() as u64)? == mark {
            return Ok(());
        }
        Err(format!("the HDF5 file is broken at byte {at}"))
    }

    /// The address of the header of the root group.
    fn root(self) -> Result<u64, String> {
        if !self.0.starts_with(SIGNATURE) {
            return Err("not an HDF5 file".to_owned());
        }
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
    fn messages(self, header: u64) -> Result<Vec<Message<'a>>, String> {
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
            let block = Bytes(self.part(start, length)?);
            let mut at = 0;
            while at + 8 <= length && (messages.len() as u64) < count {
                let (kind, size) = (block.number(at, 2)?, block.number(at + 2, 2)?);
                let data = Bytes(block.part(at + 8, size)?);
                if kind == CONTINUATION {
                    blocks.push((data.number(0, 8)?, data.number(8, 8)?));
                }
                messages.push(Message { kind, data });
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
        self.expect(heap, b"HEAP")?;
        let names = self.number(heap + 24, 8)?;
        let mut objects = Vec::new();
        for leaf in self.leaves(tree, 0, 8)? {
            self.expect(leaf.address, b"SNOD")?;
            for entry in 0..self.number(leaf.address + 6, 2)? {
                let at = leaf.address + 8 + 40 * entry;
                let start = names.saturating_add(self.number(at, 8)?);
                let name = self
                    .0
                    .get(usize::try_from(start).map_err(|_| cut())?..)
                    .ok_or_else(cut)?;
                let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
                objects.push(Object {
                    name: String::from_utf8_lossy(&name[..name.len().min(255)]).into_owned(),
                    header: self.number(at + 8, 8)?,
                });
            }
        }
        Ok(objects)
    }

    /// The children of all lowest nodes of a tree of version 1, with their keys.
    fn leaves(self, tree: u64, kind: u64, key: u64) -> Result<Vec<Leaf<'a>>, String> {
        let (mut nodes, mut leaves, mut visited) = (vec![tree], Vec::new(), 0);
        while let Some(node) = nodes.pop() {
            visited += 1;
            if visited > MOST_NODES || leaves.len() > MOST_NODES * 64 {
                return Err("the HDF5 file is broken: one of its trees does not end".to_owned());
            }
            self.expect(node, b"TREE")?;
            if self.number(node + 4, 1)? != kind {
                return Err(format!("the HDF5 file is broken at byte {node}"));
            }
            let level = self.number(node + 5, 1)?;
            for entry in 0..self.number(node + 6, 2)? {
                let at = node + 24 + (key + 8) * entry;
                let address = self.number(at + key, 8)?;
                if level > 0 {
                    nodes.push(address);
                } else {
                    let key = Bytes(self.part(at, key)?);
                    leaves.push(Leaf { key, address });
                }
            }
        }
        Ok(leaves)
    }
}

/// A child of a lowest node.
struct Leaf<'a> {
    key: Bytes<'a>,
    address: u64,
}

// Kinds of messages.
const DATASPACE: u64 = 1;
const DATATYPE: u64 = 3;
const LAYOUT: u64 = 8;
const FILTERS: u64 = 11;
const CONTINUATION: u64 = 16;
const SYMBOL_TABLE: u64 = 17;

/// A filter of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Filter {
    Deflate,
    Shuffle,
    /// Four bytes of a checksum at the end, which is not compared.
    Checksum,
}

/// Where the numbers of an array stand.
#[derive(Debug)]
enum Storage {
    /// In one piece at an address.
    Whole(u64),
    /// In chunks of a height and a width, by a tree.
    Chunks { tree: u64, chunk: (usize, usize) },
}

/// The form of an array.
#[derive(Debug)]
struct ArrayLayout {
    size: (usize, usize),
    descr: String,
    /// The bytes of a number.
    width: usize,
    storage: Storage,
    filters: Vec<Filter>,
}

impl ArrayLayout {
    fn read(file: &Bytes<'_>, header: u64) -> Result<Self, String> {
        let messages = file.messages(header)?;
        let message = |kind| {
            messages
                .iter()
                .find(|message| message.kind == kind)
                .map(|message| message.data)
        };
        let lacking = || "the HDF5 file names something that is no array".to_owned();
        let size = size(message(DATASPACE).ok_or_else(lacking)?)?;
        let (descr, width) = number_type(message(DATATYPE).ok_or_else(lacking)?)?;
        let layout = message(LAYOUT).ok_or_else(lacking)?;
        let storage = match (layout.number(0, 1)?, layout.number(1, 1)?) {
            (3, 1) => Storage::Whole(layout.number(2, 8)?),
            (3, 2) => {
                if layout.number(2, 1)? != 3 {
                    return Err("its chunks have other than two dimensions".to_owned());
                }
                let side = |at| layout.number(at, 4).map(|side| side as usize);
                Storage::Chunks {
                    tree: layout.number(3, 8)?,
                    chunk: (side(11)?, side(15)?),
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
            width,
            storage,
            filters: message(FILTERS).map_or_else(|| Ok(Vec::new()), filters)?,
        })
    }

    fn array(self, file: &Bytes<'_>) -> Result<Hdf5Array, String> {
        let Self {
            size: (rows, columns),
            width,
            ..
        } = self;
        let bytes = rows * columns * width;
        let data = match self.storage {
            Storage::Whole(at) => file.part(at, bytes as u64)?.to_vec(),
            Storage::Chunks { tree, chunk } => self.joined(file, tree, chunk)?,
        };
        Ok(Hdf5Array {
            size: self.size,
            descr: self.descr,
            data,
        })
    }

    /// The numbers of all chunks, row by row.
    fn joined(
        &self,
        file: &Bytes<'_>,
        tree: u64,
        chunk: (usize, usize),
    ) -> Result<Vec<u8>, String> {
        let ((rows, columns), (height, breadth)) = (self.size, chunk);
        let pixels = (height as u64).saturating_mul(breadth as u64);
        if pixels == 0 || pixels > MOST_PIXELS {
            return Err("the HDF5 file is broken: the size of its chunks".to_owned());
        }
        let (whole, mut filled) = (height * breadth * self.width, 0);
        let mut data = vec![0; rows * columns * self.width];
        // A key has the length of the chunk, the filters left out, and the place along each dimension and in a number.
        for leaf in file.leaves(tree, 1, 32)? {
            let place = |at| {
                leaf.key
                    .number(at, 8)
                    .map(|place| usize::try_from(place).unwrap_or(usize::MAX))
            };
            let (top, left) = (place(8)?, place(16)?);
            if top >= rows || left >= columns {
                continue;
            }
            let stored = file.part(leaf.address, leaf.key.number(0, 4)?)?;
            let samples = self.unfiltered(stored, leaf.key.number(4, 4)?, whole)?;
            let (high, wide) = (height.min(rows - top), breadth.min(columns - left));
            for row in 0..high {
                let from = row * breadth * self.width;
                let to = ((top + row) * columns + left) * self.width;
                let length = wide * self.width;
                data[to..to + length].copy_from_slice(&samples[from..from + length]);
            }
            filled += high * wide;
        }
        if filled == rows * columns {
            return Ok(data);
        }
        Err("not a whole HDF5 file: chunks of its array are missing".to_owned())
    }

    /// The bytes of a chunk before its filters. Of `left_out`, a bit each, the filters were not used.
    fn unfiltered(&self, stored: &[u8], left_out: u64, whole: usize) -> Result<Vec<u8>, String> {
        let mut bytes = stored.to_vec();
        for (_, filter) in self
            .filters
            .iter()
            .enumerate()
            .rev()
            .filter(|(place, _)| left_out >> place & 1 == 0)
        {
            bytes = match filter {
                Filter::Checksum => {
                    bytes.truncate(bytes.len().saturating_sub(4));
                    bytes
                }
                Filter::Deflate => inflated(&bytes, whole + 4)?,
                Filter::Shuffle => unshuffled(&bytes, self.width),
            };
        }
        if bytes.len() == whole {
            return Ok(bytes);
        }
        Err("the HDF5 file is broken: a chunk has another length than it states".to_owned())
    }
}

/// The height and width in a dataspace message.
fn size(message: Bytes<'_>) -> Result<(usize, usize), String> {
    let (version, rank) = (message.number(0, 1)?, message.number(1, 1)?);
    let first = if version == 1 { 8 } else { 4 };
    if rank != 2 {
        return Err(format!(
            "its array has {rank} dimensions; height and width expected"
        ));
    }
    let (rows, columns) = (message.number(first, 8)?, message.number(first + 8, 8)?);
    let pixels = rows.saturating_mul(columns);
    if pixels == 0 || pixels > MOST_PIXELS {
        return Err(format!(
            "its array has {rows} × {columns} numbers; 1 to {MOST_PIXELS} expected"
        ));
    }
    Ok((rows as usize, columns as usize))
}

/// The type in a datatype message, as `.npy` files state it, and the bytes of a number.
fn number_type(message: Bytes<'_>) -> Result<(String, usize), String> {
    let (class, bits, width) = (
        message.number(0, 1)? & 15,
        message.number(1, 3)?,
        message.number(4, 4)?,
    );
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

/// The filters in a message, in the order in which they were used.
fn filters(message: Bytes<'_>) -> Result<Vec<Filter>, String> {
    let (version, count) = (message.number(0, 1)?, message.number(1, 1)?);
    let mut at = if version == 1 { 8 } else { 2 };
    let mut filters = Vec::new();
    for _ in 0..count {
        let id = message.number(at, 2)?;
        filters.push(match id {
            1 => Filter::Deflate,
            2 => Filter::Shuffle,
            3 => Filter::Checksum,
            _ => {
                return Err(format!(
                    "the HDF5 file is compressed by filter {id}, which is not read; write it with compression=\"gzip\""
                ));
            }
        });
        let has_name = version == 1 || id >= 256;
        let (name, rest) = if has_name {
            (message.number(at + 2, 2)?, at + 4)
        } else {
            (0, at + 2)
        };
        let values = message.number(rest + 2, 2)?;
        at = rest + 4 + name + 4 * values;
        if version == 1 && values % 2 == 1 {
            at += 4;
        }
    }
    Ok(filters)
}

/// Decompressed bytes, at most this many.
fn inflated(bytes: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let mut whole = Vec::new();
    flate2::read::ZlibDecoder::new(bytes)
        .take(most as u64 + 1)
        .read_to_end(&mut whole)
        .map_err(|_| "the HDF5 file is broken: a chunk cannot be decompressed".to_owned())?;
    Ok(whole)
}

/// Reverses the shuffle filter: the input has the first bytes of all numbers, then all second bytes, and so on.
fn unshuffled(bytes: &[u8], width: usize) -> Vec<u8> {
    let count = bytes.len() / width;
    let numbers =
        (0..count).flat_map(|number| (0..width).map(move |byte| bytes[byte * count + number]));
    numbers
        .chain(bytes[count * width..].iter().copied())
        .collect()
}

#[cfg(test)]
mod tests;
