//! Image sizes that tracing froze into a graph: [`traced_sizes`].
//!
//! Tracing replaces `int(x.shape[2])` by a number. Such a graph declares that it accepts any size, but its Reshape
//! operators fail at every size except the traced one. That size can be read from their constant shapes: it is in the
//! last two entries, or each side is the product of two entries if the image is split into windows (`[1, 3, 6, 8, 8,
//! 8]` stands for 48 × 64). The sizes found here are guesses that a run must confirm.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::HashMap;
use std::ops::Range;

use super::protobuf::{FieldValue, byte_fields, fields};

/// Sides of images that are considered, in pixels; chosen.
const SIDES: Range<usize> = 8..4097;
/// Maximum area that is considered, in pixels; chosen.
const MAX_PIXELS: usize = 4 << 20;
/// Maximum number of sizes that are returned; chosen.
const MAX_SIZES: usize = 32;
/// Ratios of the image's sides to those of a feature map within the graph, for networks that halve the image up to
/// three times.
const SCALES: [usize; 4] = [1, 2, 4, 8];

/// Maximum number of entries of a constant that may be a shape.
const MAX_ENTRIES: usize = 8;

/// Heights and widths that may be frozen into an ONNX model, the most likely ones first.
pub(crate) fn traced_sizes(model: &[u8]) -> Vec<[usize; 2]> {
    let mut found: Vec<[usize; 2]> = Vec::new();
    let sizes: Vec<[usize; 2]> = constant_shapes(model).iter().flat_map(|shape| sizes_in(shape)).collect();
    for scale in SCALES {
        for size in &sizes {
            let size = size.map(|side| side.saturating_mul(scale));
            let is_size = size.iter().all(|side| SIDES.contains(side));
            if is_size && size[0] * size[1] <= MAX_PIXELS && !found.contains(&size) {
                found.push(size);
            }
        }
    }
    found.truncate(MAX_SIZES);
    found
}

/// Heights and widths that a shape may contain, for channels before or after them.
fn sizes_in(shape: &[usize]) -> Vec<[usize; 2]> {
    let mut sizes = Vec::new();
    // Height and width are at the end, or in front of the channels.
    for end in [shape.len(), shape.len().saturating_sub(1)] {
        if end >= 5 {
            sizes.push([shape[end - 4].saturating_mul(shape[end - 3]), shape[end - 2].saturating_mul(shape[end - 1])]);
        }
        if end >= 3 {
            sizes.push([shape[end - 2], shape[end - 1]]);
        }
    }
    sizes
}

/// Constant shapes that are inputs of Reshape, Expand and Resize operators. Shapes with an entry that is not positive
/// are left out (0 keeps and −1 infers a size).
fn constant_shapes(model: &[u8]) -> Vec<Vec<usize>> {
    let mut constants: HashMap<Vec<u8>, Vec<usize>> = HashMap::new();
    let mut shape_inputs = Vec::new();
    // Last input of each Concat by the name of its output: PyTorch joins batch and channels with height and width for a
    // Resize.
    let mut concat_ends: HashMap<Vec<u8>, Range<usize>> = HashMap::new();
    for graph in byte_fields(model, 0..model.len(), 7) {
        for tensor in byte_fields(model, graph.clone(), 5) {
            let (name, values) = read_tensor(model, tensor);
            constants.insert(name, values);
        }
        for node in byte_fields(model, graph, 1) {
            let operator = byte_fields(model, node.clone(), 4).last().map(|name| &model[name]);
            let mut inputs = byte_fields(model, node.clone(), 1);
            match operator {
                Some(b"Constant") => {
                    let tensor = byte_fields(model, node.clone(), 5)
                        .flat_map(|attribute| byte_fields(model, attribute, 5))
                        .last();
                    let output = byte_fields(model, node, 2).next();
                    if let (Some(tensor), Some(name)) = (tensor, output) {
                        let (_, values) = read_tensor(model, tensor);
                        constants.insert(model[name].to_vec(), values);
                    }
                }
                Some(b"Concat") => {
                    let output = byte_fields(model, node, 2).next();
                    if let (Some(last), Some(name)) = (inputs.last(), output) {
                        concat_ends.insert(model[name].to_vec(), last);
                    }
                }
                Some(b"Reshape" | b"Expand") => shape_inputs.extend(inputs.nth(1)),
                Some(b"Resize") => shape_inputs.extend(inputs.nth(3)),
                _ => {}
            }
        }
    }
    shape_inputs
        .into_iter()
        .filter_map(|name| {
            if let Some(shape) = constants.get(&model[name.clone()]) {
                return Some(shape.clone());
            }
            let end = concat_ends.get(&model[name])?.clone();
            let last = constants.get(&model[end])?;
            (last.len() == 2).then(|| [&[1], &last[..]].concat())
        })
        .filter(|shape| !shape.is_empty())
        .collect()
}

/// Name of a `TensorProto`, and its entries; these are empty unless they are at most [`MAX_ENTRIES`] positive 64-bit
/// integers.
fn read_tensor(model: &[u8], tensor: Range<usize>) -> (Vec<u8>, Vec<usize>) {
    const INT64: u64 = 7;
    let (mut name, mut element, mut values) = (Vec::new(), 0, Vec::new());
    for field in fields(model, tensor) {
        match field {
            Ok((2, FieldValue::Varint(value))) => element = value,
            Ok((8, FieldValue::Bytes(bytes))) => name = model[bytes].to_vec(),
            // int64_data, one by one
            Ok((7, FieldValue::Varint(value))) => values.push(value as i64),
            // raw_data
            Ok((9, FieldValue::Bytes(bytes))) if bytes.len() <= 8 * MAX_ENTRIES => {
                let (entries, _) = model[bytes].as_chunks::<8>();
                values.extend(entries.iter().map(|entry| i64::from_le_bytes(*entry)));
            }
            // int64_data, packed
            Ok((7, FieldValue::Bytes(bytes))) => values.extend(unpack_varints(&model[bytes])),
            _ => {}
        }
    }
    let entries = values
        .iter()
        .map(|value: &i64| usize::try_from(*value).ok().filter(|value| *value > 0))
        .collect::<Option<Vec<usize>>>()
        .filter(|entries| element == INT64 && entries.len() <= MAX_ENTRIES);
    (name, entries.unwrap_or_default())
}

/// Decodes packed varints; stops after [`MAX_ENTRIES`] + 1 of them.
fn unpack_varints(bytes: &[u8]) -> Vec<i64> {
    let (mut values, mut value, mut shift) = (Vec::new(), 0_u64, 0);
    for byte in bytes {
        if shift > 63 || values.len() > MAX_ENTRIES {
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
            field(7, &shape.iter().map(|entry| *entry as u8).collect::<Vec<_>>())
        };
        let tensor = [vec![2 << 3, 7], field(8, b"s"), data].concat();
        let node = [field(1, b"x"), field(1, b"s"), field(2, b"y"), field(4, operator)].concat();
        field(7, &[field(1, &node), field(5, &tensor)].concat())
    }

    #[test]
    fn sizes_are_found_in_the_shapes_of_reshape() {
        for raw in [true, false] {
            let windows = traced_sizes(&model(b"Reshape", &[1, 3, 6, 8, 8, 8], raw));
            assert_eq!(windows[0], [48, 64], "{windows:?}");
            let plain = traced_sizes(&model(b"Reshape", &[1, 3, 48, 64], raw));
            assert_eq!(plain[0], [48, 64], "{plain:?}");
            // A feature map of half the size, with the channels last.
            let last = traced_sizes(&model(b"Reshape", &[1, 24, 32, 16], raw));
            assert!(last.contains(&[48, 64]), "{last:?}");
        }
    }

    #[test]
    fn other_constants_give_no_sizes() {
        for (operator, shape) in [
            (&b"Concat"[..], vec![1, 3, 48, 64]),
            (b"Reshape", vec![1, 3, -1, 64]),
            (b"Reshape", vec![0, 3, 48, 64]),
            (b"Reshape", vec![1, 3, 5, 64]),
            (b"Reshape", vec![]),
            (b"Reshape", vec![1, 3, i64::MAX, i64::MAX]),
        ] {
            let sizes = traced_sizes(&model(operator, &shape, true));
            assert!(!sizes.contains(&[48, 64]), "{sizes:?}");
        }
        assert!(traced_sizes(b"not a model").is_empty());
    }
}
