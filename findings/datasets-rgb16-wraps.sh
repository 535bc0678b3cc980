#!/usr/bin/env bash
# datasets: a 16-bit RGB array becomes an 8-bit image modulo 256, while a 16-bit grey array keeps its values.
#
# Guess: the Image feature refuses a uint16 array of height, width and 3, or divides it by 257, as PNG could hold it.
# Seen with datasets 5.2.0, Pillow 13.0.0 and numpy 2.4.6: the row is read as 8-bit RGB with 300 as 44 and 65280 as 0.
# The only sign is a UserWarning about a downcast. A grey uint16 array comes back exactly. So linear 16-bit frames turn
# into noise with bands, and their brightest parts are black.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check datasets==5.2.0 pillow==13.0.0 numpy==2.4.6
cd "$folder"
HF_HOME=$folder HF_HUB_OFFLINE=1 "$folder/venv/bin/python" - <<'PYTHON'
import sys
import warnings

import datasets
import numpy as np
import PIL

print(f"datasets {datasets.__version__}, Pillow {PIL.__version__}, numpy {np.__version__}")
values = np.array([[100, 255, 256, 300], [4096, 32768, 65280, 65535]], np.uint16)


def stored(array):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        features = datasets.Features({"image": datasets.Image()})
        image = datasets.Dataset.from_dict({"image": [array]}, features=features)[0]["image"]
    print(f"{array.shape}: mode {image.mode}, warnings {[str(w.message) for w in caught]}")
    return np.array(image)


grey, colour = stored(values), stored(np.stack([values] * 3, axis=-1))
print(f"given {values.ravel()}")
print(f"grey  {grey.ravel()}")
print(f"RGB   {colour[..., 0].ravel()}")
sys.exit(not ((grey == values).all() and colour.dtype == np.uint8 and (colour[..., 0] == values % 256).all()))
PYTHON
