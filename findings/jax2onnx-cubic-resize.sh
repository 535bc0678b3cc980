#!/usr/bin/env bash
# jax2onnx exports jax.image.resize(..., "cubic") with other values along the edges of the picture.
#
# Guess: the values agree everywhere, as the exported Resize has JAX's constant of -0.5.
# Seen with jax2onnx 0.17.1, jax 0.10.2, onnx 1.23.2 and onnxruntime 1.32.0: a row doubled agrees inside, and the outer
# three pixels are off by up to 0.02 of its range; noise is off by 0.1. JAX leaves out weights that fall outside of the
# picture, and ONNX repeats the last pixel unless the node says exclude_outside=1. With it set by hand all agree.
# So a network that upsamples this way has a faint frame after export.
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
x = np.array([0, 1, 0, 0, 1, 1, 0, 1, 0, 0, 1, 0], np.float32).reshape(1, 1, 12, 1)


def resize(x):
    return jax.image.resize(x, (1, 1, 24, 1), "cubic", antialias=False)


def error(model):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    found = session.run(None, {session.get_inputs()[0].name: x})[0].reshape(-1)
    return np.abs(found - np.asarray(resize(x)).reshape(-1))


model = to_onnx(resize, [x.shape])
before = error(model)
node = next(node for node in model.graph.node if node.op_type == "Resize")
print({part.name: onnx.helper.get_attribute_value(part) for part in node.attribute})
node.attribute.append(onnx.helper.make_attribute("exclude_outside", 1))
after = error(model)
print(f"difference from JAX: {before.round(4).tolist()}, with exclude_outside=1 at most {after.max():.1e}")
sys.exit(not (max(before[:4].max(), before[-4:].max()) > 0.01 and before[4:-4].max() < 1e-5 > after.max()))
PYTHON
