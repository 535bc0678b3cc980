#!/usr/bin/env bash
# datasets: interleave_datasets of the same rows gives another number of them for Dataset than for IterableDataset.
#
# Guess: interleave_datasets([a, b]) with 3 and 5 rows gives a0 b0 a1 b1 a2 b2 for both kinds, as to_iterable_dataset()
# only changes how rows are fetched.
# Seen with datasets 5.2.0 and pyarrow 26.0.1: six rows for Dataset, five for IterableDataset, which ends with a2. So
# counts, steps per epoch and the balance of the classes differ between streaming and not streaming, and the last row of
# the other sources is missed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check datasets==5.2.0 pyarrow==26.0.1
cd "$folder"
HF_HOME=$folder HF_HUB_OFFLINE=1 "$folder/venv/bin/python" - <<'PYTHON'
import sys

import datasets
import pyarrow
from datasets import Dataset, interleave_datasets

print(f"datasets {datasets.__version__}, pyarrow {pyarrow.__version__}")
sources = [Dataset.from_dict({"row": [f"{name}{n}" for n in range(count)]}) for name, count in (("a", 3), ("b", 5))]
whole = [row["row"] for row in interleave_datasets(sources)]
streamed = [row["row"] for row in interleave_datasets([source.to_iterable_dataset() for source in sources])]
print(f"Dataset:         {whole}")
print(f"IterableDataset: {streamed}")
sys.exit(not (whole == ["a0", "b0", "a1", "b1", "a2", "b2"] and streamed == whole[:-1]))
PYTHON
