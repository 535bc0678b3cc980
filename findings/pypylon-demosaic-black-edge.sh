#!/usr/bin/env bash
# pypylon's converter: a demosaiced image has a black last row and a black last column.
#
# Guess: ImageFormatConverter fills the border of a Bayer image from its neighbours, as libswscale does, so that a flat
# mosaic gives a flat image.
# Seen with pypylon 26.9 (pylon 12.4.2) and numpy 2.4.6: the last row and the last column are (0, 0, 0), because
# InconvertibleEdgeHandling is SetZero. The size stays. So the darkest pixel of every frame is 0, black-level and
# low-light statistics see pixels that no sensor made, and enlarged or tiled images get a dark line. Extend fills it.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypylon==26.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
from pypylon import pylon

print(f"pypylon {importlib.metadata.version('pypylon')}, pylon {pylon.GetPylonVersionString()}, numpy {np.__version__}")
mosaic = np.tile(np.array([[200, 100], [100, 50]], np.uint8), (8, 8))


def converted(edge=None):
    image = pylon.PylonImage()
    image.AttachArray(mosaic, pylon.PixelType_BayerRG8)
    converter = pylon.ImageFormatConverter()
    converter.OutputPixelFormat = pylon.PixelType_RGB8packed
    if edge:
        converter.InconvertibleEdgeHandling.Value = edge
    print(f"InconvertibleEdgeHandling {converter.InconvertibleEdgeHandling.Value}: ", end="")
    rgb = converter.Convert(image).GetArray()
    colours, counts = np.unique(rgb.reshape(-1, 3), axis=0, return_counts=True)
    print(f"{rgb.shape}, " + ", ".join(f"{tuple(c.tolist())} {n} times" for c, n in zip(colours, counts)))
    return rgb


plain, extended = converted(), converted("Extend")
flat = np.array([200, 100, 50])
black = not plain[-1].any() and not plain[:, -1].any() and (plain[:-1, :-1] == flat).all()
sys.exit(not (black and plain.shape == (16, 16, 3) and (extended == flat).all()))
PYTHON
