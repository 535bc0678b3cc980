#!/usr/bin/env bash
# torch.onnx.export names the outputs of a dictionary after the last operators, not after its keys.
#
# Guess: {"enhanced": ..., "curve": ...} comes out as the outputs "enhanced" and "curve", as inputs have the names of
# the arguments.
# Seen with torch 2.15.0, onnxscript 0.7.2, onnx 1.23.2 and onnxruntime 1.32.0: the outputs are "clamp" and "tanh", and
# two results of one operator "mul_1" and "mul". So a change inside the network, such as a clamp at the end, renames its
# output.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  torch==2.15.0 onnxscript==0.7.2 onnx==1.23.2 onnxruntime==1.32.0 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import sys

import onnxruntime
import torch

print(f"torch {torch.__version__}, onnxruntime {onnxruntime.__version__}")


class Enhancer(torch.nn.Module):
    def __init__(self, clamp):
        super().__init__()
        self.clamp = clamp

    def forward(self, image, strength):
        curve = image * strength
        enhanced = curve * image
        if self.clamp:
            return {"enhanced": enhanced.clamp(0, 1), "curve": curve.tanh()}
        return {"enhanced": enhanced, "curve": curve}


found = []
for clamp in True, False:
    program = torch.onnx.export(
        Enhancer(clamp), (torch.rand(1, 3, 4, 4), torch.tensor(2.0)), dynamo=True, verbose=False
    )
    model = program.model_proto.SerializeToString()
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    names = [part.name for part in session.get_inputs()], [part.name for part in session.get_outputs()]
    print(f"clamp {clamp}: inputs {names[0]}, outputs {names[1]}")
    found.append(names)
sys.exit(found != [(["image", "strength"], ["clamp", "tanh"]), (["image", "strength"], ["mul_1", "mul"])])
PYTHON
