#!/usr/bin/env bash
# jax2onnx exports jax.image.resize(..., "nearest") so that ties go down, and JAX takes the pixel above.
#
# Guess: the exported Resize takes the same pixels as JAX, since ONNX has a rule for each case.
# Seen with jax2onnx 0.17.1, jax 0.10.2, onnx 1.23.2 and onnxruntime 1.32.0: the node says "half_pixel" and
# "round_prefer_floor". To halve a picture every pixel is a tie: a row 0 to 7 is 1, 3, 5, 7 in JAX and 0, 2, 4, 6 in
# ONNX. At a length of 12 ties differ too; doubled it is the same. With "round_prefer_ceil" set by hand all agree.
# So a network that halves its input this way is shifted by a pixel after export.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  jax2onnx==0.17.1 jax==0.10.2 jaxlib==0.10.2 onnx==1.23.2 onnxruntime==1.32.0 numpy==2.4.6
JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import jax
import numpy as np
import onnx
import onnxruntime
from jax2onnx import to_onnx

print(f"jax2onnx {version('jax2onnx')}, jax {jax.__version__}, onnx {onnx.__version__}", end=", ")
print(f"onnxruntime {onnxruntime.__version__}")
x = np.arange(8, dtype=np.float32).reshape(1, 1, 8, 1)


def export(length):
    def resize(x):
        return jax.image.resize(x, (1, 1, length, 1), "nearest")

    model = to_onnx(resize, [x.shape])
    node = next(node for node in model.graph.node if node.op_type == "Resize")
    rules = [onnx.helper.get_attribute_value(part) for part in node.attribute]
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    found = session.run(None, {session.get_inputs()[0].name: x})[0].reshape(-1).tolist()
    right = np.asarray(resize(x)).reshape(-1).tolist()
    rule = next(part for part in node.attribute if part.name == "nearest_mode")
    rule.s = b"round_prefer_ceil"
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    mended = session.run(None, {session.get_inputs()[0].name: x})[0].reshape(-1).tolist()
    print(f"to length {length}: JAX {right}, ONNX {found}, {rules}, mended {mended}")
    return right, found, mended


half, more, double = export(4), export(12), export(16)
as_said = half[:2] == ([1, 3, 5, 7], [0, 2, 4, 6]) and more[0] != more[1] and double[0] == double[1]
sys.exit(not (as_said and all(right == mended for right, _, mended in (half, more, double))))
PYTHON
