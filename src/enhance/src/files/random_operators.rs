//! Operators of a graph that draw random numbers, and their seeds: [`RandomOperators`].
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::onnx_message::OnnxMessage;
use super::protobuf::{FieldValue, Malformed, fields};

/// Operators whose attribute `seed` is a float.
const SEEDED_BY_FLOAT: [&str; 6] = [
    "RandomNormal",
    "RandomNormalLike",
    "RandomUniform",
    "RandomUniformLike",
    "Multinomial",
    "Bernoulli",
];

/// Deepest nesting of graphs in nodes in which a seed is set; chosen.
const DEEPEST: usize = 60;

/// The random operators of a model.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct RandomOperators {
    /// Names of the operators, as `RandomNormalLike`.
    pub(crate) names: BTreeSet<String>,
    /// Byte ranges of the nodes without a seed.
    unseeded: BTreeSet<(usize, usize)>,
}

/// One node: its operator, its inputs, its outputs and whether it has the attribute `seed`.
struct Node {
    operator: String,
    inputs: Vec<String>,
    outputs: Vec<String>,
    has_seed: bool,
    constant: Option<bool>,
}

impl RandomOperators {
    /// Finds them in a `ModelProto`: in its graph, subgraphs and functions. A dropout counts if it may be in training mode.
    ///
    /// # Errors
    /// If the bytes are not a protobuf message.
    pub(crate) fn find(model: &[u8]) -> Result<Self, Malformed> {
        let mut found = Self::default();
        let mut nodes: Vec<(Range<usize>, Node)> = Vec::new();
        let mut constants: BTreeMap<String, bool> = BTreeMap::new();
        // A stack instead of recursion, so that deep nesting cannot overflow the call stack.
        let mut open = vec![(OnnxMessage::Model, 0..model.len())];
        while let Some((message, range)) = open.pop() {
            if message == OnnxMessage::Node {
                nodes.push((range.clone(), Node::read(model, range.clone())?));
            }
            for field in fields(model, range) {
                let (number, FieldValue::Bytes(bytes)) = field? else {
                    continue;
                };
                if (message, number) == (OnnxMessage::Graph, 5) {
                    let (name, value) = truth_value(model, bytes.clone())?;
                    constants.extend(value.map(|value| (name, value)));
                }
                if let Some(inner) = message.with_nodes(number) {
                    open.push((inner, bytes));
                }
            }
        }
        for (_, node) in &nodes {
            let outputs = node.outputs.iter();
            constants.extend(
                node.constant
                    .iter()
                    .flat_map(|value| outputs.clone().map(|output| (output.clone(), *value))),
            );
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

    /// The model with a seed at each random operator that has none; the same bytes if all have one.
    pub(crate) fn seeded(&self, model: Vec<u8>) -> Vec<u8> {
        if self.unseeded.is_empty() {
            return model;
        }
        self.copied(&model, OnnxMessage::Model, 0..model.len(), 0)
            .unwrap_or(model)
    }

    /// A message with the seeds of its nodes.
    fn copied(
        &self,
        model: &[u8],
        message: OnnxMessage,
        range: Range<usize>,
        depth: usize,
    ) -> Option<Vec<u8>> {
        let is_unseeded = self.unseeded.contains(&(range.start, range.end));
        let touched = |range: &Range<usize>| {
            let mut from = self.unseeded.range((range.start, 0)..);
            from.next().is_some_and(|(start, _)| *start < range.end)
        };
        if depth > DEEPEST || !touched(&range) {
            return Some(model.get(range)?.to_vec());
        }
        let mut copy = Vec::with_capacity(range.len() + 32);
        let mut all = fields(model, range.clone());
        let mut start = range.start;
        while let Some(field) = all.next() {
            let end = all.position();
            match field.ok()? {
                (number, FieldValue::Bytes(bytes)) if message.with_nodes(number).is_some() => {
                    let inner = message.with_nodes(number)?;
                    let inner = self.copied(model, inner, bytes, depth + 1)?;
                    push_bytes(&mut copy, number, &inner);
                }
                _ => copy.extend(model.get(start..end)?),
            }
            start = end;
        }
        if message == OnnxMessage::Node && is_unseeded {
            let node = Node::read(model, range).ok()?;
            push_bytes(&mut copy, 5, &seed_attribute(&node.operator));
        }
        Some(copy)
    }
}

impl Node {
    fn read(model: &[u8], range: Range<usize>) -> Result<Self, Malformed> {
        let text = |bytes: Range<usize>| {
            String::from_utf8_lossy(model.get(bytes).unwrap_or_default()).into_owned()
        };
        let mut node = Self {
            operator: String::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            has_seed: false,
            constant: None,
        };
        let mut attributes = Vec::new();
        for field in fields(model, range) {
            match field? {
                (1, FieldValue::Bytes(bytes)) => node.inputs.push(text(bytes)),
                (2, FieldValue::Bytes(bytes)) => node.outputs.push(text(bytes)),
                (4, FieldValue::Bytes(bytes)) => node.operator = text(bytes),
                (5, FieldValue::Bytes(bytes)) => attributes.push(bytes),
                _ => {}
            }
        }
        for attribute in attributes {
            for field in fields(model, attribute) {
                match field? {
                    (1, FieldValue::Bytes(bytes)) => node.has_seed |= text(bytes) == "seed",
                    (5, FieldValue::Bytes(bytes)) if node.operator == "Constant" => {
                        node.constant = truth_value(model, bytes)?.1;
                    }
                    _ => {}
                }
            }
        }
        Ok(node)
    }

    /// Whether a dropout may be in training mode: its third input is not a constant that is false.
    fn is_training(&self, constants: &BTreeMap<String, bool>) -> bool {
        self.inputs
            .get(2)
            .filter(|name| !name.is_empty())
            .is_some_and(|name| constants.get(name) != Some(&false))
    }
}

/// Name of a `TensorProto`, and its truth value if it holds one.
fn truth_value(model: &[u8], range: Range<usize>) -> Result<(String, Option<bool>), Malformed> {
    const BOOL: u64 = 9;
    let (mut name, mut data_type, mut value) = (String::new(), 0, None);
    for field in fields(model, range) {
        match field? {
            (2, FieldValue::Varint(number)) => data_type = number,
            (8, FieldValue::Bytes(bytes)) => {
                name = String::from_utf8_lossy(model.get(bytes).unwrap_or_default()).into_owned();
            }
            // int32_data, packed or not; raw_data
            (5, FieldValue::Varint(number)) => value = Some(number != 0),
            (5 | 9, FieldValue::Bytes(bytes)) => {
                value = model
                    .get(bytes)
                    .and_then(|bytes| Some(*bytes.first()? != 0));
            }
            _ => {}
        }
    }
    Ok((name, value.filter(|_| data_type == BOOL)))
}

/// The attribute `seed` of an operator, with a value that no default has.
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

/// Appends a field of bytes.
fn push_bytes(message: &mut Vec<u8>, number: u64, bytes: &[u8]) {
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

    fn flag(value: u8) -> Vec<u8> {
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
        let graph = [
            node("RandomNormal", &[]),
            field(1, &outer),
            node("Add", &["a"]),
        ]
        .concat();
        assert_eq!(names(&graph), ["Multinomial", "RandomNormal"]);
    }

    #[test]
    fn a_dropout_is_random_only_in_training_mode() {
        let dropout = node("Dropout", &["x", "ratio", "mode"]);
        assert_eq!(names(&[dropout.clone(), flag(1)].concat()), ["Dropout"]);
        assert!(names(&[dropout, flag(0)].concat()).is_empty());
        assert!(names(&node("Dropout", &["x"])).is_empty());
    }

    #[test]
    fn a_seed_is_set_where_none_is() {
        let model = field(
            7,
            &[node("Relu", &["x"]), node("RandomUniform", &[])].concat(),
        );
        let found = RandomOperators::find(&model).unwrap();
        let seeded = found.seeded(model.clone());
        assert!(seeded.windows(4).any(|word| word == b"seed"));
        let again = RandomOperators::find(&seeded).unwrap();
        assert!(again.unseeded.is_empty() && again.names == found.names);
        assert_eq!(again.seeded(seeded.clone()), seeded);
    }
}
