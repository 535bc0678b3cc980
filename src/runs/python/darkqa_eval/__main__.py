"""``python -m darkqa_eval``: the program, with the ONNX Runtime of this Python."""

import os
import subprocess
import sys

from ._find import environment, find_darkqa_bin


def main() -> int:
    """Start the program with the arguments of this process; on Unix it takes the place of this process."""
    try:
        program = find_darkqa_bin()
    except FileNotFoundError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    words = [program, *sys.argv[1:]]
    if sys.platform != "win32":
        os.execve(program, words, environment())
    # Windows cannot replace a process, so this one waits and passes the exit code on. Ctrl-C reaches both processes: the
    # program finishes the requests in flight, and this one waits for it.
    child = subprocess.Popen(words, env=environment())
    while True:
        try:
            return child.wait()
        except KeyboardInterrupt:
            continue


if __name__ == "__main__":
    sys.exit(main())
