#!/usr/bin/env bash
# torch.onnx.export turns adaptive pooling of a free height and width into a pooling with the example's window.
#
# Guess: export fails, as ONNX has no adaptive pooling and the window depends on the size of the image.
# Seen with torch 2.15.0, onnxscript 0.7.2, onnx 1.23.2 and onnxruntime 1.32.0: adaptive_avg_pool2d(x, 3) with free
# dimensions h and w, exported from a 9x9 example, is an AveragePool with window 3 and stride 3 and an output of h//3 by
# w//3, without an error. A 9x9 image comes out right, 10x10 and 11x11 give 3x3 other values, and 96x96 gives 32x32, not
# 3x3. A pooling to 1 is right at every size.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  torch==2.15.0 onnxscript==0.7.2 onnx==1.23.2 onnxruntime==1.32.0 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import sys

import numpy as np
import onnxruntime
import torch

print(f"torch {torch.__version__}, onnxruntime {onnxruntime.__version__}")


class Pool(torch.nn.Module):
    def __init__(self, size):
        super().__init__()
        self.size = size

    def forward(self, x):
        return torch.nn.functional.adaptive_avg_pool2d(x, self.size)


def session(module):
    program = torch.onnx.export(
        module, (torch.rand(1, 1, 9, 9),), dynamo=True, dynamic_shapes=({2: "h", 3: "w"},), verbose=False
    )
    print([node.op_type for node in program.model_proto.graph.node])
    return onnxruntime.InferenceSession(program.model_proto.SerializeToString(), providers=["CPUExecutionProvider"])


found = {}
for cells in 3, 1:
    module = Pool(cells)
    exported = session(module)
    print(f"to {cells}x{cells}: output {exported.get_outputs()[0].shape}")
    for side in 9, 10, 11, 96:
        x = torch.rand(1, 1, side, side)
        right, result = module(x).numpy(), exported.run(None, {"x": x.numpy()})[0]
        same = right.shape == result.shape and np.allclose(right, result, atol=1e-5)
        found[cells, side] = (result.shape[2], same)
        print(f"  {side}x{side}: {result.shape[2]}x{result.shape[3]}, {'the same' if same else 'other'} values")
sys.exit(
    not (
        found[3, 9] == (3, True)
        and found[3, 10] == found[3, 11] == (3, False)
        and found[3, 96] == (32, False)
        and all(found[1, side] == (1, True) for side in (9, 10, 11, 96))
    )
)
PYTHON
