#!/usr/bin/env bash
# Keras on JAX exports MaxPooling2D as a pooling over four axes, which ONNX Runtime cannot run.
#
# Guess: it becomes a MaxPool over height and width, as AveragePooling2D and Conv2D come out well.
# Seen with keras 3.15.1, jax2onnx 0.17.1, jax 0.10.2, onnx 1.23.2 and onnxruntime 1.32.0: export raises nothing. The
# picture is wrapped in two more axes, and MaxPool has a kernel of [1, 2, 2, 1]. The file
# loads, and each run ends with "Unsupported pooling size". So the fault shows only at the first picture.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  keras==3.15.1 jax2onnx==0.17.1 jax==0.10.2 jaxlib==0.10.2 onnx==1.23.2 onnxruntime==1.32.0 numpy==2.4.6
KERAS_BACKEND=jax JAX_PLATFORMS=cpu "$folder/venv/bin/python" - "$folder/model.onnx" <<'PYTHON'
import sys
from importlib.metadata import version

import jax
import keras
import numpy as np
import onnx
import onnxruntime

onnxruntime.set_default_logger_severity(4)
print(f"keras {keras.__version__}, jax2onnx {version('jax2onnx')}, jax {jax.__version__}", end=", ")
print(f"onnx {onnx.__version__}, onnxruntime {onnxruntime.__version__}")
path = sys.argv[1]
x = np.arange(64, dtype=np.float32).reshape(1, 8, 8, 1)


def export(layer):
    picture = keras.Input((8, 8, 1), name="picture")
    model = keras.Model(picture, layer(picture))
    right = np.asarray(model(x))
    model.export(path, format="onnx", verbose=False)
    onnx.checker.check_model(path)
    kernels = [
        onnx.helper.get_attribute_value(part)
        for node in onnx.load(path).graph.node
        for part in node.attribute
        if part.name == "kernel_shape"
    ]
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    try:
        found = session.run(None, {"picture": x})[0]
        said = "the same as Keras" if np.allclose(found, right) else "other than Keras"
    except Exception as error:
        said = str(error)
    print(f"{type(layer).__name__}: kernel {kernels}: {said}")
    return said


average, largest = export(keras.layers.AveragePooling2D(2)), export(keras.layers.MaxPooling2D(2))
sys.exit(not (average == "the same as Keras" and "Unsupported pooling size" in largest))
PYTHON
