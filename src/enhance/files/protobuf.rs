//! Schema-free decoding of the fields of a protobuf message: [`fields`].
//!
//! The encoding is specified in <https://protobuf.dev/programming-guides/encoding/>. Groups, which ONNX never used, are
//! refused.
//!
//! Protobuf messages of an ONNX file that contain nodes or weights: [`OnnxMessage`].
//!
//! Shapes of intermediate tensors that an exporter wrote into a graph: [`without_value_info`].
//!
//! The exporter of PyTorch (2.15, `dynamo=True`) writes wrong shapes for the inverse Fourier transform. ONNX Runtime
//! (1.31 and 1.32) then reuses a buffer of the wrong size and fails at every image size. The shapes are optional:
//! without them, ONNX Runtime computes its own.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::ops::Range;

/// Error for bytes that are not a protobuf message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Malformed;

/// Value of a field. Ranges are byte positions in the whole buffer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum FieldValue {
    Varint(u64),
    Fixed32(Range<usize>),
    Fixed64(Range<usize>),
    /// A length-delimited value: a string, bytes, a message or packed numbers.
    Bytes(Range<usize>),
}

/// Iterates over the fields of the message at the position `within` of `buffer`, as pairs of field number and value.
/// Ends after the first error.
pub(super) fn fields(buffer: &[u8], within: Range<usize>) -> FieldIter<'_> {
    let message = buffer.get(..within.end).unwrap_or_default();
    FieldIter { message, at: within.start }
}

/// Iterates over the contents of the length-delimited fields with number `wanted`, up to the first malformed field.
pub(super) fn byte_fields(buffer: &[u8], within: Range<usize>, wanted: u64) -> impl Iterator<Item = Range<usize>> {
    fields(buffer, within).filter_map(move |field| match field {
        Ok((number, FieldValue::Bytes(bytes))) if number == wanted => Some(bytes),
        _ => None,
    })
}

/// Appends a length-delimited field to a message.
pub(super) fn push_bytes(message: &mut Vec<u8>, number: u64, bytes: &[u8]) {
    push_varint(message, number << 3 | 2);
    push_varint(message, bytes.len() as u64);
    message.extend(bytes);
}

fn push_varint(message: &mut Vec<u8>, mut value: u64) {
    while value > 127 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

/// Iterator returned by [`fields`].
pub(super) struct FieldIter<'a> {
    /// The buffer up to the end of the message.
    message: &'a [u8],
    /// Position of the next field.
    at: usize,
}

impl Iterator for FieldIter<'_> {
    type Item = Result<(u64, FieldValue), Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.message.len() {
            return None;
        }
        let field = self.field();
        if field.is_none() {
            self.at = self.message.len();
        }
        Some(field.ok_or(Malformed))
    }
}

impl FieldIter<'_> {
    /// Position of the next field in the buffer.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    fn field(&mut self) -> Option<(u64, FieldValue)> {
        let key = self.varint()?;
        let value = match key & 7 {
            0 => FieldValue::Varint(self.varint()?),
            1 => FieldValue::Fixed64(self.take(8)?),
            2 => {
                let length = usize::try_from(self.varint()?).ok()?;
                FieldValue::Bytes(self.take(length)?)
            }
            5 => FieldValue::Fixed32(self.take(4)?),
            _ => return None,
        };
        // Field numbers begin at 1.
        Some((key >> 3, value)).filter(|(number, _)| *number > 0)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = *self.message.get(self.at)?;
            self.at += 1;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, length: usize) -> Option<Range<usize>> {
        let end = self.at.checked_add(length)?;
        let range = self.at..end;
        self.message.get(range.clone())?;
        self.at = end;
        Some(range)
    }
}

/// Type of a message of `onnx.proto` that can contain nodes or weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OnnxMessage {
    Model,
    Graph,
    Function,
    Node,
    Attribute,
    SparseTensor,
    Tensor,
}

impl OnnxMessage {
    /// Type of the message in the field with this number; `None` if it can contain neither nodes nor weights.
    pub(super) fn child(self, number: u64) -> Option<Self> {
        match (self, number) {
            (Self::Model, 7) | (Self::Attribute, 6 | 11) => Some(Self::Graph),
            (Self::Model, 25) => Some(Self::Function),
            (Self::Graph, 1) | (Self::Function, 7) => Some(Self::Node),
            (Self::Node, 5) => Some(Self::Attribute),
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Some(Self::SparseTensor),
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::SparseTensor, 1) => Some(Self::Tensor),
            _ => None,
        }
    }

    /// Type of the message in the field with this number; `None` if it cannot contain nodes.
    pub(super) fn child_with_nodes(self, number: u64) -> Option<Self> {
        self.child(number).filter(|child| !matches!(child, Self::SparseTensor | Self::Tensor))
    }
}

/// Operators whose shapes exporters get wrong.
const FOURIER: [&[u8]; 2] = [b"DFT", b"STFT"];

/// Copy of a model without the shapes of its intermediate tensors; `None` if the model has none, or no Fourier
/// transform.
///
/// Other models keep them, because ONNX Runtime optimises by known shapes, which may change the last bits of an image.
pub(crate) fn without_value_info(model: &[u8]) -> Option<Vec<u8>> {
    let graph = byte_fields(model, 0..model.len(), 7).next()?;
    byte_fields(model, graph.clone(), 13).next()?;
    if !has_fourier_transform(model).unwrap_or(false) {
        return None;
    }
    let mut kept = Vec::with_capacity(graph.len());
    let mut all = fields(model, graph.clone());
    let mut start = graph.start;
    while let Some(field) = all.next() {
        let (number, _) = field.ok()?;
        if number != 13 {
            kept.extend(model.get(start..all.position())?);
        }
        start = all.position();
    }
    // A message may have its fields in any order, so the graph goes to the end.
    let mut copy = Vec::with_capacity(model.len());
    let mut all = fields(model, 0..model.len());
    let mut start = 0;
    while let Some(field) = all.next() {
        match field.ok()? {
            (7, _) => {}
            _ => copy.extend(model.get(start..all.position())?),
        }
        start = all.position();
    }
    push_bytes(&mut copy, 7, &kept);
    Some(copy)
}

/// True if a node of the model's graphs or functions is a Fourier transform.
fn has_fourier_transform(model: &[u8]) -> Result<bool, Malformed> {
    let mut stack: Vec<(OnnxMessage, Range<usize>)> = vec![(OnnxMessage::Model, 0..model.len())];
    while let Some((message, range)) = stack.pop() {
        for field in fields(model, range) {
            let (number, FieldValue::Bytes(bytes)) = field? else {
                continue;
            };
            if (message, number) == (OnnxMessage::Node, 4)
                && model.get(bytes.clone()).is_some_and(|name| FOURIER.contains(&name))
            {
                return Ok(true);
            }
            if let Some(child) = message.child_with_nodes(number) {
                stack.push((child, bytes));
            }
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Vec<(u64, FieldValue)>, Malformed> {
        fields(bytes, 0..bytes.len()).collect()
    }

    #[test]
    fn fields_of_every_type_are_decoded() {
        let bytes = [
            8, 0x96, 1, // field 1: 150
            0x12, 2, b'h', b'i', // field 2: "hi"
            0x1d, 0, 0, 0, 0, // field 3: four bytes
            0x21, 0, 0, 0, 0, 0, 0, 0, 0, // field 4: eight bytes
        ];
        let expected = vec![
            (1, FieldValue::Varint(150)),
            (2, FieldValue::Bytes(5..7)),
            (3, FieldValue::Fixed32(8..12)),
            (4, FieldValue::Fixed64(13..21)),
        ];
        assert_eq!(read(&bytes), Ok(expected));
    }

    #[test]
    fn malformed_fields_end_the_iteration() {
        let cases: [&[u8]; 7] = [
            &[8],                                                      // no value
            &[0x12, 3, 0, 0],                                          // two bytes of three
            &[0x12, 0xff, 0xff, 0xff],                                 // length without an end
            &[0x0b],                                                   // a group
            &[0, 1],                                                   // field 0
            &[8, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1], // eleven bytes of varint
            &[0x12, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1],   // a length of 2^64 − 1
        ];
        for bytes in cases {
            assert_eq!(read(bytes), Err(Malformed), "{bytes:?}");
        }
    }

    fn field(number: u64, bytes: &[u8]) -> Vec<u8> {
        let mut message = Vec::new();
        push_bytes(&mut message, number, bytes);
        message
    }

    /// A model of one node, with or without the shape of a tensor.
    fn model(operator: &[u8], shapes: &[u8]) -> Vec<u8> {
        let node = field(1, &field(4, operator));
        let graph = [node, shapes.to_vec(), field(2, b"name")].concat();
        [field(2, b"pytorch"), field(7, &graph)].concat()
    }

    #[test]
    fn shapes_are_left_out_of_a_model_with_a_fourier_transform() {
        let shapes = [field(13, b"a"), field(13, b"b")].concat();
        assert_eq!(without_value_info(&model(b"DFT", &shapes)), Some(model(b"DFT", b"")));
    }

    #[test]
    fn other_models_keep_their_shapes() {
        assert_eq!(without_value_info(&model(b"Conv", &field(13, b"a"))), None);
        assert_eq!(without_value_info(&model(b"DFT", b"")), None);
        assert_eq!(without_value_info(b"not a model"), None);
    }
}
