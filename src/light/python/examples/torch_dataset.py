"""Pairs of dark and noise-free images from a folder, for PyTorch.

    python torch_dataset.py FOLDER
"""

import random
import sys
from pathlib import Path

import darkqa_light
import numpy as np
import torch
from PIL import Image
from torch.utils.data import DataLoader, Dataset


class DarkPairs(Dataset):
    """(dark, target) of each image: float32[3, H, W] from 0 to 1, at an exposure drop drawn for each image and epoch."""

    def __init__(self, folder, profile="physical", drops=(1.0, 7.0), seed=0):
        self.files = sorted(Path(folder).glob("*.png"))
        self.profile, self.drops, self.seed, self.epoch = profile, drops, seed, 0

    def __len__(self):
        return len(self.files)

    def __getitem__(self, index):
        image = np.asarray(Image.open(self.files[index]).convert("RGB"))
        key = f"{self.files[index].name} in epoch {self.epoch}"
        how = {
            "ev": random.Random(f"{self.seed} {key}").uniform(*self.drops),
            "profile": self.profile,
            "seed": self.seed,
            "key": key,
        }
        pair = [darkqa_light.degrade(image, noise=noise, **how) for noise in (True, False)]
        return tuple(torch.from_numpy(codes).permute(2, 0, 1).float() / 255 for codes in pair)


def main():
    pairs = DarkPairs(sys.argv[1])
    for pairs.epoch in range(2):
        # Workers are started in each epoch, with its number.
        for dark, target in DataLoader(pairs, batch_size=4, shuffle=True, num_workers=2):
            error = torch.nn.functional.mse_loss(dark, target)
            print(f"epoch {pairs.epoch}: {tuple(dark.shape)}, mean squared error {error:.6f}")


if __name__ == "__main__":
    main()
