#!/usr/bin/env bash
# ONNX: Resize that crops ("tf_crop_and_resize") returns its whole input if the result has the size of the input.
#
# Guess: the middle half of a row, scaled back to the length of the row, is that half magnified.
# Seen with onnxruntime 1.32.0 (CPU), onnx 1.23.2 and numpy 2.4.6: the row comes out unchanged, for "linear" and
# "nearest", with sizes and with scales of 1; to any other length the half is cropped rightly. ONNX's own reference
# crops in all cases. So a zoom, or a jitter that crops and restores the size, does nothing in ONNX Runtime.
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
x = np.arange(0, 80, 10, dtype=np.float32).reshape(1, 1, 1, 8)


def crop(length, mode):
    roi = helper.make_tensor("roi", TensorProto.FLOAT, [8], [0, 0, 0, 0.25, 1, 1, 1, 0.75])
    sizes = helper.make_tensor("sizes", TensorProto.INT64, [4], [1, 1, 1, length])
    node = helper.make_node(
        "Resize", ["x", "roi", "", "sizes"], ["y"], mode=mode, coordinate_transformation_mode="tf_crop_and_resize"
    )
    given = helper.make_tensor_value_info("x", TensorProto.FLOAT, x.shape)
    found = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph([node], "g", [given], [found], [roi, sizes])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 19)], ir_version=9)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    result = session.run(None, {"x": x})[0].reshape(-1)
    reference = ReferenceEvaluator(model).run(None, {"x": x})[0].reshape(-1)
    print(f"{mode}, to length {length}: {result.round(1).tolist()}, reference {reference.round(1).tolist()}")
    return np.array_equal(result, x.reshape(-1)), np.allclose(result, reference, atol=0.02)


seen = [crop(length, mode) for mode in ("linear", "nearest") for length in (7, 8, 16)]
sys.exit(seen != [(False, True), (True, False), (False, True)] * 2)
PYTHON
