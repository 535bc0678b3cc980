"""The module makes the bytes that `darkqa-eval synthesize` writes. The program is that of the variable PROGRAM."""

import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np
from PIL import Image

import darkqa_light

SIZES = [(48, 64), (37, 151), (1, 7)]
PROFILES = ["paper", "eld", "level", "physical"]
LIGHT_LEVELS = ["L0", "L1", "L2", "L3", "L4", "L5", "E3.3", "E2.2"]
TIMES = ["T8.33", "T33.33", "T50"]
SEED = 7


def picture(height, width):
    """Random codes, with black and white among them."""
    codes = np.random.default_rng(height).integers(0, 256, (height, width, 3), dtype=np.uint8)
    codes[:, : width // 4] //= 16
    codes[0, 0], codes[-1, -1] = 0, 255
    return codes


class SameBytes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.images = Path(folder.name, "images")
        cls.out = Path(folder.name, "out")
        cls.images.mkdir()
        for height, width in SIZES:
            Image.fromarray(picture(height, width)).save(cls.images / f"{height}x{width}.png")

    def synthesize(self, *flags):
        command = [os.environ["PROGRAM"], "synthesize", self.images, "--seed", str(SEED), *flags]
        subprocess.run([*command, "--out", self.out, "--force"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def check(self, condition, level, variant, profile="paper", camera=None):
        for height, width in SIZES:
            stem = self.out / f"{height}x{width}_{condition}"
            expected = np.asarray(Image.open(f"{stem}.png").convert("RGB"))
            frame = json.loads(Path(f"{stem}.json").read_text())["frame"]
            with self.subTest(condition=condition, size=(height, width)):
                clean = picture(height, width)
                made = darkqa_light.degrade(clean, level, variant, profile, camera, SEED, frame)
                np.testing.assert_array_equal(made, expected)
                state = darkqa_light.sensor_state(level, variant, profile, camera, SEED, frame, width=width)
                state = json.loads(json.dumps(state))
                np.testing.assert_array_equal(darkqa_light.replay(clean, state), expected)
                (of_ladder,) = darkqa_light.ladder(clean, [level], variant, profile, camera, SEED, frame)
                np.testing.assert_array_equal(of_ladder, expected)

    def test_variants_of_light_in_all_profiles(self):
        self.synthesize("--levels", "L0-L5,3.3,2.2", "--variant", "ev,noise,auto", "--profile", "all")
        for level in LIGHT_LEVELS:
            if level == "L0":
                self.check("L0", level, "noise")
                continue
            self.check(f"{level}-ev", level, "ev")
            self.check(f"{level}-auto", level, "auto")
            for profile in PROFILES:
                named = "" if profile == "paper" else f"@{profile}"
                self.check(f"{level}-noise{named}", level, "noise", profile)

    def test_motion(self):
        self.synthesize("--levels", "T8.33,T33.33,T50", "--variant", "motion")
        for time in TIMES:
            self.check(f"{time}-motion", time, "motion")
        self.check("T33.33-motion", "L3", "motion")

    def test_cameras(self):
        for camera in darkqa_light.cameras():
            self.synthesize("--levels", "L2", "--variant", "noise,auto", "--camera", camera, "--profile", "eld")
            self.check("L2-noise@eld", "L2", "noise", "eld", camera)
            self.check("L2-auto", "L2", "auto", "eld", camera)


if __name__ == "__main__":
    unittest.main()
