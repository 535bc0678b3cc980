#!/usr/bin/env bash
# OpenCV cannot read a TIFF with orientation 5 to 8, and turns 2 to 4 over even where it is told not to.
#
# Guess: IMREAD_UNCHANGED and IMREAD_IGNORE_ORIENTATION give the stored rows, and IMREAD_COLOR turns all of them, as
# for a JPEG.
# Seen with opencv-python-headless 5.0.0.93 (4.13.0.92 too), tifffile 2026.3.3 and numpy 2.4.6: with orientation 5 to 8
# of a picture that is not square every flag gives None. With 2 to 4 every flag gives the mirrored picture. A square
# picture with 6 is read. So scans and phone pictures kept as upright TIFF are missing from a data set without notice.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  opencv-python-headless==5.0.0.93 tifffile==2026.3.3 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/picture.tif" <<'PYTHON'
import sys

import cv2
import numpy as np
import tifffile

cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
print(f"opencv {cv2.__version__}, tifffile {tifffile.__version__}, numpy {np.__version__}")
path = sys.argv[1]
flags = {
    "unchanged": cv2.IMREAD_UNCHANGED,
    "colour": cv2.IMREAD_COLOR,
    "ignore": cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION,
}


def read(height, width, orientation):
    pixels = np.arange(height * width * 3, dtype=np.uint8).reshape(height, width, 3)
    tag = [(274, "H", 1, orientation, True)]
    tifffile.imwrite(path, pixels, photometric="rgb", extratags=tag)
    said = {}
    for name, flag in flags.items():
        found = cv2.imread(path, flag)
        if found is None:
            said[name] = "None"
        else:
            said[name] = "as stored" if np.array_equal(found[..., ::-1], pixels) else f"turned, {found.shape[:2]}"
    print(f"{height} x {width}, orientation {orientation}: {said}")
    return set(said.values())


same = read(4, 6, 1) == {"as stored"}
mirrored = all(read(4, 6, orientation) == {"turned, (4, 6)"} for orientation in (2, 3, 4))
missing = all(read(4, 6, orientation) == {"None"} for orientation in (5, 6, 7, 8))
square = "None" not in read(5, 5, 6)
sys.exit(not (same and mirrored and missing and square))
PYTHON
