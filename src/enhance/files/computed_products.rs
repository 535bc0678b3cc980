//! Products of two computed matrices in a graph, whose bits depend on the number of threads: [`computed_products`].
//!
//! ONNX Runtime (1.31 and 1.32) divides the sum of such a product over the threads if it is long, so its result has
//! other last bits with two threads than with one. Products with constant weights, convolutions and reductions give the
//! same bits with any number.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::{BTreeSet, HashSet};
use std::ops::Range;

use super::protobuf::{FieldValue, Malformed, byte_fields, fields};

/// Operators that multiply matrices; the `Fused…` and `Transpose…` ones are ONNX Runtime's own.
const PRODUCTS: [&str; 6] = ["MatMul", "Gemm", "Einsum", "FusedMatMul", "FusedGemm", "TransposeMatMul"];

/// End of the names of operators that multiply computed matrices within them.
const ATTENTION: &str = "Attention";

/// Names of the operators of a `ModelProto` that multiply two computed matrices; none if its bytes are malformed.
pub(crate) fn computed_products(model: &[u8]) -> BTreeSet<String> {
    find(model).unwrap_or_default()
}

fn find(model: &[u8]) -> Result<BTreeSet<String>, Malformed> {
    let mut found = BTreeSet::new();
    let mut bodies = Vec::new();
    for field in fields(model, 0..model.len()) {
        match field? {
            (7, FieldValue::Bytes(graph)) => bodies.push((graph, 1, HashSet::new())),
            // The nodes of a function are its field 7. All its inputs count as computed.
            (25, FieldValue::Bytes(function)) => bodies.push((function, 7, HashSet::new())),
            _ => {}
        }
    }
    // A stack instead of recursion, so that deep nesting cannot overflow the call stack.
    while let Some((body, nodes, mut constants)) = bodies.pop() {
        if nodes == 1 {
            constants.extend(initializers(model, body.clone()));
        }
        for node in byte_fields(model, body, nodes) {
            let node = ProductNode::read(model, node)?;
            let computed = |name: &String| !name.is_empty() && !constants.contains(name);
            let count = node.inputs.iter().filter(|name| computed(name)).count();
            let is_product = PRODUCTS.contains(&node.operator.as_str())
                && node.inputs.iter().take(node.factors()).filter(|name| computed(name)).count() > 1;
            if is_product || node.operator.ends_with(ATTENTION) {
                found.insert(node.operator.clone());
            }
            // Operators without inputs other than `Constant` draw random numbers.
            if node.operator == "Constant" || count == 0 && !node.inputs.is_empty() {
                constants.extend(node.outputs);
            }
            bodies.extend(node.subgraphs.into_iter().map(|graph| (graph, 1, constants.clone())));
        }
    }
    Ok(found)
}

/// Names of the initializers of a graph that no input overrides.
fn initializers(model: &[u8], graph: Range<usize>) -> HashSet<String> {
    let name_of =
        |message: Range<usize>, number| byte_fields(model, message, number).next().map(|name| text(model, name));
    let mut names: HashSet<String> =
        byte_fields(model, graph.clone(), 5).filter_map(|tensor| name_of(tensor, 8)).collect();
    // Below IR version 4, every initializer is also listed as an input, and is constant.
    let version = fields(model, 0..model.len()).find_map(|field| match field {
        Ok((1, FieldValue::Varint(version))) => Some(version),
        _ => None,
    });
    if version.is_none_or(|version| version >= 4) {
        for input in byte_fields(model, graph, 11) {
            names.remove(&name_of(input, 1).unwrap_or_default());
        }
    }
    names
}

/// A `NodeProto`, as far as it shows what is computed.
#[derive(Default)]
struct ProductNode {
    operator: String,
    inputs: Vec<String>,
    outputs: Vec<String>,
    subgraphs: Vec<Range<usize>>,
}

impl ProductNode {
    fn read(model: &[u8], range: Range<usize>) -> Result<Self, Malformed> {
        let mut node = Self::default();
        for field in fields(model, range) {
            match field? {
                (1, FieldValue::Bytes(bytes)) => node.inputs.push(text(model, bytes)),
                (2, FieldValue::Bytes(bytes)) => node.outputs.push(text(model, bytes)),
                (4, FieldValue::Bytes(bytes)) => node.operator = text(model, bytes),
                (5, FieldValue::Bytes(attribute)) => {
                    for field in fields(model, attribute) {
                        if let (6 | 11, FieldValue::Bytes(graph)) = field? {
                            node.subgraphs.push(graph);
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(node)
    }

    /// Number of inputs that are factors: all of an `Einsum`, else two, which a summand may follow.
    fn factors(&self) -> usize {
        if self.operator == "Einsum" { self.inputs.len() } else { 2 }
    }
}

/// Text of a string field.
fn text(model: &[u8], bytes: Range<usize>) -> String {
    String::from_utf8_lossy(model.get(bytes).unwrap_or_default()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
        [&[number << 3 | 2, u8::try_from(bytes.len()).unwrap()], bytes].concat()
    }

    fn node(operator: &str, inputs: &[&str], output: &str) -> Vec<u8> {
        let mut node: Vec<u8> = inputs.iter().flat_map(|name| field(1, name.as_bytes())).collect();
        node.extend(field(2, output.as_bytes()));
        node.extend(field(4, operator.as_bytes()));
        field(1, &node)
    }

    /// Names found in a model of this IR version with an image `x`, an initializer `w` and these nodes.
    fn found(version: u8, inputs: &[&str], nodes: &[Vec<u8>]) -> Vec<String> {
        let mut graph = nodes.concat();
        graph.extend(field(5, &field(8, b"w")));
        for name in inputs {
            graph.extend(field(11, &field(1, name.as_bytes())));
        }
        let model = [vec![1 << 3, version], field(7, &graph)].concat();
        computed_products(&model).into_iter().collect()
    }

    #[test]
    fn products_of_two_computed_matrices_are_found() {
        for (operator, inputs) in [
            ("MatMul", &["x", "y"][..]),
            ("FusedMatMul", &["y", "x"]),
            ("Einsum", &["w", "x", "y"]),
            ("Gemm", &["x", "x", "w"]),
            ("MultiHeadAttention", &["x"]),
        ] {
            let nodes = [node("Relu", &["x"], "y"), node(operator, inputs, "z")];
            assert_eq!(found(8, &["x"], &nodes), [operator]);
        }
    }

    #[test]
    fn products_with_constants_are_not_found() {
        let nodes = [
            node("Constant", &[], "c"),
            node("Transpose", &["w"], "t"),
            node("MatMul", &["x", "w"], "a"),
            node("MatMul", &["t", "a"], "b"),
            node("Gemm", &["b", "c", "a"], "d"),
            node("Einsum", &["d", "w"], "e"),
            node("Mul", &["d", "e"], "f"),
            node("Conv", &["f", "e"], "g"),
        ];
        assert!(found(8, &["x"], &nodes).is_empty());
    }

    #[test]
    fn an_initializer_that_an_input_may_override_is_computed_since_version_4() {
        let nodes = [node("MatMul", &["x", "w"], "y")];
        assert!(found(3, &["x", "w"], &nodes).is_empty());
        assert_eq!(found(4, &["x", "w"], &nodes), ["MatMul"]);
    }

    #[test]
    fn products_in_subgraphs_are_found() {
        let inner = [node("MatMul", &["x", "w"], "a"), node("MatMul", &["x", "a"], "b")].concat();
        let body = [field(4, b"Loop"), field(5, &field(6, &inner))].concat();
        assert_eq!(found(8, &["x"], &[field(1, &body)]), ["MatMul"]);
        let inner = node("MatMul", &["x", "w"], "a");
        let body = [field(4, b"Loop"), field(5, &field(6, &inner))].concat();
        assert!(found(8, &["x"], &[field(1, &body)]).is_empty());
    }

    #[test]
    fn malformed_bytes_have_no_products() {
        assert!(computed_products(b"not a model").is_empty());
    }
}
