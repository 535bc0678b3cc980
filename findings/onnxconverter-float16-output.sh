#!/usr/bin/env bash
# onnxconverter-common makes an output float16 though keep_io_types=True, if the last node is a Resize, Min or Max.
#
# Guess: with keep_io_types=True inputs and outputs stay float32, whatever nodes are inside.
# Seen with onnxconverter-common 1.16.0, onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: Resize, Min and Max are on the
# default list of nodes that stay float32. A model that ends in one of them gets a last Cast to float16, and its output
# is float16. A model that ends in Relu or Clip keeps float32. So an enhancer that ends in an upsampling, or in Min and
# Max for clamping, gives another type than before, and a caller that reads the bytes as float32 reads nonsense.
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
print(f"onnxruntime {onnxruntime.__version__}, numpy {np.__version__}")


def convert(operator, *inputs):
    scales = helper.make_tensor("scales", TensorProto.FLOAT, [4], [1, 1, 2, 2])
    one = helper.make_tensor("one", TensorProto.FLOAT, [], [1])
    nodes = [
        helper.make_node("Sigmoid", ["x"], ["t"], name="first"),
        helper.make_node(operator, ["t", *inputs], ["y"], name="last"),
    ]
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, [1, 1, 2, 2])
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 1, "h", "w"])
    graph = helper.make_graph(nodes, "g", [given], [found], [scales, one])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    new = float16.convert_float_to_float16(model, keep_io_types=True)
    session = onnxruntime.InferenceSession(new.SerializeToString(), providers=["CPUExecutionProvider"])
    types = [part.type for part in session.get_inputs() + session.get_outputs()]
    result = session.run(None, {"x": np.zeros((1, 1, 2, 2), np.float32)})[0]
    print(f"{operator}: {[node.op_type for node in new.graph.node]}, input and output {types}, ran: {result.dtype}")
    return str(result.dtype)


seen = [convert("Relu"), convert("Clip", "", "one"), convert("Resize", "", "scales"), convert("Min", "one")]
seen.append(convert("Max", "one"))
sys.exit(seen != ["float32", "float32", "float16", "float16", "float16"])
PYTHON
