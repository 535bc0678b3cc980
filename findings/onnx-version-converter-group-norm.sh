#!/usr/bin/env bash
# ONNX: the version converter leaves GroupNormalization as it is, though from opset 21 on it wants other weights.
#
# Guess: brought from opset 18 to 21, one scale a group is spread to one scale a channel, as opset 21 asks for.
# Seen with onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: the node keeps its two scales for four channels, no error
# is raised, and ONNX Runtime cannot run the result. With as many groups as channels, or one, it runs and is right.
# So a model with real groups is broken by the update alone.
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

onnxruntime.set_default_logger_severity(4)
print(f"onnxruntime {onnxruntime.__version__}, onnx {onnx.__version__}, numpy {np.__version__}")
x = np.random.default_rng(0).normal(size=(1, 4, 5, 6)).astype(np.float32)


def run(model):
    try:
        session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
        return session.run(None, {"x": x})[0]
    except Exception as error:
        return str(error)


def convert(groups):
    scale = helper.make_tensor("scale", TensorProto.FLOAT, [groups], list(range(1, groups + 1)))
    bias = helper.make_tensor("bias", TensorProto.FLOAT, [groups], [0] * groups)
    node = helper.make_node("GroupNormalization", ["x", "scale", "bias"], ["y"], num_groups=groups)
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, [1, 4, "h", "w"])
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 4, "h", "w"])
    graph = helper.make_graph([node], "g", [given], [found], [scale, bias])
    old = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    new = version_converter.convert_version(old, 21)
    before, after = run(old), run(new)
    nodes, opset = [node.op_type for node in new.graph.node], new.opset_import[0].version
    said = after if isinstance(after, str) else f"difference {np.abs(before - after).max()}"
    print(f"{groups} groups of 4 channels: opset {opset}, {nodes}, {said[:160]}")
    return not isinstance(before, str), not isinstance(after, str)


sys.exit([convert(groups) for groups in (1, 2, 4)] != [(True, True), (True, False), (True, True)])
PYTHON
