#!/usr/bin/env bash
# onnxoptimizer moves a Pad with zeros into MaxPool, which pads with minus infinity, so that negative borders change.
#
# Guess: only a Pad whose value is the smallest number may go into MaxPool; zeros stay a node of their own.
# Seen with onnxoptimizer 0.4.2, onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: the optimizer's default passes leave
# MaxPool alone. A plane of -2 has a border of 0 before and is -2 all over after. After a Relu nothing changes, so
# that it shows only with maps that go below 0, such as a dark channel taken as the greatest of -x.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  onnxoptimizer==0.4.2 onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import numpy as np
import onnx
import onnxoptimizer
import onnxruntime
from onnx import TensorProto, helper

print(f"onnxoptimizer {version('onnxoptimizer')}, onnx {onnx.__version__}, onnxruntime {onnxruntime.__version__}")
x = np.full((1, 1, 4, 4), -2, np.float32)
pads = helper.make_tensor("pads", TensorProto.INT64, [8], [0, 0, 1, 1, 0, 0, 1, 1])
zero = helper.make_tensor("zero", TensorProto.FLOAT, [], [0])
nodes = [
    helper.make_node("Pad", ["x", "pads", "zero"], ["t"]),
    helper.make_node("MaxPool", ["t"], ["y"], kernel_shape=[3, 3]),
]
given = helper.make_tensor_value_info("x", TensorProto.FLOAT, x.shape)
found = helper.make_tensor_value_info("y", TensorProto.FLOAT, x.shape)
graph = helper.make_graph(nodes, "g", [given], [found], [pads, zero])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
new = onnxoptimizer.optimize(model)


def run(model):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": x})[0][0, 0]


before, after = run(model), run(new)
print(f"before: {[node.op_type for node in model.graph.node]}\n{before}")
print(f"after: {[node.op_type for node in new.graph.node]}\n{after}")
border = np.zeros((4, 4))
border[1:3, 1:3] = -2
sys.exit(not (np.array_equal(before, border) and np.array_equal(after, x[0, 0])))
PYTHON
