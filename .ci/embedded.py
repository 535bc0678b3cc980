"""The files that are compiled into the program by `include_str!` and `include_bytes!`, as paths from the top."""

import re
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
# The folders of Rust sources that are built into the program.
FOLDERS = ("src", "models", "prompts")
TESTS = re.compile(r"#\[cfg\(test\)\]\s+(pub\S* )?mod tests \{")
EMBEDDED = re.compile(r'include_(?:str|bytes)!\(\s*"([^"]+)"')


def rust_files():
    return [file for folder in FOLDERS for file in TOP.glob(f"{folder}/**/*.rs")]


def embedded_files():
    files = set()
    for source in rust_files():
        if source.name == "tests.rs" or "tests" in source.relative_to(TOP).parent.parts:
            continue
        program = TESTS.split(source.read_text(encoding="utf-8"))[0]
        for name in EMBEDDED.findall(program):
            files.add((source.parent / name).resolve().relative_to(TOP).as_posix())
    if "prompts/choice.txt" not in files:
        sys.exit(".ci/embedded.py no longer finds the files that src/ embeds: mend its pattern")
    return files
