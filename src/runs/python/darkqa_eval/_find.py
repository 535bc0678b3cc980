"""The installed program: where it is, what it needs in its environment, and a call of it."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PROGRAM = "darkqa-eval" + (sysconfig.get_config_var("EXE") or "")
_SCRIPTS = "Scripts" if os.name == "nt" else "bin"


def find_darkqa_bin() -> str:
    """Return the path of the program ``darkqa-eval`` that was installed with this package.

    Raises:
        FileNotFoundError: The program is in none of the folders where installers put it. The error lists them.
    """
    searched: list[Path] = []
    for folder in _folders():
        program = folder / _PROGRAM
        if program.is_file():
            return str(program)
        if folder not in searched:
            searched.append(folder)
    places = "\n".join(f"  {folder}" for folder in searched)
    raise FileNotFoundError(
        f"no {_PROGRAM} beside the Python package darkqa_eval; searched:\n{places}\n"
        "Install the package again, in a clone of its repository: pip install --force-reinstall --no-deps ."
    )


def run(*args: str | os.PathLike[str], check: bool = True, **options: Any) -> subprocess.CompletedProcess[Any]:
    """Run ``darkqa-eval`` with these arguments and wait for its end.

    ``run("--model", "observer", "--out", folder)`` is the command ``darkqa-eval --model observer --out FOLDER``.

    Args:
        *args: The words of the command line.
        check: Raise ``subprocess.CalledProcessError`` if the exit code is not 0. Code 1 says that the run is complete
            except for failed trials.
        **options: Further arguments of ``subprocess.run``, for example ``capture_output=True`` or ``cwd=FOLDER``.
    """
    options.setdefault("env", environment())
    return subprocess.run([find_darkqa_bin(), *(os.fspath(arg) for arg in args)], check=check, **options)


def environment() -> dict[str, str]:
    """The environment of this process, with ``ORT_DYLIB_PATH`` set to the library of this Python's ONNX Runtime.

    The program finds a library beside itself without it. The variable is for layered environments (``uv run --with``), in
    which only this Python knows all folders. A value that is set already stays.
    """
    variables = dict(os.environ)
    if not variables.get("ORT_DYLIB_PATH"):
        libraries = _libraries()
        if libraries:
            variables["ORT_DYLIB_PATH"] = str(libraries[-1])
    return variables


def _folders() -> Iterator[Path]:
    """The folders in which installers put programs, those of the installation that holds this module first.

    So a module that was imported from another installation than that of the running Python starts its own program.
    """
    packages = Path(__file__).absolute().parent.parent
    # `pip install --target T`: T/darkqa_eval and T/bin.
    yield packages / _SCRIPTS
    # A prefix P: P/lib/python3.12/site-packages and P/bin; on Windows P/Lib/site-packages and P/Scripts.
    prefix = re.match(r"(.*)/lib(64)?/(python[^/]*/)?(site|dist)-packages$", packages.as_posix(), re.IGNORECASE)
    if prefix:
        yield Path(prefix[1], _SCRIPTS)
    yield Path(sysconfig.get_path("scripts"))
    yield Path(sysconfig.get_path("scripts", vars={"base": sys.base_prefix}))
    yield Path(sysconfig.get_path("scripts", scheme=_user_scheme()))


def _user_scheme() -> str:
    """The scheme of ``pip install --user``."""
    if sys.version_info >= (3, 10):
        return sysconfig.get_preferred_scheme("user")
    if os.name == "nt":
        return "nt_user"
    if sys.platform == "darwin" and getattr(sys, "_framework", ""):
        return "osx_framework_user"
    return "posix_user"


def _libraries() -> list[Path]:
    """The libraries of the package onnxruntime, the newest last. The package itself is not imported."""
    package = importlib.util.find_spec("onnxruntime")
    if package is None or not package.submodule_search_locations:
        return []
    pattern = {"win32": "onnxruntime.dll", "darwin": "libonnxruntime.*dylib"}.get(sys.platform, "libonnxruntime.so*")
    found = [path for place in package.submodule_search_locations for path in Path(place, "capi").glob(pattern)]
    return sorted(found, key=lambda path: [int(number) for number in re.findall(r"\d+", path.name)])
