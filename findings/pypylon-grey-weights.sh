#!/usr/bin/env bash
# pypylon's converter: RGB to Mono8 is (2 R + 5 G + B) / 8 rounded down, neither BT.601 nor BT.709.
#
# Guess: ImageFormatConverter makes grey as Pillow's convert("L") does, so that (200, 100, 50) becomes 124.
# Seen with pypylon 26.9 (pylon 12.4.2), Pillow 13.0.0, PyAV 18.1.0 and numpy 2.4.6: pypylon gives 118, the other two
# give 124 (BT.601), and BT.709 would be 118 too, but pure red is 63 (BT.601 76, BT.709 54) and pure green 159 (150,
# 182). So grey frames from the camera's own converter and from an image library differ by up to 13 steps for saturated
# colours, which reads as another exposure, and no standard weights undo it.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  pypylon==26.9 numpy==2.4.6 pillow==13.0.0 av==18.1.0
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import sys

import av
import numpy as np
import PIL
from PIL import Image
from pypylon import pylon

print(f"pypylon {importlib.metadata.version('pypylon')}, pylon {pylon.GetPylonVersionString()}, ", end="")
print(f"Pillow {PIL.__version__}, av {av.__version__}, numpy {np.__version__}")


def greys(colour):
    rgb = np.tile(np.array(colour, np.uint8), (16, 16, 1))
    image = pylon.PylonImage()
    image.AttachArray(rgb, pylon.PixelType_RGB8packed)
    converter = pylon.ImageFormatConverter()
    converter.OutputPixelFormat = pylon.PixelType_Mono8
    mono = int(converter.Convert(image).GetArray()[8, 8])
    swscale = int(av.VideoFrame.from_ndarray(rgb, format="rgb24").to_ndarray(format="gray")[8, 8])
    return mono, int(np.array(Image.fromarray(rgb).convert("L"))[8, 8]), swscale


good = True
for colour in ((200, 100, 50), (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)):
    mono, pillow, swscale = greys(colour)
    red, green, blue = colour
    bt709, bt601 = (np.dot(colour, w) for w in ((0.2126, 0.7152, 0.0722), (0.299, 0.587, 0.114)))
    print(f"{colour}: pypylon {mono}, Pillow {pillow}, PyAV {swscale}; BT.709 {bt709:.1f}, BT.601 {bt601:.1f}")
    good &= mono == (2 * red + 5 * green + blue) // 8 and abs(pillow - bt601) <= 1 and abs(swscale - bt601) <= 2
sys.exit(not good)
PYTHON
