#!/usr/bin/env bash
# ONNX: the version converter shifts a linear Resize of opset 10, or Upsample, by a quarter of a pixel.
#
# Guess: a model brought from opset 9 or 10 to 18 computes the same, as coordinates of the old operators are known
# ("asymmetric": pixel 0 stays pixel 0).
# Seen with onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: the new Resize has no coordinate mode, which now means
# "half_pixel". A row 0, 8, 16, 24 doubled is 0, 4, 8, 12, 16, 20, 24, 24 before and 0, 2, 6, 10, 14, 18, 22, 24 after.
# Set to "asymmetric" by hand, the converted model is right. "nearest" by a whole factor comes out the same either way.
# So an old enhancer that was only brought up to date is blurred or shifted against its weights.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, version_converter

print(f"onnxruntime {onnxruntime.__version__}, onnx {onnx.__version__}, numpy {np.__version__}")
x = np.array([0, 8, 16, 24], np.float32).reshape(1, 1, 1, 4)


def run(model):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": x})[0].reshape(-1).tolist()


def convert(operator, opset, mode):
    scales = helper.make_tensor("scales", TensorProto.FLOAT, [4], [1, 1, 1, 2])
    node = helper.make_node(operator, ["x", "scales"], ["y"], mode=mode)
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, x.shape)
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph([node], "g", [given], [found], [scales])
    old = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
    new = version_converter.convert_version(old, 18)
    resize = next(node for node in new.graph.node if node.op_type == "Resize")
    modes = {part.name: helper.get_attribute_value(part) for part in resize.attribute}
    before, after = run(old), run(new)
    resize.attribute.append(helper.make_attribute("coordinate_transformation_mode", "asymmetric"))
    mended = run(new) if mode == "linear" else before
    print(f"{operator}-{opset} {mode}: {before}, at opset 18 {modes}: {after}, with asymmetric {mended}")
    return before, after, mended


asymmetric, half_pixel = [0, 4, 8, 12, 16, 20, 24, 24], [0, 2, 6, 10, 14, 18, 22, 24]
linear = [convert(operator, opset, "linear") for operator, opset in (("Upsample", 9), ("Resize", 10))]
nearest = convert("Resize", 10, "nearest")
sys.exit(not (linear == [(asymmetric, half_pixel, asymmetric)] * 2 and nearest[0] == nearest[1]))
PYTHON
