use std::io::Write as _;

use super::*;

/// Writer of a file in the layout that h5py uses by default.
struct FileWriter {
    file: Vec<u8>,
}

impl FileWriter {
    fn new() -> Self {
        let mut file = SIGNATURE.to_vec();
        file.extend([0, 0, 0, 0, 0, 8, 8, 0, 4, 0, 16, 0, 0, 0, 0, 0]);
        for number in [0, u64::MAX, 0, u64::MAX, 0, 96, 0, 0, 0] {
            file.extend(number.to_le_bytes());
        }
        file.resize(96, 0);
        Self { file }
    }

    /// Appends a structure at the next multiple of 8 bytes and returns its address.
    fn append(&mut self, bytes: &[u8]) -> u64 {
        self.file.resize(self.file.len().next_multiple_of(8), 0);
        let at = self.file.len() as u64;
        self.file.extend(bytes);
        at
    }

    /// An object header of version 1 with these messages (type and data).
    fn header(messages: &[(u16, Vec<u8>)]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, data) in messages {
            let size = data.len().next_multiple_of(8);
            body.extend(kind.to_le_bytes());
            body.extend((size as u16).to_le_bytes());
            body.extend([0; 4]);
            body.extend(data);
            body.resize(body.len() + size - data.len(), 0);
        }
        let mut header = vec![1, 0];
        header.extend((messages.len() as u16).to_le_bytes());
        header.extend(1_u32.to_le_bytes());
        header.extend((body.len() as u32).to_le_bytes());
        header.extend([0; 4]);
        header.extend(body);
        header
    }
}

/// Little-endian bytes of 64-bit numbers.
fn u64_bytes(numbers: &[u64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// A file with one array of `size` (rows, columns) in storage of the given chunk size; contiguous without one. `class`
/// and `bits` are the datatype fields of the numbers.
fn file(class: u8, bits: u8, size: (u64, u64), data: &[u8], chunk: Option<(u64, u64)>) -> Vec<u8> {
    let width = data.len() as u64 / (size.0 * size.1);
    let mut writer = FileWriter::new();
    // The header of the root group comes first; its addresses are writer last.
    let root = writer.append(&FileWriter::header(&[(17, vec![0; 16])]));
    assert_eq!(root, 96);
    let mut dataspace = vec![1, 2, 0, 0, 0, 0, 0, 0];
    dataspace.extend(u64_bytes(&[size.0, size.1]));
    let mut datatype = vec![16 | class, bits, 0, 0];
    datatype.extend((width as u32).to_le_bytes());
    let mut messages = vec![(1, dataspace), (3, datatype)];
    match chunk {
        None => {
            let at = writer.append(data);
            let mut layout = vec![3, 1];
            layout.extend(u64_bytes(&[at, data.len() as u64]));
            messages.push((8, layout));
        }
        Some((height, chunk_width)) => {
            let mut entries = Vec::new();
            for top in (0..size.0).step_by(height as usize) {
                for left in (0..size.1).step_by(chunk_width as usize) {
                    let mut plain = vec![0; (height * chunk_width * width) as usize];
                    for (row, column) in (0..height).flat_map(|row| (0..chunk_width).map(move |column| (row, column))) {
                        if top + row < size.0 && left + column < size.1 {
                            let from = (((top + row) * size.1 + left + column) * width) as usize;
                            let to = ((row * chunk_width + column) * width) as usize;
                            plain[to..to + width as usize].copy_from_slice(&data[from..from + width as usize]);
                        }
                    }
                    let count = plain.len() / width as usize;
                    let shuffled: Vec<u8> = (0..width as usize)
                        .flat_map(|byte| (0..count).map(move |number| (number, byte)))
                        .map(|(number, byte)| plain[number * width as usize + byte])
                        .collect();
                    let mut deflated = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                    deflated.write_all(&shuffled).unwrap();
                    let stored = deflated.finish().unwrap();
                    let at = writer.append(&stored);
                    let mut key = (stored.len() as u32).to_le_bytes().to_vec();
                    key.extend([0; 4]);
                    key.extend(u64_bytes(&[top, left, 0]));
                    entries.push((key, at));
                }
            }
            let mut tree = b"TREE\x01\x00".to_vec();
            tree.extend((entries.len() as u16).to_le_bytes());
            tree.extend(u64_bytes(&[u64::MAX, u64::MAX]));
            for (key, at) in entries {
                tree.extend(key);
                tree.extend(at.to_le_bytes());
            }
            let at = writer.append(&tree);
            let mut layout = vec![3, 2, 3];
            layout.extend(at.to_le_bytes());
            for side in [height, chunk_width, width] {
                layout.extend((side as u32).to_le_bytes());
            }
            messages.push((8, layout));
            let mut filters = vec![1, 2, 0, 0, 0, 0, 0, 0];
            for (id, value) in [(2_u16, width as u32), (1, 4)] {
                for field in [id, 8, 0, 1] {
                    filters.extend(field.to_le_bytes());
                }
                filters.extend(b"filter\0\0");
                filters.extend(value.to_le_bytes());
                filters.extend([0; 4]);
            }
            messages.push((11, filters));
        }
    }
    let array = writer.append(&FileWriter::header(&messages));
    let names = writer.append(b"\0\0\0\0\0\0\0\0dataset\0");
    let mut heap = b"HEAP\0\0\0\0".to_vec();
    heap.extend(u64_bytes(&[16, u64::MAX, names]));
    let heap = writer.append(&heap);
    let mut node = b"SNOD\x01\x00\x01\x00".to_vec();
    node.extend(u64_bytes(&[8, array, 0, 0, 0]));
    let node = writer.append(&node);
    let mut tree = b"TREE\x00\x00\x01\x00".to_vec();
    tree.extend(u64_bytes(&[u64::MAX, u64::MAX, 0, node, 8]));
    let tree = writer.append(&tree);
    writer.file[120..136].copy_from_slice(&u64_bytes(&[tree, heap]));
    writer.file
}

#[test]
fn contiguous_and_chunked_arrays_are_read() {
    let ids: Vec<i16> = (0..35).map(|number| number * 3 - 1).collect();
    let ids_bytes: Vec<u8> = ids.iter().flat_map(|id| id.to_le_bytes()).collect();
    let halves: Vec<u8> = (0..35_u16).flat_map(|number| (0x3C00 + number).to_le_bytes()).collect();
    for chunk in [None, Some((2, 3)), Some((5, 7)), Some((8, 8))] {
        let array = Hdf5Array::parse(&file(0, 8, (5, 7), &ids_bytes, chunk), "dataset").unwrap();
        let found: Vec<i128> = array.numbers().unwrap().integers().unwrap().collect();
        assert_eq!(found, ids.iter().map(|id| i128::from(*id)).collect::<Vec<i128>>());
        assert_eq!(array.numbers().unwrap().size, (5, 7));
        let array = Hdf5Array::parse(&file(1, 0, (5, 7), &halves, chunk), "another name").unwrap();
        let found: Vec<f64> = array.numbers().unwrap().floats().unwrap().collect();
        assert!((found[1] - (1.0 + 1.0 / 1024.0)).abs() < 1e-9, "{found:?}");
    }
}

#[test]
fn user_blocks_are_skipped() {
    let ids: Vec<u8> = (0..70).collect();
    for chunk in [None, Some((2, 3))] {
        let whole = file(0, 8, (5, 7), &ids, chunk);
        let plain = Hdf5Array::parse(&whole, "dataset").unwrap();
        for length in [512, 1024, 2048, 1 << 20] {
            let blocked = [vec![7; length], whole.clone()].concat();
            let read = Hdf5Array::parse(&blocked, "dataset").unwrap();
            assert_eq!(read, plain);
        }
        for length in [1, 256, 513, 1536] {
            let shifted = [vec![7; length], whole.clone()].concat();
            assert_eq!(Hdf5Array::parse(&shifted, "dataset"), Err("not an HDF5 file".to_owned()));
        }
    }
}

#[test]
fn broken_files_are_refused_without_a_panic() {
    let ids: Vec<u8> = (0..70).collect();
    let whole = file(0, 8, (5, 7), &ids, Some((2, 3)));
    assert!(Hdf5Array::parse(b"PNG", "dataset").unwrap_err().contains("not an HDF5 file"));
    let mut latest = whole.clone();
    latest[8] = 2;
    assert!(Hdf5Array::parse(&latest, "dataset").unwrap_err().contains("latest"));
    for length in 0..whole.len() {
        let _ = Hdf5Array::parse(&whole[..length], "dataset");
    }
    for at in 8..whole.len() {
        for bit in [1, 0x80, 0xFF] {
            let mut damaged = whole.clone();
            damaged[at] ^= bit;
            let _ = Hdf5Array::parse(&damaged, "dataset").map(|array| array.numbers().is_ok());
        }
    }
}
