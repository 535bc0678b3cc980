"""`find_darkqa_bin`, `run` and `python -m darkqa_eval`: the program is found and called, and its exit code is passed on."""

import contextlib
import importlib.util
import io
import os
import shutil
import subprocess
import sys
import sysconfig
import unittest
from pathlib import Path
from unittest import mock

import darkqa_eval
from darkqa_eval import __main__, _find, find_darkqa_bin, run
from support import RunTest

PACKAGE = Path(darkqa_eval.__file__).parent
PROGRAM = "darkqa-eval" + (sysconfig.get_config_var("EXE") or "")
BIN = "Scripts" if os.name == "nt" else "bin"


class Find(RunTest):
    def module_in(self, packages):
        """The module, as it is when a copy of the package in this folder is imported."""
        copy = shutil.copytree(PACKAGE, self.folder / packages / "darkqa_eval")
        spec = importlib.util.spec_from_file_location("copied", copy / "_find.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    def program_in(self, folder):
        program = self.folder / folder / PROGRAM
        program.parent.mkdir(parents=True, exist_ok=True)
        program.touch()
        return str(program)

    def test_the_program_of_the_installation_that_holds_the_module(self):
        places = [
            ("prefix/lib/python3.12/site-packages", f"prefix/{BIN}"),
            ("fedora/lib64/python3.12/site-packages", f"fedora/{BIN}"),
            ("debian/lib/python3/dist-packages", f"debian/{BIN}"),
            ("windows/Lib/site-packages", f"windows/{BIN}"),
            ("target", f"target/{BIN}"),
        ]
        for packages, programs in places:
            with self.subTest(packages):
                module = self.module_in(packages)
                program = self.program_in(programs)
                self.assertEqual(Path(module.find_darkqa_bin()), Path(program))

    def test_other_places_in_order_and_the_error_lists_all(self):
        module = self.module_in("elsewhere")

        def path(name, scheme=None, vars=None):
            self.assertEqual(name, "scripts")
            return str(self.folder / ("user" if scheme else "base" if vars else "scripts"))

        with mock.patch.object(sysconfig, "get_path", path):
            with self.assertRaises(FileNotFoundError) as raised:
                module.find_darkqa_bin()
            for place in (f"elsewhere/{BIN}", "scripts", "base", "user"):
                self.assertIn(f"  {self.folder / place}\n", str(raised.exception))
            self.assertIn("pip install --force-reinstall", str(raised.exception))
            for place in ("user", "base", "scripts"):
                program = self.program_in(place)
                self.assertEqual(module.find_darkqa_bin(), program)

    def test_the_library_of_this_python_is_handed_over_without_importing_it(self):
        name = {"win32": "onnxruntime.dll", "darwin": "libonnxruntime.{}.dylib"}.get(sys.platform, "libonnxruntime.so.{}")
        folder = self.folder / "packages" / "onnxruntime" / "capi"
        folder.mkdir(parents=True)
        (folder.parent / "__init__.py").write_text("raise AssertionError('imported')")
        variables = {name: value for name, value in os.environ.items() if name != "ORT_DYLIB_PATH"}
        with mock.patch.object(sys, "path", [str(folder.parents[1])]), mock.patch.dict(os.environ, variables, clear=True):
            self.assertEqual(_find.environment(), variables)
            for version in ("1.9.2", "1.20.0"):
                (folder / name.format(version)).touch()
            (folder / "libonnxruntime_providers_shared.so").touch()
            library = str(folder / name.format("1.20.0"))
            self.assertEqual(_find.environment(), {**variables, "ORT_DYLIB_PATH": library})
            os.environ["ORT_DYLIB_PATH"] = "own.so"
            self.assertEqual(_find.environment()["ORT_DYLIB_PATH"], "own.so")
        with mock.patch.object(sys, "path", []), mock.patch.dict(os.environ, variables, clear=True):
            self.assertEqual(_find.environment(), variables)


class Run(RunTest):
    def test_run(self):
        called = run("--version", capture_output=True, text=True)
        self.assertRegex(called.stdout, r"^darkqa-eval \d")
        run("man", self.folder / "man", stdout=subprocess.DEVNULL)
        self.assertTrue((self.folder / "man" / "darkqa-eval.1").is_file())
        with self.assertRaises(subprocess.CalledProcessError) as raised:
            run("--no-such-flag", capture_output=True)
        self.assertEqual(raised.exception.returncode, 2)
        called = run("report", "nowhere", check=False, cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(called.returncode, 2)
        self.assertIn("nowhere", called.stderr)

    def test_the_module_passes_arguments_and_exit_codes_on(self):
        self.call("rooms --out rooms --frames 2 --size 96x64")
        self.call("questions rooms --out rooms/questions.jsonl")
        questions = (self.folder / "rooms" / "questions.jsonl").read_text(encoding="utf-8").splitlines()
        self.assertGreater(len(questions), 3)
        first = questions[0].split('"id":"')[1].split('"')[0]
        self.write_lines("some.jsonl", [{"question": first, "reply": "A"}])
        self.write_lines("all.jsonl", [{"default": "A"}])
        asked = "--data rooms --levels L0 --quiet --limit 3 --model script:"
        for words, code in ((f"{asked}all.jsonl", 0), (f"{asked}some.jsonl", 1), (f"{asked}none.jsonl", 2), ("--version", 0)):
            with self.subTest(words):
                command = [sys.executable, "-m", "darkqa_eval", *words.split()]
                called = subprocess.run(command, cwd=self.folder, check=False, capture_output=True, text=True, encoding="utf-8")
                self.assertEqual(called.returncode, code, called.stderr)

    def test_a_missing_program_is_an_error_without_a_traceback(self):
        error = io.StringIO()
        missing = FileNotFoundError("no darkqa-eval")
        with mock.patch.object(__main__, "find_darkqa_bin", side_effect=missing), contextlib.redirect_stderr(error):
            self.assertEqual(__main__.main(), 2)
        self.assertEqual(error.getvalue(), "error: no darkqa-eval\n")

    def test_the_package_is_light(self):
        """Neither pandas nor onnxruntime is imported with it, and its functions are those it promises."""
        code = "import sys, darkqa_eval; print(*{'pandas', 'numpy', 'onnxruntime'} & set(sys.modules))"
        called = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        self.assertEqual(called.stdout, "\n")
        self.assertEqual(darkqa_eval.__all__, ["find_darkqa_bin", "load_run", "run"])
        self.assertTrue(Path(find_darkqa_bin()).is_file())
        self.assertTrue((PACKAGE / "py.typed").is_file())


if __name__ == "__main__":
    unittest.main()
