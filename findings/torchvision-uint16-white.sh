#!/usr/bin/env bash
# torchvision turns white into black when it scales a float image to uint16.
#
# Guess: v2.functional.to_dtype(x, torch.uint16, scale=True) makes 65535 of 1.0, as it makes 255 for uint8.
# Seen with torchvision 0.29.2 and torch 2.15.0: 0.5 becomes 32768 and 0.999 becomes 65470, but 1.0 becomes 0, because
# 65536 - 1e-3 is 65536 in float32. adjust_gamma of a uint16 image, which goes through float, has the same fault: its
# white pixels come out as 0 with every gamma. uint8 and int16 are right, and so is float64 to uint16.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check torch==2.15.0 torchvision==0.29.2 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import sys

import torch
import torchvision
from torchvision.transforms.v2 import functional

print(f"torchvision {torchvision.__version__}, torch {torch.__version__}")
x = torch.tensor([0.0, 0.5, 0.999, 1.0])
found = {}
for given in torch.float32, torch.float64:
    for wanted in torch.uint8, torch.int16, torch.uint16:
        found[given, wanted] = functional.to_dtype(x.to(given), wanted, scale=True).tolist()
        print(f"{given} to {wanted}: {found[given, wanted]}")
image = torch.tensor([[[0, 32768, 65534, 65535]]], dtype=torch.uint16)
brighter, same = (functional.adjust_gamma(image, gamma).flatten().tolist() for gamma in (0.5, 1.0))
print(f"uint16 {image.flatten().tolist()}: gamma 0.5 {brighter}, gamma 1 {same}")
sys.exit(
    not (
        found[torch.float32, torch.uint16] == [0, 32768, 65470, 0]
        and found[torch.float64, torch.uint16][3] == 65535
        and found[torch.float32, torch.uint8][3] == 255
        and found[torch.float32, torch.int16][3] == 32767
        and brighter[3] == same[3] == 0
        and brighter[1] > 32768
    )
)
PYTHON
