#!/usr/bin/env bash
# pypylon: Mono12 as Mono16 keeps its numbers, but the same image saved as a PNG has them times 16.
#
# Guess: both ways to 16 bit give one scale, so that the converter's Mono16 array and the 16-bit PNG hold the same
# pixels.
# Seen with pypylon 26.9 (pylon 12.4.2), numpy 2.4.6 and Pillow 13.0.0: Convert leaves 4095 as 4095, and 255 of a Mono8
# image as 255, as OutputBitAlignment is LsbAligned, while Save writes 65520 for 4095. So arrays that are taken as full
# 16 bit are 16 or 257 times too dark, and a dark set mixed from both ways has frames of two exposures.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypylon==26.9 numpy==2.4.6 pillow==13.0.0
"$folder/venv/bin/python" - "$folder/image.png" <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
import PIL
from PIL import Image
from pypylon import pylon

print(f"pypylon {importlib.metadata.version('pypylon')}, pylon {pylon.GetPylonVersionString()}, ", end="")
print(f"numpy {np.__version__}, Pillow {PIL.__version__}")


def attached(array, kind):
    image = pylon.PylonImage()
    image.AttachArray(array, kind)
    return image


def as_mono16(array, kind):
    converter = pylon.ImageFormatConverter()
    converter.OutputPixelFormat = pylon.PixelType_Mono16
    return converter.Convert(attached(array, kind)).GetArray()[0].tolist()


twelve = np.tile(np.array([0, 1, 100, 4095], np.uint16), (4, 2))
eight = np.tile(np.array([0, 1, 100, 255], np.uint8), (4, 2))
attached(twelve, pylon.PixelType_Mono12).Save(pylon.ImageFileFormat_Png, sys.argv[1])
saved = np.array(Image.open(sys.argv[1]))[0].tolist()
widened, widened8 = as_mono16(twelve, pylon.PixelType_Mono12), as_mono16(eight, pylon.PixelType_Mono8)
print(f"Mono12 {twelve[0, :4]}: as Mono16 {widened[:4]}, saved as PNG {saved[:4]}")
print(f"Mono8  {eight[0, :4]}: as Mono16 {widened8[:4]}")
scaled = (16 * twelve[0].astype(int)).tolist()
sys.exit(not (widened == twelve[0].tolist() and saved == scaled and widened8 == eight[0].tolist()))
PYTHON
