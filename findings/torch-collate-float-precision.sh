#!/usr/bin/env bash
# The batch of a PyTorch DataLoader has float64 or float32 numbers, depending on the type of its first number.
#
# Guess: default_collate makes float64 of Python numbers if one of them is a float, in any order.
# Seen with torch 2.15.0: [0.1, 1] becomes float64 and [1, 0.1] float32, as only the first element is looked at. So with
# a field that is 0 (an int, as JSON writes it) in some rows and a float in others, the batches of one epoch differ in
# type and precision: with a first row of 0 a time of 1760000000.25 s is 1760000000, and the next batch has it exactly.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check torch==2.15.0 numpy==2.4.6
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
import json
import sys

import torch
from torch.utils.data import DataLoader

print(f"torch {torch.__version__}")
rows = json.loads('[{"time": 0}, {"time": 1760000000.25}, {"time": 1760000000.25}, {"time": 0}]')
batches = [batch["time"] for batch in DataLoader(rows, batch_size=2)]
for batch in batches:
    print(batch.dtype, batch.tolist())
sys.exit(
    [(batch.dtype, batch.tolist()) for batch in batches]
    != [(torch.float32, [0.0, 1760000000.0]), (torch.float64, [1760000000.25, 0.0])]
)
PYTHON
