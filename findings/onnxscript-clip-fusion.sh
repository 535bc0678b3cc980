#!/usr/bin/env bash
# ONNX Script's optimizer makes one Clip of two, or of Clip and Relu, and the one gives other values.
#
# Guess: where ranges do not meet, the later one wins: Relu(Clip(x, -3, -1)) is 0, Clip(Clip(x, 0, 1), 2, 3) is 2.
# Seen with onnxscript 0.7.2, onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: after onnxscript.optimizer.optimize the
# first gives -1, out of the range of Relu, and the second gives 1, out of its last range. Clip(Relu(x), -3, -1) and
# ranges that meet stay right; onnxslim 0.1.98 and ONNX Runtime's own optimizer get all of them right. So a curve that
# is clamped in stages can leave the range that its last clamp promises.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  onnxscript==0.7.2 onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
import onnx
import onnxruntime
import onnxscript
import onnxscript.optimizer
from onnx import TensorProto, helper

print(f"onnxscript {onnxscript.__version__}, onnx {onnx.__version__}, onnxruntime {onnxruntime.__version__}")
x = np.array([-5, -2, 0.5, 9], np.float32)


def run(model):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": x})[0].tolist()


def optimize(*steps):
    nodes, bounds = [], []
    for place, step in enumerate(steps):
        names = []
        for bound in step[1:]:
            names.append(f"bound{len(bounds)}")
            bounds.append(helper.make_tensor(names[-1], TensorProto.FLOAT, [], [bound]))
        nodes.append(helper.make_node(step[0], ["xt"[place], *names], ["ty"[place]]))
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, [4])
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, [4])
    graph = helper.make_graph(nodes, "g", [given], [found], bounds)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    new = onnxscript.optimizer.optimize(model)
    before, after = run(model), run(new)
    print(f"{steps}: {before}, optimized {[node.op_type for node in new.graph.node]}: {after}")
    return before, after


relu_last = optimize(("Clip", -3, -1), ("Relu",))
relu_first = optimize(("Relu",), ("Clip", -3, -1))
clips = optimize(("Clip", 0, 1), ("Clip", 2, 3))
meeting = optimize(("Clip", 0, 5), ("Clip", 1, 3))
sys.exit(not (relu_last == ([0] * 4, [-1] * 4) and clips == ([2] * 4, [1] * 4)
              and relu_first[0] == relu_first[1] and meeting[0] == meeting[1]))
PYTHON
