#!/usr/bin/env bash
# OpenCV stretches the values of a PGM in text form to 255, but not those of the same picture in binary form.
#
# Guess: P2 and P5 are two spellings of one picture, so that both read alike, scaled by the largest value or not.
# Seen with opencv-python-headless 5.0.0.93, pillow 13.0.0 and numpy 2.4.6: with a largest value of 100, white reads as
# 255 from P2 and as 100 from P5; Pillow says 255 twice. Above 255 neither is stretched: white of 1023 is 1023, and
# 3 of 255 with IMREAD_COLOR, all but black. So a 10-bit or 7-bit picture comes out dark, by the form of the file.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  opencv-python-headless==5.0.0.93 pillow==13.0.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/picture.pgm" <<'PYTHON'
import sys

import cv2
import numpy as np
import PIL
from PIL import Image

print(f"opencv {cv2.__version__}, pillow {PIL.__version__}, numpy {np.__version__}")
path = sys.argv[1]


def read(magic, largest):
    values = np.full((2, 3), largest)
    if magic == "P2":
        body = (" ".join(map(str, values.reshape(-1))) + "\n").encode()
    else:
        body = values.astype(np.uint8 if largest < 256 else ">u2").tobytes()
    with open(path, "wb") as file:
        file.write(f"{magic}\n3 2\n{largest}\n".encode() + body)
    with Image.open(path) as image:
        other = np.asarray(image).max()
    found = [int(cv2.imread(path, flag).max()) for flag in (cv2.IMREAD_UNCHANGED, cv2.IMREAD_COLOR)]
    print(f"{magic}, largest {largest}: white is {found[0]}, with IMREAD_COLOR {found[1]}; Pillow {other}")
    return found


seen = [read(magic, largest) for largest in (100, 1023) for magic in ("P2", "P5")]
sys.exit(seen != [[255, 255], [100, 100], [1023, 3], [1023, 3]])
PYTHON
