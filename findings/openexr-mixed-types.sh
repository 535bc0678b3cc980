#!/usr/bin/env bash
# OpenEXR's Python package writes a file whose colours have two pixel types, and then refuses to open it.
#
# Guess: R as half with G and B as float reads back as three arrays, or as one RGB array of float.
# Seen with openexr 3.5.3 and numpy 2.4.6: OpenEXR.File(path) raises ValueError, "cannot coalesce channels". It opens
# with separate_channels=True. Channels of two types with names other than R, G, B and A raise nothing. So a
# loop over renderings that uses the plain call stops at the first file that keeps one colour at lower precision.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check openexr==3.5.3 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/picture.exr" <<'PYTHON'
import sys

import numpy as np
import OpenEXR

print(f"OpenEXR {OpenEXR.__version__}, numpy {np.__version__}")
path = sys.argv[1]
half, single = np.full((4, 6), 0.5, np.float16), np.full((4, 6), 0.1, np.float32)


def read(channels, **options):
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(path)
    try:
        with OpenEXR.File(path, **options) as file:
            said = {name: str(channel.pixels.dtype) for name, channel in file.channels().items()}
    except ValueError as error:
        said = str(error)
    print(f"{list(channels)}, {options}: {said}")
    return said


plain = read({"R": half, "G": single, "B": single})
apart = read({"R": half, "G": single, "B": single}, separate_channels=True)
other = read({"X": half, "Y": single, "Z": single})
sys.exit(not ("coalesce" in plain and apart == {"R": "float16", "G": "float32", "B": "float32"} and len(other) == 3))
PYTHON
