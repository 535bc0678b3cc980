"""Runs that the tests make with the installed program, in a temporary folder."""

import csv
import json
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from darkqa_eval import find_darkqa_bin

REPOSITORY = Path(__file__).resolve().parents[2]
REFERENCE = REPOSITORY / "results" / "reference"


class RunTest(unittest.TestCase):
    """A test with a folder of its own."""

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def call(self, words, code=0):
        """Call the program in the test's folder, and check its exit code."""
        variables = {name: os.environ[name] for name in ("PATH", "SYSTEMROOT") if name in os.environ}
        called = subprocess.run(
            [find_darkqa_bin(), *words.split(), "--quiet"],
            cwd=self.folder,
            env={**variables, "HOME": str(self.folder)},
            check=False,
            capture_output=True,
            text=True,
            encoding="utf-8",
        )
        self.assertEqual(called.returncode, code, called.stderr)

    def write_lines(self, name, values):
        lines = [json.dumps(value) + "\n" for value in values]
        (self.folder / name).write_text("".join(lines), encoding="utf-8")


def read_lines(path):
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def summary(run):
    """The rows of a run's `summary.csv`."""
    with (run / "summary.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
