"""The noise ladder of each image of a Hugging Face data set, with the parameters of its sensor.

    python datasets_map.py FOLDER
"""

import json
import sys
from pathlib import Path

import darkqa_light
import numpy as np
from datasets import Dataset, Image

LEVELS = ["L1", "L3", "L5"]


def ladder(row):
    image = np.asarray(row["image"].convert("RGB"))
    images = darkqa_light.ladder(image, LEVELS, profile="eld", key=row["name"])
    state = darkqa_light.sensor_state("L1", profile="eld", key=row["name"])
    return {**dict(zip(LEVELS, images)), "sensor": json.dumps(state)}


def main():
    files = sorted(Path(sys.argv[1]).glob("*.png"))
    rows = {"name": [file.name for file in files], "image": [str(file) for file in files]}
    clean = Dataset.from_dict(rows).cast_column("image", Image())
    dark = clean.map(ladder, num_proc=2)
    for row in dark:
        gain = json.loads(row["sensor"])["system_gain"]
        means = ", ".join(f"{level} {np.mean(row[level]):.1f}" for level in LEVELS)
        print(f"{row['name']}: K {gain:.2f} ADU per electron; mean codes {means}")


if __name__ == "__main__":
    main()
