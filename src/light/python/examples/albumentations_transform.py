"""A transform for Albumentations: less light and sensor noise in the image, nothing in boxes, masks and key points.

    python albumentations_transform.py IMAGE
"""

import sys

import albumentations as A
import darkqa_light
import numpy as np
from PIL import Image


class Darken(A.ImageOnlyTransform):
    """Darken an image by an exposure drop in EV that is drawn from a range."""

    def __init__(self, drops=(1.0, 7.0), profile="physical", p=0.5):
        super().__init__(p=p)
        self.drops, self.profile = drops, profile

    def get_params(self):
        # Draws of the transform's own generators, so that `seed` of Compose decides them.
        return {"ev": self.py_random.uniform(*self.drops), "seed": self.py_random.getrandbits(64)}

    def apply(self, img, ev, seed, **params):
        return darkqa_light.degrade(img, ev=ev, profile=self.profile, seed=seed)


def main():
    image = np.asarray(Image.open(sys.argv[1]).convert("RGB"))
    transform = A.Compose([A.HorizontalFlip(p=0.5), Darken(p=1.0)], seed=1)
    dark = transform(image=image)["image"]
    print(f"{dark.shape}, {dark.dtype}: mean code {image.mean():.1f} before, {dark.mean():.1f} after")


if __name__ == "__main__":
    main()
