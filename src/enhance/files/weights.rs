//! Weights of an ONNX model, and the flushing of subnormal ones to zero: [`Weights`].
//!
//! Training with weight decay leaves subnormal weights, below 2⁻¹²⁶. They do not affect the image, but cost some
//! processors a hundred cycles per operation. A quarter of Zero-DCE's published weights is subnormal: they made it
//! about 45 times slower on an Intel Xeon, and no slower on an AMD EPYC. ONNX Runtime's option
//! `session.set_denormal_as_zero` takes effect only in the thread that creates the first session of a process. So the
//! weights themselves are set to zero before a session is created; the images of Zero-DCE stay the same, byte for byte.
//! Weights in external files are not changed, because such models are loaded by path; for them, only the option
//! applies.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::BTreeMap;
use std::ops::Range;

use super::onnx_message::OnnxMessage;
use super::protobuf::{FieldValue, Malformed, fields};

/// Positions of the 32-bit floats in a model, and its files of external data.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Weights {
    /// Byte ranges of little-endian 32-bit floats.
    floats: Vec<Range<usize>>,
    /// Files of external data: their `location`, relative to the model's folder, and their minimum size in bytes.
    pub(crate) external: BTreeMap<String, u64>,
}

impl Weights {
    /// Finds the weights of a `ModelProto`: in its graph, subgraphs, functions and constants.
    ///
    /// # Errors
    /// If the bytes are not a protobuf message, or have no graph.
    pub(super) fn find(model: &[u8]) -> Result<Self, Malformed> {
        let mut weights = Self::default();
        let mut has_graph = false;
        // A stack instead of recursion, so that deep nesting cannot overflow the call stack.
        let mut stack = vec![(OnnxMessage::Model, 0..model.len())];
        while let Some((message, range)) = stack.pop() {
            if let OnnxMessage::Tensor = message {
                weights.add_tensor(model, range)?;
                continue;
            }
            has_graph |= matches!(message, OnnxMessage::Graph);
            for field in fields(model, range) {
                if let (number, FieldValue::Bytes(bytes)) = field?
                    && let Some(child) = message.child(number)
                {
                    stack.push((child, bytes));
                }
            }
        }
        if has_graph { Ok(weights) } else { Err(Malformed) }
    }

    /// Adds the positions of the floats of a `TensorProto`, or its file of external data.
    fn add_tensor(&mut self, model: &[u8], range: Range<usize>) -> Result<(), Malformed> {
        const FLOAT: u64 = 1;
        const EXTERNAL: u64 = 1;
        let (mut data_type, mut location) = (0, 0);
        let (mut floats, mut entries) = (Vec::new(), BTreeMap::new());
        for field in fields(model, range) {
            match field? {
                (2, FieldValue::Varint(value)) => data_type = value,
                (14, FieldValue::Varint(value)) => location = value,
                // float_data, packed or one by one; raw_data
                (4 | 9, FieldValue::Bytes(bytes)) | (4, FieldValue::Fixed32(bytes)) => {
                    floats.push(bytes);
                }
                (13, FieldValue::Bytes(entry)) => entries.extend(read_entry(model, entry)?),
                _ => {}
            }
        }
        if location == EXTERNAL {
            let [offset, length] = ["offset", "length"]
                .map(|key| entries.get(key).and_then(|text: &String| text.parse().ok()).unwrap_or(0_u64));
            let end = offset.saturating_add(length);
            if let Some(location) = entries.get("location") {
                let size = self.external.entry(location.clone()).or_default();
                *size = end.max(*size);
            }
        } else if data_type == FLOAT {
            self.floats.extend(floats);
        }
        Ok(())
    }

    /// Sets every subnormal float of `model` to zero, keeping its sign; returns the number of changed floats.
    ///
    /// `model` must be the buffer that was passed to [`Weights::find`].
    pub(crate) fn flush_subnormals(&self, model: &mut [u8]) -> usize {
        let mut flushed = 0;
        for range in &self.floats {
            let bytes = model.get_mut(range.clone()).unwrap_or_default();
            let (floats, _) = bytes.as_chunks_mut::<4>();
            for float in floats {
                let value = f32::from_le_bytes(*float);
                if value.is_subnormal() {
                    *float = 0.0_f32.copysign(value).to_le_bytes();
                    flushed += 1;
                }
            }
        }
        flushed
    }
}

/// Key and value of a `StringStringEntryProto`; `None` if one is missing.
fn read_entry(model: &[u8], entry: Range<usize>) -> Result<Option<(String, String)>, Malformed> {
    let (mut key, mut value) = (None, None);
    for field in fields(model, entry) {
        match field? {
            (1, FieldValue::Bytes(bytes)) => key = model.get(bytes),
            (2, FieldValue::Bytes(bytes)) => value = model.get(bytes),
            _ => {}
        }
    }
    let (Some(key), Some(value)) = (key, value) else {
        return Ok(None);
    };
    Ok(Some((decode_utf8(key)?, decode_utf8(value)?)))
}

fn decode_utf8(bytes: &[u8]) -> Result<String, Malformed> {
    String::from_utf8(bytes.to_vec()).map_err(|_| Malformed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SUBNORMAL: f32 = 1e-40;

    /// A length-delimited field of fewer than 128 bytes.
    fn field(number: u8, content: &[u8]) -> Vec<u8> {
        let length = u8::try_from(content.len()).unwrap();
        assert!(number < 16 && length < 128);
        [&[number << 3 | 2, length], content].concat()
    }

    /// A tensor of the given type with its data in the field `number`.
    fn tensor(data_type: u8, number: u8, floats: &[f32]) -> Vec<u8> {
        let bytes: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
        [&[2 << 3, data_type], field(number, &bytes).as_slice()].concat()
    }

    fn model(graph: &[u8]) -> Vec<u8> {
        [&[8, 8], field(7, graph).as_slice()].concat()
    }

    /// Flushes the subnormal weights of a model; returns their number and the changed bytes.
    fn flush(mut bytes: Vec<u8>) -> (usize, Vec<u8>) {
        let count = Weights::find(&bytes).unwrap().flush_subnormals(&mut bytes);
        (count, bytes)
    }

    #[test]
    fn raw_and_packed_weights_are_flushed_with_their_sign() {
        let weights = [1.0, SUBNORMAL, -SUBNORMAL, 0.5, f32::MIN_POSITIVE];
        for number in [4, 9] {
            let (count, bytes) = flush(model(&field(5, &tensor(1, number, &weights))));
            let zeroed = [1.0, 0.0, -0.0, 0.5, f32::MIN_POSITIVE];
            let expected = model(&field(5, &tensor(1, number, &zeroed)));
            assert_eq!((count, bytes), (2, expected));
        }
    }

    #[test]
    fn unpacked_weights_are_flushed() {
        let tensor = [&[16, 1, 0x25], SUBNORMAL.to_le_bytes().as_slice()].concat();
        let (count, bytes) = flush(model(&field(5, &tensor)));
        assert_eq!(count, 1);
        assert!(bytes.ends_with(&[0; 4]));
    }

    #[test]
    fn weights_in_constants_and_subgraphs_are_flushed() {
        let tensor = tensor(1, 9, &[SUBNORMAL]);
        let constant = field(1, &field(5, &field(5, &tensor)));
        let inside = field(1, &field(5, &field(6, &field(5, &tensor))));
        for graph in [constant, inside] {
            assert_eq!(flush(model(&graph)).0, 1);
        }
    }

    #[test]
    fn other_types_keep_their_bytes() {
        // The same bytes as int64 (data type 7).
        let bytes = model(&field(5, &tensor(7, 9, &[SUBNORMAL; 2])));
        assert_eq!(flush(bytes.clone()), (0, bytes));
    }

    #[test]
    fn external_data_is_listed_with_its_minimum_size() {
        let entry = [field(1, b"location"), field(2, b"weights.bin")].concat();
        let offset = [field(1, b"offset"), field(2, b"8")].concat();
        let length = [field(1, b"length"), field(2, b"12")].concat();
        let content =
            [&[16, 1, 14 << 3, 1], field(13, &entry).as_slice(), &field(13, &offset), &field(13, &length)].concat();
        let weights = Weights::find(&model(&field(5, &content))).unwrap();
        let expected = BTreeMap::from([("weights.bin".to_owned(), 20)]);
        assert_eq!(weights.external, expected);
        assert!(weights.floats.is_empty());
    }

    #[test]
    fn bytes_that_are_not_a_model_are_refused() {
        let cases: [&[u8]; 5] = [
            b"",
            b"hello",
            b"version https://git-lfs.github.com/spec/v1",
            b"<html>",
            &[8, 8], // a version and no graph
        ];
        for bytes in cases {
            assert_eq!(Weights::find(bytes), Err(Malformed), "{bytes:?}");
        }
    }

    #[test]
    fn deep_nesting_is_searched() {
        // Lengths beyond 127 need longer varints than `field` writes.
        let mut graph = Vec::new();
        for _ in 0..20_000 {
            for number in [6, 5, 1] {
                let mut length = graph.len();
                let mut wrapped = vec![number << 3 | 2];
                while length > 127 {
                    wrapped.push(length as u8 | 0x80);
                    length >>= 7;
                }
                wrapped.push(length as u8);
                // Built in reverse, so that wrapping is cheap.
                graph.extend(wrapped.into_iter().rev());
            }
        }
        graph.reverse();
        let mut bytes = vec![7 << 3 | 2];
        let mut length = graph.len();
        while length > 127 {
            bytes.push(length as u8 | 0x80);
            length >>= 7;
        }
        bytes.push(length as u8);
        bytes.extend(graph);
        assert_eq!(Weights::find(&bytes), Ok(Weights::default()));
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_cause_no_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut bytes = bytes;
            if let Ok(weights) = Weights::find(&bytes) {
                weights.flush_subnormals(&mut bytes);
            }
        }

        #[test]
        fn damaged_models_cause_no_panic(
            cut in 0_usize..60,
            at in 0_usize..60,
            byte in any::<u8>(),
        ) {
            let mut bytes = model(&field(5, &tensor(1, 9, &[SUBNORMAL; 4])));
            let length = bytes.len();
            bytes[at % length] = byte;
            bytes.truncate(length - cut % length);
            if let Ok(weights) = Weights::find(&bytes) {
                weights.flush_subnormals(&mut bytes);
            }
        }
    }
}
