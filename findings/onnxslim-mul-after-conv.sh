#!/usr/bin/env bash
# onnxslim scales channels where a Mul after a Conv scales rows or columns, if there are as many of both.
#
# Guess: only a factor of the shape (C, 1, 1) goes into the weights of the Conv; one of (H, 1) or (W) stays a Mul,
# whatever the sizes are.
# Seen with onnxslim 0.1.98, onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: with four channels and a result of 4x4, or
# of 4x5, a Mul by (4, 1), a factor a row, disappears into the Conv, and each channel is scaled instead. With five rows
# the Mul stays. An Add of the same shape stays too. slim() raises nothing: its check of the results is off unless it is
# asked for.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  onnxslim==0.1.98 onnx==1.23.2 onnxruntime==1.32.0 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import sys
from importlib.metadata import version

import numpy as np
import onnx
import onnxruntime
import onnxslim
from onnx import TensorProto, helper, numpy_helper

print(f"onnxslim {version('onnxslim')}, onnx {onnx.__version__}, onnxruntime {onnxruntime.__version__}")
weights = np.random.default_rng(0).standard_normal((4, 3, 3, 3)).astype(np.float32)


def run(model, x):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": x})[0]


def kept(operator, shape, height, width):
    """True if slim() leaves the values as they are."""
    factor = np.arange(1, 1 + np.prod(shape), dtype=np.float32).reshape(shape)
    graph = helper.make_graph(
        [helper.make_node("Conv", ["x", "w"], ["a"]), helper.make_node(operator, ["a", "k"], ["y"])],
        "graph",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, (1, 3, height + 2, width + 2))],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, (1, 4, height, width))],
        [numpy_helper.from_array(weights, "w"), numpy_helper.from_array(factor, "k")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model)
    x = np.random.default_rng(1).random((1, 3, height + 2, width + 2), dtype=np.float32)
    right = run(model, x)
    slim = onnxslim.slim(model)
    same = np.allclose(right, run(slim, x), rtol=1e-4, atol=1e-4)
    nodes = [node.op_type for node in slim.graph.node]
    print(f"{operator} of {shape} to 4 channels of {height}x{width}: {nodes}, {'the same' if same else 'other values'}")
    return same


rows = [kept("Mul", (4, 1), 4, 4), kept("Mul", (4, 1), 4, 5), kept("Mul", (4,), 5, 4)]
others = [kept("Mul", (5, 1), 5, 4), kept("Mul", (4, 1, 1), 4, 4), kept("Add", (4, 1), 4, 4)]
sys.exit(any(rows) or not all(others))
PYTHON
