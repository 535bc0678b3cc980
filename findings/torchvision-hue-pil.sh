#!/usr/bin/env bash
# torchvision's adjust_hue differs by up to 14 levels between a tensor and a Pillow image; brightness and gamma agree.
#
# Guess: both kinds of input give the same pixels up to rounding, at most two levels apart.
# Seen with torchvision 0.29.2, torch 2.15.0, Pillow 13.0.0 and numpy 2.4.6: for random pixels adjust_brightness and
# adjust_gamma are equal and adjust_saturation is one level off, but 44 % of the values of adjust_hue differ, by up to
# 14, since a Pillow image goes through HSV with 8 bits. The same holds for a hue of 0, which leaves a tensor unchanged.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  torch==2.15.0 torchvision==0.29.2 pillow==13.0.0 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import sys

import numpy as np
import PIL.Image
import torch
import torchvision
from torchvision.transforms.v2 import functional

print(f"torchvision {torchvision.__version__}, torch {torch.__version__}, Pillow {PIL.__version__}")
image = PIL.Image.fromarray(np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8))
tensor = functional.pil_to_tensor(image)


def apart(function, *arguments):
    levels = function(tensor, *arguments).int() - functional.pil_to_tensor(function(image, *arguments)).int()
    largest, share = levels.abs().max().item(), (levels != 0).float().mean().item()
    print(f"{function.__name__}{arguments}: {share:.0%} of the values differ, by up to {largest}")
    return largest


brightness, gamma = apart(functional.adjust_brightness, 0.3), apart(functional.adjust_gamma, 0.5)
saturation = apart(functional.adjust_saturation, 0.5)
hues = [apart(functional.adjust_hue, hue) for hue in (0.0, 0.1, -0.3, 0.5)]
unchanged = functional.adjust_hue(tensor, 0.0).equal(tensor)
print(f"tensor unchanged by a hue of 0: {unchanged}")
sys.exit(not (brightness == gamma == 0 and saturation == 1 and min(hues) > 5 and unchanged))
PYTHON
