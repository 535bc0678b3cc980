"""`models/export.py`, without PyTorch: what it writes beside a model and into it, and what it says of files that are missing."""

import contextlib
import importlib.util
import io
import os
import shutil
import subprocess
import sys
import types
from unittest import mock

from support import REPOSITORY, RunTest

MODELS = REPOSITORY / "models"
COMMITTER = {"GIT_AUTHOR_NAME": "a", "GIT_AUTHOR_EMAIL": "a@b", "GIT_COMMITTER_NAME": "a", "GIT_COMMITTER_EMAIL": "a@b"}


def script():
    """The script as a module, with empty modules for the packages that are not installed for the tests."""
    torch = types.ModuleType("torch")
    torch.nn = types.SimpleNamespace(Module=object)
    empty = {name: types.ModuleType(name) for name in ("numpy", "onnx", "onnxruntime")}
    spec = importlib.util.spec_from_file_location("exporting", MODELS / "export.py")
    loaded = importlib.util.module_from_spec(spec)
    with mock.patch.dict(sys.modules, {"torch": torch, "exporting": loaded, **empty}):
        spec.loader.exec_module(loaded)
    return loaded


class Export(RunTest):
    def setUp(self):
        super().setUp()
        self.script = script()

    def git(self, folder, *words):
        variables = {**os.environ, **COMMITTER, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
        subprocess.run(["git", "-C", folder, *words], check=True, capture_output=True, env=variables)

    def checkout(self):
        """A checkout of one commit."""
        repo = self.folder.resolve() / "repo"
        (repo / "inner").mkdir(parents=True)
        (repo / "inner" / "model.py").write_text("1\n", encoding="utf-8")
        self.git(repo, "init", "--quiet")
        self.git(repo, "add", ".")
        self.git(repo, "commit", "--quiet", "--message", "one")
        return repo

    def refusal(self, *words):
        """What the script says when it ends before it has built a model."""
        said = io.StringIO()
        with mock.patch.object(sys, "argv", ["export.py", *map(str, words)]), contextlib.redirect_stderr(said):
            with self.assertRaises(SystemExit) as raised:
                self.script.main()
        return f"{said.getvalue()}{raised.exception.code}"

    def test_the_program_reads_every_sidecar(self):
        for name, model in self.script.MODELS.items():
            for any_size in (True, False):
                with self.subTest(name, any_size=any_size):
                    shutil.copy(MODELS / "gray-gain.onnx", self.folder / "model.onnx")
                    (self.folder / "model.onnx.toml").write_text(model.sidecar(any_size), encoding="utf-8")
                    self.call("enhance model.onnx --describe")

    def test_multiples_are_for_any_size_alone(self):
        model = self.script.MODELS["retinexformer"]
        self.assertIn('multiple = 4\npad = "reflect"\n', model.sidecar(True))
        self.assertNotIn("multiple", model.sidecar(False))
        self.assertNotIn("pad", model.sidecar(False))

    def test_a_checkout_is_named_without_its_password(self):
        repo = self.checkout()
        self.git(repo, "remote", "add", "origin", "https://me:secret@example.org/its/model.git")
        came = self.script.origin(repo)
        self.assertEqual(came["source"], "https://example.org/its/model.git")
        self.assertRegex(came["commit"], "^[0-9a-f]{40}$")
        (repo / "inner" / "model.py").write_text("2\n", encoding="utf-8")
        self.assertEqual(self.script.origin(repo)["commit"], came["commit"] + "-dirty")

    def test_a_folder_that_is_no_checkout_has_no_commit(self):
        unknown = {"source": "unknown", "commit": "unknown"}
        self.assertEqual(self.script.origin(self.folder.resolve()), unknown)
        self.assertEqual(self.script.origin(self.checkout() / "inner"), unknown)
        with mock.patch.dict(os.environ, {"PATH": ""}):
            self.assertEqual(self.script.origin(self.folder / "repo"), unknown)

    def test_a_missing_file_is_named_with_the_repository_that_has_it(self):
        for name, model in self.script.MODELS.items():
            with self.subTest(name):
                size = [] if model.any_size else ["--size", "64x48"]
                words = [name, self.folder, self.folder / "w.pt", self.folder / "out.onnx", *size]
                for file in model.files:
                    said = self.refusal(*words)
                    for part in (str(self.folder.resolve() / file), model.url, model.commit):
                        self.assertIn(part, said)
                    path = self.folder / file
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.touch()
                self.assertIn("w.pt is missing", self.refusal(*words))
                shutil.rmtree(self.folder)
                self.folder.mkdir()

    def test_a_size_that_a_model_does_not_take_is_refused(self):
        cases = [
            ("darkir", [], "give --size WIDTHxHEIGHT"),
            ("zero-dce++", ["--size", "240x130"], "multiples of 12"),
            ("zero-dce", ["--size", "240"], "240 is not WIDTHxHEIGHT"),
            ("zero-dce", ["--size", "0x5"], "0x5 is not WIDTHxHEIGHT"),
        ]
        for model, size, reason in cases:
            with self.subTest(model, size=size):
                self.assertIn(reason, self.refusal(model, "repo", "w.pt", self.folder / "out.onnx", *size))
