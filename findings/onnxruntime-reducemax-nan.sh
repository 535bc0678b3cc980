#!/usr/bin/env bash
# ONNX Runtime: ReduceMax and ReduceMin return NaN only if the NaN stands first.
#
# Guess: a NaN in the input makes the maximum NaN, as in NumPy, PyTorch and the ONNX reference implementation.
# Seen with onnxruntime 1.27.0 (CPU, one thread), onnx 1.23.2 and numpy 2.4.6: of 9 numbers, one of them NaN, the
# maximum is NaN if the NaN is number 0, and 3 if it is number 1, 4 or 8. It is the same for 3 to 70,000 numbers.
# ReduceSum is NaN in each case. So a model that normalises by its maximum may hide a NaN or spread it to every pixel,
# depending on where it arose.
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
from onnx.reference import ReferenceEvaluator

print(f"onnxruntime {onnxruntime.__version__}, onnx {onnx.__version__}, numpy {np.__version__}")


def model(operator):
    node = helper.make_node(operator, ["x"], ["y"], keepdims=0)
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, [9])
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph([node], "g", [given], [found])
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def runtime(operator, x):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        model(operator).SerializeToString(), options, providers=["CPUExecutionProvider"]
    )
    return float(session.run(None, {"x": x})[0])


as_stated = True
for place in (0, 1, 4, 8):
    x = np.ones(9, np.float32)
    x[2] = 3
    x[place] = np.nan
    largest, smallest, total = (runtime(name, x) for name in ("ReduceMax", "ReduceMin", "ReduceSum"))
    reference = float(ReferenceEvaluator(model("ReduceMax")).run(None, {"x": x})[0])
    print(f"NaN at {place}: ReduceMax {largest}, ReduceMin {smallest}, ReduceSum {total}; reference ReduceMax {reference}")
    hidden = place != 0
    as_stated &= (largest == 3 and smallest == 1) if hidden else (np.isnan(largest) and np.isnan(smallest))
    as_stated &= np.isnan(total) and np.isnan(reference)
sys.exit(not as_stated)
PYTHON
