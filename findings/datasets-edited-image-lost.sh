#!/usr/bin/env bash
# datasets: a PIL image that was opened from a file and changed in place is stored as the file, without the change.
#
# Guess: Dataset.from_dict with the Image feature stores the pixels that the image object holds at that moment.
# Seen with datasets 5.2.0 and Pillow 13.0.0: for an image that still has its filename only the path is stored, so that
# pixels set by putpixel, paste or ImageDraw are gone when the row is read. A copy() is stored with its pixels. So an
# image that was darkened or masked in place comes back bright and unmasked, and the training set is not what was made.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check datasets==5.2.0 pillow==13.0.0
cd "$folder"
HF_HOME=$folder HF_HUB_OFFLINE=1 "$folder/venv/bin/python" - <<'PYTHON'
import sys

import datasets
import PIL
from PIL import Image, ImageDraw

print(f"datasets {datasets.__version__}, Pillow {PIL.__version__}")
Image.new("L", (4, 4), 10).save("image.png")
image = Image.open("image.png")
ImageDraw.Draw(image).rectangle((0, 0, 3, 3), fill=200)


def stored(picture):
    features = datasets.Features({"image": datasets.Image()})
    rows = datasets.Dataset.from_dict({"image": [picture]}, features=features)
    raw = rows.cast_column("image", datasets.Image(decode=False))[0]["image"]
    return rows[0]["image"].getpixel((0, 0)), raw["bytes"] is not None


edited, copied = stored(image), stored(image.copy())
print(f"pixel in memory {image.getpixel((0, 0))}")
print(f"changed in place: read back {edited[0]}, bytes stored {edited[1]}")
print(f"copy of it: read back {copied[0]}, bytes stored {copied[1]}")
sys.exit(not (image.getpixel((0, 0)) == 200 and edited == (10, False) and copied == (200, True)))
PYTHON
