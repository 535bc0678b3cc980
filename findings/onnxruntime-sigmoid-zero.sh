#!/usr/bin/env bash
# ONNX Runtime: Sigmoid is exactly 0 from -18 on, and twice too large at -17.
#
# Guess: Sigmoid of float32 is right to a few units in the last place until it underflows near -104.
# Seen with onnxruntime 1.27.0 (CPU), onnx 1.23.2 and numpy 2.4.6: Sigmoid(-18) is 0 (true: 1.5e-8), Sigmoid(-17) is
# 8.9e-8 (true: 4.1e-8) and Sigmoid(-16) 6.0e-8, so that it is not monotonic. 1/(1 + Exp(-x)) in the same model is right.
# So log(Sigmoid(x)) is minus infinity for logits that PyTorch still tells apart, and a ratio of two small outputs, such
# as an illumination map that divides, is arbitrary.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check onnxruntime==1.27.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper

print(f"onnxruntime {onnxruntime.__version__}, onnx {onnx.__version__}, numpy {np.__version__}")

one = helper.make_tensor("one", TensorProto.FLOAT, [], [1.0])
nodes = [
    helper.make_node("Sigmoid", ["x"], ["sigmoid"]),
    helper.make_node("Neg", ["x"], ["negative"]),
    helper.make_node("Exp", ["negative"], ["power"]),
    helper.make_node("Add", ["power", "one"], ["sum"]),
    helper.make_node("Div", ["one", "sum"], ["formula"]),
]
given = helper.make_tensor_value_info("x", TensorProto.FLOAT, [5])
found = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [5]) for name in ("sigmoid", "formula")]
graph = helper.make_graph(nodes, "g", [given], found, [one])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
x = np.array([-20, -18, -17, -16, -10], np.float32)
sigmoid, formula = session.run(None, {"x": x})
true = 1 / (1 + np.exp(-x.astype(np.float64)))
for row in zip(x, sigmoid, formula, true):
    print("x {:g}: Sigmoid {:.4g}, 1/(1 + Exp(-x)) {:.4g}, true {:.4g}".format(*row))
stated = (sigmoid[:2] == 0).all() and sigmoid[2] > 1.5 * true[2] and sigmoid[2] > sigmoid[3]
sys.exit(not (stated and np.allclose(formula, true, rtol=1e-5)))
PYTHON
