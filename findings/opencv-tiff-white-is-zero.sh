#!/usr/bin/env bash
# A 16-bit TIFF whose zero is white is read as a negative by Pillow and by OpenCV with IMREAD_UNCHANGED.
#
# Guess: PhotometricInterpretation 0 is turned round at every depth, as both do with 8 bits.
# Seen with opencv-python-headless 5.0.0.93, pillow 13.0.0, tifffile 2026.3.3 and numpy 2.4.6: with 8 bits both invert.
# With 16 bits Pillow gives the stored values, and so does IMREAD_UNCHANGED, while IMREAD_COLOR of the same inverts.
# The Rust crate image 0.25.10 inverts both depths. So a dark 16-bit scan is bright in one program and dark in another.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  opencv-python-headless==5.0.0.93 pillow==13.0.0 tifffile==2026.3.3 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/picture.tif" <<'PYTHON'
import sys

import cv2
import numpy as np
import PIL
import tifffile
from PIL import Image

print(f"opencv {cv2.__version__}, pillow {PIL.__version__}, tifffile {tifffile.__version__}, numpy {np.__version__}")
path = sys.argv[1]
seen = []
for kind in (np.uint8, np.uint16):
    stored = np.zeros((2, 3), kind)
    tifffile.imwrite(path, stored, photometric="miniswhite")
    with Image.open(path) as image:
        pillow = int(np.asarray(image).max())
    unchanged, colour = (int(cv2.imread(path, flag).max()) for flag in (cv2.IMREAD_UNCHANGED, cv2.IMREAD_COLOR))
    print(f"{stored.dtype}, white stored as 0: Pillow {pillow}, OpenCV unchanged {unchanged}, colour {colour}")
    seen.append((pillow, unchanged, colour))
sys.exit(seen != [(255, 255, 255), (0, 0, 255)])
PYTHON
