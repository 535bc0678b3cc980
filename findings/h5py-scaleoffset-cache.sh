#!/usr/bin/env bash
# h5py gives back exact values from a lossy dataset as long as it is open, and the damaged ones only after that.
#
# Guess: what is read from a dataset with a lossy filter is what the file holds, at the latest after flush().
# Seen with h5py 3.16.0 (HDF5 2.0.0) and numpy 2.4.6: with scaleoffset=2 (two bits a value) the values 0, 7, 14, 21, 28
# read back unchanged after flush(), since the chunk stays in memory as it was given. Once the dataset is let go they
# are 0, 7, 0, 9, 8. With floats, NaN reads back as NaN at first and as the smallest value of the chunk later. So a
# writer that checks its own file before it closes it sees no loss.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check h5py==3.16.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder/values.h5" <<'PYTHON'
import sys

import h5py
import numpy as np

print(f"h5py {h5py.__version__}, HDF5 {h5py.version.hdf5_version}, numpy {np.__version__}")
path = sys.argv[1]


def write(values, **filters):
    with h5py.File(path, "w") as file:
        dataset = file.create_dataset("a", data=values, chunks=values.shape, **filters)
        file.flush()
        before = dataset[...]
    with h5py.File(path) as file:
        after = file["a"][...]
    print(f"{filters}: before closing {before[:5]}, after {after[:5]}")
    return np.array_equal(before, values, equal_nan=True), after[:5].tolist()


whole = np.arange(0, 1000, 7, dtype=np.uint16)
parts = np.linspace(-1, 1, 101, dtype=np.float32)
parts[3] = np.nan
held, wholes = write(whole, scaleoffset=2)
held_too, floats = write(parts, scaleoffset=3)
sys.exit(not (held and held_too and wholes == [0, 7, 0, 9, 8] and floats[3] == -1.0))
PYTHON
