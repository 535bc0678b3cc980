"""The examples run, without skipping, and the page shows the code that runs."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
from PIL import Image

TOP = Path(__file__).resolve().parents[2]
EXAMPLES = TOP / "src" / "light" / "python" / "examples"
PAGE = TOP / "src" / "docs" / "training.md"


class Examples(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        for i in range(5):
            codes = np.random.default_rng(i).integers(100, 256, (48, 64, 3), dtype=np.uint8)
            Image.fromarray(codes).save(cls.folder / f"{i}.png")

    def run_example(self, name, argument):
        # No example asks the network.
        offline = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(self.folder / "cache"), "NO_ALBUMENTATIONS_UPDATE": "1"}
        command = [sys.executable, EXAMPLES / name, argument]
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | offline, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    @unittest.skipUnless(importlib.util.find_spec("torch"), "PyTorch is installed with LONG=1 .ci/light_module")
    def test_torch(self):
        lines = self.run_example("torch_dataset.py", self.folder).splitlines()
        self.assertEqual(len(lines), 4)
        self.assertIn("(4, 3, 48, 64)", lines[0])

    def test_albumentations(self):
        text = self.run_example("albumentations_transform.py", self.folder / "0.png")
        self.assertIn("(48, 64, 3), uint8", text)
        self.assertEqual(text, self.run_example("albumentations_transform.py", self.folder / "0.png"))

    def test_datasets(self):
        text = self.run_example("datasets_map.py", self.folder)
        self.assertEqual([line.split(":")[0] for line in text.splitlines()], [f"{i}.png" for i in range(5)])

    def test_the_page_shows_them(self):
        page = PAGE.read_text(encoding="utf-8")
        for name in ["torch_dataset.py", "albumentations_transform.py", "datasets_map.py"]:
            code = (EXAMPLES / name).read_text(encoding="utf-8")
            body = code.split('"""\n', 1)[1].split("\n\ndef main", 1)[0].strip()
            self.assertIn(body, page, f"{name} is not on the page as it runs")


if __name__ == "__main__":
    unittest.main()
