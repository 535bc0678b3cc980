//! Shapes of intermediate tensors that an exporter wrote into a graph: [`without_value_info`].
//!
//! The exporter of PyTorch (2.15, `dynamo=True`) writes wrong shapes for the inverse Fourier transform. ONNX Runtime
//! (1.31 and 1.32) then reuses a buffer of the wrong size and fails at every image size. The shapes are optional:
//! without them, ONNX Runtime computes its own.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::ops::Range;

use super::onnx_message::OnnxMessage;
use super::protobuf::{FieldValue, Malformed, byte_fields, fields, push_bytes};

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
