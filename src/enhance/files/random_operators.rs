//! Operators of a graph that draw random numbers, and their seeds: [`RandomOperators`].
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::protobuf::{FieldValue, Malformed, OnnxMessage, fields, push_bytes};

/// Random operators, whose attribute `seed` is a float.
const SEEDED_BY_FLOAT: [&str; 6] =
    ["RandomNormal", "RandomNormalLike", "RandomUniform", "RandomUniformLike", "Multinomial", "Bernoulli"];

/// Maximum depth of nested messages in which seeds are set; chosen.
const MAX_DEPTH: usize = 60;

/// The random operators of a model.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct RandomOperators {
    /// Names of the operators, such as `RandomNormalLike`.
    pub(crate) names: BTreeSet<String>,
    /// Byte ranges of the nodes without a seed.
    unseeded: BTreeSet<(usize, usize)>,
}

/// Properties of a `NodeProto` that show whether it is random.
struct OperatorNode {
    operator: String,
    inputs: Vec<String>,
    outputs: Vec<String>,
    /// True if the node has the attribute `seed`.
    has_seed: bool,
    /// Value of a boolean `Constant`; `None` for other nodes.
    constant: Option<bool>,
}

impl RandomOperators {
    /// Finds the random operators of a `ModelProto`, in its graph, subgraphs and functions. A dropout counts if it may
    /// be in training mode.
    ///
    /// # Errors
    /// If the bytes are not a protobuf message.
    pub(crate) fn find(model: &[u8]) -> Result<Self, Malformed> {
        let mut found = Self::default();
        let mut nodes: Vec<(Range<usize>, OperatorNode)> = Vec::new();
        let mut constants: BTreeMap<String, bool> = BTreeMap::new();
        // A stack instead of recursion, so that deep nesting cannot overflow the call stack.
        let mut stack = vec![(OnnxMessage::Model, 0..model.len())];
        while let Some((message, range)) = stack.pop() {
            if message == OnnxMessage::Node {
                nodes.push((range.clone(), OperatorNode::read(model, range.clone())?));
            }
            for field in fields(model, range) {
                let (number, FieldValue::Bytes(bytes)) = field? else {
                    continue;
                };
                if (message, number) == (OnnxMessage::Graph, 5) {
                    let (name, value) = truth_value(model, bytes.clone())?;
                    constants.extend(value.map(|value| (name, value)));
                }
                if let Some(child) = message.child_with_nodes(number) {
                    stack.push((child, bytes));
                }
            }
        }
        for (_, node) in &nodes {
            if let Some(value) = node.constant {
                constants.extend(node.outputs.iter().map(|output| (output.clone(), value)));
            }
        }
        for (range, node) in nodes {
            let is_random = SEEDED_BY_FLOAT.contains(&node.operator.as_str())
                || node.operator == "Dropout" && node.is_training(&constants);
            if is_random {
                if !node.has_seed {
                    found.unseeded.insert((range.start, range.end));
                }
                found.names.insert(node.operator);
            }
        }
        Ok(found)
    }

    /// The model with a seed added to each random operator that lacks one.
    pub(crate) fn with_seeds(&self, model: Vec<u8>) -> Vec<u8> {
        if self.unseeded.is_empty() {
            return model;
        }
        self.copy_with_seeds(&model, OnnxMessage::Model, 0..model.len(), 0).unwrap_or(model)
    }

    /// Copies the message at `range`, adding seeds to its nodes; `None` if the message is malformed.
    fn copy_with_seeds(
        &self,
        model: &[u8],
        message: OnnxMessage,
        range: Range<usize>,
        depth: usize,
    ) -> Option<Vec<u8>> {
        let is_unseeded = self.unseeded.contains(&(range.start, range.end));
        let contains_unseeded =
            self.unseeded.range((range.start, 0)..).next().is_some_and(|(start, _)| *start < range.end);
        if depth > MAX_DEPTH || !contains_unseeded {
            return Some(model.get(range)?.to_vec());
        }
        let mut copy = Vec::with_capacity(range.len() + 32);
        let mut all = fields(model, range.clone());
        let mut start = range.start;
        while let Some(field) = all.next() {
            let end = all.position();
            match field.ok()? {
                (number, FieldValue::Bytes(bytes)) if message.child_with_nodes(number).is_some() => {
                    let child = message.child_with_nodes(number)?;
                    let child = self.copy_with_seeds(model, child, bytes, depth + 1)?;
                    push_bytes(&mut copy, number, &child);
                }
                _ => copy.extend(model.get(start..end)?),
            }
            start = end;
        }
        if message == OnnxMessage::Node && is_unseeded {
            let node = OperatorNode::read(model, range).ok()?;
            push_bytes(&mut copy, 5, &seed_attribute(&node.operator));
        }
        Some(copy)
    }
}

impl OperatorNode {
    fn read(model: &[u8], range: Range<usize>) -> Result<Self, Malformed> {
        let mut node =
            Self { operator: String::new(), inputs: Vec::new(), outputs: Vec::new(), has_seed: false, constant: None };
        let mut attributes = Vec::new();
        for field in fields(model, range) {
            match field? {
                (1, FieldValue::Bytes(bytes)) => node.inputs.push(text(model, bytes)),
                (2, FieldValue::Bytes(bytes)) => node.outputs.push(text(model, bytes)),
                (4, FieldValue::Bytes(bytes)) => node.operator = text(model, bytes),
                (5, FieldValue::Bytes(bytes)) => attributes.push(bytes),
                _ => {}
            }
        }
        for attribute in attributes {
            for field in fields(model, attribute) {
                match field? {
                    (1, FieldValue::Bytes(bytes)) => node.has_seed |= text(model, bytes) == "seed",
                    (5, FieldValue::Bytes(bytes)) if node.operator == "Constant" => {
                        node.constant = truth_value(model, bytes)?.1;
                    }
                    _ => {}
                }
            }
        }
        Ok(node)
    }

    /// True if a dropout may be in training mode: it has a third input that is not the constant `false`.
    fn is_training(&self, constants: &BTreeMap<String, bool>) -> bool {
        self.inputs.get(2).filter(|name| !name.is_empty()).is_some_and(|name| constants.get(name) != Some(&false))
    }
}

/// Text of a string field.
fn text(model: &[u8], bytes: Range<usize>) -> String {
    String::from_utf8_lossy(model.get(bytes).unwrap_or_default()).into_owned()
}

/// Name of a `TensorProto`, and its first element; `None` if it is not a tensor of booleans.
fn truth_value(model: &[u8], range: Range<usize>) -> Result<(String, Option<bool>), Malformed> {
    const BOOL: u64 = 9;
    let (mut name, mut data_type, mut value) = (String::new(), 0, None);
    for field in fields(model, range) {
        match field? {
            (2, FieldValue::Varint(number)) => data_type = number,
            (8, FieldValue::Bytes(bytes)) => name = text(model, bytes),
            // int32_data, packed or not; raw_data
            (5, FieldValue::Varint(number)) => value = Some(number != 0),
            (5 | 9, FieldValue::Bytes(bytes)) => {
                value = model.get(bytes).and_then(|bytes| Some(*bytes.first()? != 0));
            }
            _ => {}
        }
    }
    Ok((name, value.filter(|_| data_type == BOOL)))
}

/// Encoded attribute `seed` of an operator, with the value 1, which no exporter writes by default.
fn seed_attribute(operator: &str) -> Vec<u8> {
    const FLOAT: u8 = 1;
    const INT: u8 = 2;
    let mut attribute = Vec::new();
    push_bytes(&mut attribute, 1, b"seed");
    if operator == "Dropout" {
        // i = 1, type
        attribute.extend([3 << 3, 1, 0xa0, 0x01, INT]);
    } else {
        // f = 1.0, type
        attribute.push(2 << 3 | 5);
        attribute.extend(1.0_f32.to_le_bytes());
        attribute.extend([0xa0, 0x01, FLOAT]);
    }
    attribute
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(number: u64, bytes: &[u8]) -> Vec<u8> {
        let mut message = Vec::new();
        push_bytes(&mut message, number, bytes);
        message
    }

    fn node(operator: &str, inputs: &[&str]) -> Vec<u8> {
        let mut node = Vec::new();
        for input in inputs {
            push_bytes(&mut node, 1, input.as_bytes());
        }
        push_bytes(&mut node, 2, b"y");
        push_bytes(&mut node, 4, operator.as_bytes());
        field(1, &node)
    }

    /// Initialiser named `mode`, a boolean.
    fn mode_initialiser(value: u8) -> Vec<u8> {
        let tensor = [&[2 << 3, 9][..], &field(8, b"mode"), &field(9, &[value])].concat();
        field(5, &tensor)
    }

    fn names(graph: &[u8]) -> Vec<String> {
        let found = RandomOperators::find(&field(7, graph)).unwrap();
        found.names.into_iter().collect()
    }

    #[test]
    fn random_operators_are_found_in_subgraphs_too() {
        let inner = node("Multinomial", &["x"]);
        let body = field(6, &inner);
        let outer = [field(4, b"If"), field(5, &body)].concat();
        let graph = [node("RandomNormal", &[]), field(1, &outer), node("Add", &["a"])].concat();
        assert_eq!(names(&graph), ["Multinomial", "RandomNormal"]);
    }

    #[test]
    fn dropout_is_random_only_in_training_mode() {
        let dropout = node("Dropout", &["x", "ratio", "mode"]);
        assert_eq!(names(&[dropout.clone(), mode_initialiser(1)].concat()), ["Dropout"]);
        assert!(names(&[dropout, mode_initialiser(0)].concat()).is_empty());
        assert!(names(&node("Dropout", &["x"])).is_empty());
    }

    #[test]
    fn missing_seeds_are_added() {
        let model = field(7, &[node("Relu", &["x"]), node("RandomUniform", &[])].concat());
        let found = RandomOperators::find(&model).unwrap();
        let seeded = found.with_seeds(model.clone());
        assert!(seeded.windows(4).any(|word| word == b"seed"));
        let again = RandomOperators::find(&seeded).unwrap();
        assert!(again.unseeded.is_empty() && again.names == found.names);
        assert_eq!(again.with_seeds(seeded.clone()), seeded);
    }
}
