#!/usr/bin/env bash
# ONNX: Clip with a lower bound alone turns infinity into the largest finite float.
#
# Guess: Clip(x, min=0) is max(x, 0), so that infinity stays infinity, as with torch.clamp and numpy.clip.
# Seen with onnxruntime 1.27.0 (CPU), onnx 1.23.2 and numpy 2.4.6: the result is 3.4028235e+38, because a bound that is
# left out is the largest number of the type, not infinity. Max(x, 0) keeps infinity. So an output checked with
# isfinite() looks sound although a division by zero came before.
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


def run(operator, x):
    bound = helper.make_tensor("zero", TensorProto.FLOAT, [], [0.0])
    node = helper.make_node(operator, ["x", "zero"], ["y"])
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, [3])
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph([node], "g", [given], [found], [bound])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": x})[0]


x = np.array([-1.0, 2.0, np.inf], np.float32)
clipped, largest = run("Clip", x), run("Max", x)
print(f"x {x}: Clip(x, 0) {clipped}, Max(x, 0) {largest}, numpy.clip(x, 0, None) {np.clip(x, 0, None)}")
limit = np.finfo(np.float32).max
sys.exit(not (clipped.tolist() == [0, 2, limit] and largest.tolist() == [0, 2, np.inf]))
PYTHON
