#!/usr/bin/env bash
# webdataset decodes a 16-bit grey PNG to an image in which all but the darkest 0.4 % is white.
#
# Guess: decode("rgb") and decode("l") give floats from 0 to 1, so that 65535 becomes 1 and 32768 becomes 0.5.
# Seen with webdataset 1.0.2, Pillow 13.0.0 and numpy 2.4.6: the value is cut off at 255, then divided by 255. So 255,
# 300, 32768 and 65535 all become 1.0, and 128 becomes 0.5, for "l" and "rgb", and 255 for "l8", "rgb8" and "pil".
# Nothing is warned of. Pictures with 8 bits are right.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check webdataset==1.0.2 pillow==13.0.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/images.tar" <<'PYTHON'
import io
import sys
import warnings
from importlib.metadata import version

import numpy as np
import PIL.Image
import webdataset

print(f"webdataset {version('webdataset')}, Pillow {PIL.__version__}, numpy {np.__version__}")
values = np.array([[0, 128, 255, 300, 32768, 65535]], np.uint16)
file = io.BytesIO()
PIL.Image.fromarray(values).save(file, "PNG")
with webdataset.TarWriter(sys.argv[1]) as writer:
    writer.write({"__key__": "0", "png": file.getvalue()})
print(f"given {values.ravel().tolist()}")
found = {}
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    for kind in "l", "rgb", "l8", "rgb8", "pil":
        sample = next(iter(webdataset.WebDataset(sys.argv[1], shardshuffle=False).decode(kind)))
        array = np.asarray(sample["png"])
        found[kind] = (array[..., 0] if array.ndim == 3 else array).ravel().round(3).tolist()
        print(f"{kind}: {array.dtype} {found[kind]}")
clipped = [0, 128, 255, 255, 255, 255]
print(f"warnings about pixels: {[str(w.message) for w in caught if 'pixel' in str(w.message).lower()]}")
sys.exit(
    not (
        all(found[kind] == clipped for kind in ("l8", "rgb8", "pil"))
        and all(np.allclose(found[kind], np.array(clipped) / 255, atol=1e-3) for kind in ("l", "rgb"))
    )
)
PYTHON
