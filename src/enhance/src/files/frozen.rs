//! Sizes that an exporter froze into a graph: [`traced_sizes`].
//!
//! Tracing turns `int(x.shape[2])` into a number. Such a graph declares that it accepts any size, but its Reshape operators fail at every
//! size except the traced one. The number is in their constant shapes: as the last two entries, or split into windows as the product of two
//! and two (`[1, 3, 6, 8, 8, 8]` is 48 × 64). The sizes found here are guesses that a run must confirm.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::HashMap;
use std::ops::Range;

use super::protobuf::{FieldValue, fields};

/// Range of numbers that can be the side of a size, in pixels; chosen.
const SIDES: Range<usize> = 8..4097;
/// Largest size in pixels that is tried; chosen.
const MOST_PIXELS: usize = 4 << 20;
/// Most sizes that are tried; chosen.
const MOST_SIZES: usize = 32;
/// Ratios of the image's size to that within the graph: networks halve the image up to three times.
const SCALES: [usize; 4] = [1, 2, 4, 8];

/// Constants of a graph with at most this many entries may be shapes.
const MOST_ENTRIES: usize = 8;

/// Heights and widths that may be frozen into an ONNX model, the most likely ones first; empty if there are none.
pub(crate) fn traced_sizes(model: &[u8]) -> Vec<[usize; 2]> {
    let mut found: Vec<[usize; 2]> = Vec::new();
    let shapes = shapes(model);
    let sizes: Vec<[usize; 2]> = shapes.iter().flat_map(|shape| sizes_in(shape)).collect();
    for scale in SCALES {
        for size in &sizes {
            let size = size.map(|side| side.saturating_mul(scale));
            let is_size = size.iter().all(|side| SIDES.contains(side));
            if is_size && size[0] * size[1] <= MOST_PIXELS && !found.contains(&size) {
                found.push(size);
            }
        }
    }
    found.truncate(MOST_SIZES);
    found
}

/// Heights and widths that a shape may hold, with the channels before or after them.
fn sizes_in(shape: &[usize]) -> Vec<[usize; 2]> {
    let product = |pair: &[usize]| pair[0].saturating_mul(pair[1]);
    let windows = |four: &[usize]| [product(&four[..2]), product(&four[2..])];
    let mut sizes = Vec::new();
    // Batch and channels come first; of channels last there is one entry behind.
    for end in [shape.len(), shape.len().saturating_sub(1)] {
        if end >= 5 {
            sizes.push(windows(&shape[end - 4..end]));
        }
        if end >= 3 {
            sizes.push([shape[end - 2], shape[end - 1]]);
        }
    }
    sizes
}

/// The constant shapes that Reshape, Expand and Resize operators of the graph take. A shape with an entry that is not a
/// positive number (0 and −1 keep or infer a size) is none.
fn shapes(model: &[u8]) -> Vec<Vec<usize>> {
    let mut constants: HashMap<Vec<u8>, Vec<usize>> = HashMap::new();
    let mut used = Vec::new();
    // PyTorch writes the sizes of a resize as batch and channels, joined with height and width.
    let mut joined: HashMap<Vec<u8>, Range<usize>> = HashMap::new();
    for graph in parts(model, 0..model.len(), 7) {
        for tensor in parts(model, graph.clone(), 5) {
            let (name, values) = tensor_of(model, tensor);
            constants.insert(name, values);
        }
        for node in parts(model, graph, 1) {
            let operator = parts(model, node.clone(), 4).pop().map(|at| &model[at]);
            let inputs = parts(model, node.clone(), 1);
            match operator {
                Some(b"Constant") => {
                    let attributes = parts(model, node.clone(), 5);
                    let tensors = attributes.into_iter().flat_map(|at| parts(model, at, 5));
                    let outputs = parts(model, node, 2);
                    if let (Some(tensor), Some(name)) = (tensors.last(), outputs.first()) {
                        let values = tensor_of(model, tensor).1;
                        constants.insert(model[name.clone()].to_vec(), values);
                    }
                }
                Some(b"Concat") => {
                    let outputs = parts(model, node, 2);
                    if let (Some(last), Some(name)) = (inputs.last(), outputs.first()) {
                        joined.insert(model[name.clone()].to_vec(), last.clone());
                    }
                }
                Some(b"Reshape" | b"Expand") => used.extend(inputs.get(1).cloned()),
                Some(b"Resize") => used.extend(inputs.get(3).cloned()),
                _ => {}
            }
        }
    }
    used.into_iter()
        .filter_map(|name| {
            let shape = constants.get(&model[name.clone()]).cloned();
            shape.or_else(|| {
                let last = constants.get(&model[joined.get(&model[name])?.clone()])?;
                (last.len() == 2).then(|| [&[1], &last[..]].concat())
            })
        })
        .filter(|shape| !shape.is_empty())
        .collect()
}

/// Positions of the strings and messages in one field of a message.
fn parts(model: &[u8], message: Range<usize>, field: u64) -> Vec<Range<usize>> {
    fields(model, message)
        .filter_map(|part| match part {
            Ok((number, FieldValue::Bytes(bytes))) if number == field => Some(bytes),
            _ => None,
        })
        .collect()
}

/// Name of a tensor, and its entries if they are a few positive 64-bit integers, else none.
fn tensor_of(model: &[u8], tensor: Range<usize>) -> (Vec<u8>, Vec<usize>) {
    const INT64: u64 = 7;
    let (mut name, mut element, mut values) = (Vec::new(), 0, Vec::new());
    for field in fields(model, tensor) {
        match field {
            Ok((2, FieldValue::Varint(value))) => element = value,
            Ok((8, FieldValue::Bytes(bytes))) => name = model[bytes].to_vec(),
            // int64_data, one by one
            Ok((7, FieldValue::Varint(value))) => values.push(value as i64),
            // raw_data
            Ok((9, FieldValue::Bytes(bytes))) if bytes.len() <= 8 * MOST_ENTRIES => {
                let (entries, _) = model[bytes].as_chunks::<8>();
                values.extend(entries.iter().map(|entry| i64::from_le_bytes(*entry)));
            }
            // int64_data, packed: written as a message of varints without keys
            Ok((7, FieldValue::Bytes(bytes))) => values.extend(packed(&model[bytes])),
            _ => {}
        }
    }
    let entries: Option<Vec<usize>> = values
        .iter()
        .map(|value: &i64| usize::try_from(*value).ok().filter(|value| *value > 0))
        .collect();
    let entries = entries.filter(|entries| element == INT64 && entries.len() <= MOST_ENTRIES);
    (name, entries.unwrap_or_default())
}

/// Packed varints, at most one more than [`MOST_ENTRIES`].
fn packed(bytes: &[u8]) -> Vec<i64> {
    let (mut values, mut value, mut shift) = (Vec::new(), 0_u64, 0);
    for byte in bytes {
        if shift > 63 || values.len() > MOST_ENTRIES {
            break;
        }
        value |= u64::from(byte & 0x7f) << shift;
        shift += 7;
        if *byte < 0x80 {
            values.push(value as i64);
            (value, shift) = (0, 0);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(number: u8, content: &[u8]) -> Vec<u8> {
        let length = u8::try_from(content.len()).unwrap();
        [&[number << 3 | 2, length], content].concat()
    }

    /// A model with one operator that takes a constant shape, given as raw data or as packed varints.
    fn model(operator: &[u8], shape: &[i64], raw: bool) -> Vec<u8> {
        let data = if raw {
            let bytes: Vec<u8> = shape.iter().flat_map(|entry| entry.to_le_bytes()).collect();
            field(9, &bytes)
        } else {
            field(
                7,
                &shape.iter().map(|entry| *entry as u8).collect::<Vec<_>>(),
            )
        };
        let tensor = [vec![2 << 3, 7], field(8, b"s"), data].concat();
        let node = [
            field(1, b"x"),
            field(1, b"s"),
            field(2, b"y"),
            field(4, operator),
        ]
        .concat();
        field(7, &[field(1, &node), field(5, &tensor)].concat())
    }

    #[test]
    fn sizes_stand_in_the_shapes_of_reshape() {
        for raw in [true, false] {
            let windows = traced_sizes(&model(b"Reshape", &[1, 3, 6, 8, 8, 8], raw));
            assert_eq!(windows[0], [48, 64], "{windows:?}");
            let plain = traced_sizes(&model(b"Reshape", &[1, 3, 48, 64], raw));
            assert_eq!(plain[0], [48, 64], "{plain:?}");
            // Channels last, and half the size within the graph.
            let last = traced_sizes(&model(b"Reshape", &[1, 24, 32, 16], raw));
            assert!(last.contains(&[48, 64]), "{last:?}");
        }
    }

    #[test]
    fn other_constants_are_no_sizes() {
        for (operator, shape) in [
            (&b"Concat"[..], vec![1, 3, 48, 64]),
            (b"Reshape", vec![1, 3, -1, 64]),
            (b"Reshape", vec![0, 3, 48, 64]),
            (b"Reshape", vec![1, 3, 5, 64]),
            (b"Reshape", vec![]),
            (b"Reshape", vec![1, 3, i64::MAX, i64::MAX]),
        ] {
            let sizes = traced_sizes(&model(operator, &shape, true));
            let whole = sizes.iter().filter(|size| **size == [48, 64]);
            assert_eq!(whole.count(), 0, "{sizes:?}");
        }
        assert!(traced_sizes(b"not a model").is_empty());
    }
}
