#!/usr/bin/env bash
# ONNX Runtime: the mean of a large uniform image is wrong by percents.
#
# Guess: ReduceMean of 72 million float32 numbers errs by less than 1e-4, as NumPy's pairwise sum does.
# Seen with onnxruntime 1.27.0 (CPU, one thread), onnx 1.23.2 and numpy 2.4.6, for an image whose pixels are all 0.1:
# the mean is 0.0998 at 2 megapixels, 0.0984 by GlobalAveragePool at 8, and 0.1070 over three channels of 24
# megapixels: 7 % too much. For noise with the same mean the last is 0.3 % off, because most of its roundings cancel;
# those of equal addends do not. The digits depend on the width of the processor's vectors. So a model with a global
# mean (channel attention, exposure estimates) sees a dark, even image of a large sensor lighter or darker than it is.
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

print(f"onnxruntime {onnxruntime.__version__}, onnx {onnx.__version__}, numpy {np.__version__}")


def mean(operator, x, **attributes):
    node = helper.make_node(operator, ["x"], ["y"], **attributes)
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, list(x.shape))
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph([node], "g", [given], [found])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    return float(session.run(None, {"x": x})[0].ravel()[0])


worst = 0.0
for channels, height, width in ((1, 1080, 1920), (1, 2160, 3840), (3, 4000, 6000)):
    x = np.full((1, channels, height, width), 0.1, np.float32)
    reduced, pooled = mean("ReduceMean", x, keepdims=0), mean("GlobalAveragePool", x)
    print(f"{channels} x {height} x {width}: ReduceMean {reduced:.5f}, GlobalAveragePool {pooled:.5f}, numpy {x.mean():.5f}")
    worst = max(worst, abs(reduced / 0.1 - 1), abs(pooled / 0.1 - 1))
    even = abs(float(x.mean()) / 0.1 - 1)
noise = np.random.default_rng(0).random((1, 3, 4000, 6000), np.float32) * np.float32(0.2)
error = mean("ReduceMean", noise, keepdims=0) / float(noise.mean(dtype=np.float64)) - 1
print(f"largest relative error: {worst:.4f}; of numpy for the largest image {even:.1e}; of ReduceMean for noise {error:.1e}")
sys.exit(not (worst > 5e-3 and even < 1e-4 and abs(error) < worst / 5))
PYTHON
