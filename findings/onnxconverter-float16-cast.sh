#!/usr/bin/env bash
# onnxconverter-common makes a model that starts with a Cast from uint8 to float one that no longer loads.
#
# Guess: a Cast to float becomes a Cast to float16, as all that follows is float16.
# Seen with onnxconverter-common 1.16.0, onnx 1.23.2 and onnxruntime 1.32.0: the type of the result is changed, but the
# Cast itself still says float32, so that ONNX Runtime refuses the model with a type error.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  onnxconverter-common==1.16.0 onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper
from onnxconverter_common import float16

print(f"onnxconverter-common {version('onnxconverter-common')}, onnx {onnx.__version__}", end=", ")
print(f"onnxruntime {onnxruntime.__version__}")
white = helper.make_tensor("white", TensorProto.FLOAT, [], [255])
nodes = [
    helper.make_node("Cast", ["x"], ["t"], name="cast", to=TensorProto.FLOAT),
    helper.make_node("Div", ["t", "white"], ["y"], name="scale"),
]
given = helper.make_tensor_value_info("x", TensorProto.UINT8, [1, 3, "h", "w"])
found = helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 3, "h", "w"])
graph = helper.make_graph(nodes, "g", [given], [found], [white])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
new = float16.convert_float_to_float16(model)
cast = next(node for node in new.graph.node if node.name == "cast")
print(f"the Cast of the new model is to {TensorProto.DataType.Name(cast.attribute[0].i)}")


def run(model):
    try:
        session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
        return session.run(None, {"x": np.full((1, 3, 2, 2), 255, np.uint8)})[0].max()
    except Exception as error:
        return str(error)


before, after = run(model), run(new)
print(f"before: {before}, after: {after}")
sys.exit(not (before == 1 and "Type" in str(after)))
PYTHON
