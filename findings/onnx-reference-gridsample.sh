#!/usr/bin/env bash
# ONNX: cubic GridSample with the border repeated differs outside of the picture between ONNX Runtime and the reference.
#
# Guess: the two agree, as the reference evaluator of onnx is what runtimes are measured by.
# Seen with onnx 1.23.2, onnxruntime 1.32.0 and numpy 2.4.6: more than half a pixel outside, the reference gives the
# value of the border. ONNX Runtime reads the sixteen pixels around the place with the border repeated and weighs
# them, as a computation by hand does, and overshoots: 3.09 and 6.10 where the border is 3 and 6. Inside they agree.
# So a warp that is checked against the reference is called wrong at its edges, and a clamp is needed after it.
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
from onnx import TensorProto, helper
from onnx.reference import ReferenceEvaluator

print(f"onnxruntime {onnxruntime.__version__}, onnx {onnx.__version__}, numpy {np.__version__}")
row = np.array([3, 1, 4, 1, 5, 9, 2, 6], np.float32)
x = np.broadcast_to(row, (1, 1, 8, 8)).copy()
places = np.array([-0.7, -0.3, 2.5, 4.25, 7.3, 7.8])
grid = np.zeros((1, 1, len(places), 2), np.float32)
grid[..., 0] = (places * 2 + 1) / 8 - 1


def by_hand(place, a=-0.75):
    first = int(np.floor(place))
    total = 0.0
    for pixel in range(first - 1, first + 3):
        away = abs(place - pixel)
        if away <= 1:
            weight = (a + 2) * away**3 - (a + 3) * away**2 + 1
        else:
            weight = a * away**3 - 5 * a * away**2 + 8 * a * away - 4 * a
        total += weight * row[min(max(pixel, 0), 7)]
    return total


node = helper.make_node("GridSample", ["x", "grid"], ["y"], mode="cubic", padding_mode="border")
given = [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in ("x", "grid")]
found = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
graph = helper.make_graph([node], "g", given, [found])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=9)
session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
runtime = session.run(None, {"x": x, "grid": grid})[0].reshape(-1)
reference = ReferenceEvaluator(model).run(None, {"x": x, "grid": grid})[0].reshape(-1)
hand = np.array([by_hand(place) for place in places])
for name, values in (("place", places), ("by hand", hand), ("runtime", runtime), ("reference", reference)):
    print(f"{name}: {values.round(4).tolist()}")
off = np.abs(reference - hand) > 0.01
sys.exit(not (np.abs(runtime - hand).max() < 1e-4 and off.tolist() == [True, False, False, False, False, True]))
PYTHON
