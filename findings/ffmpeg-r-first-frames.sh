#!/usr/bin/env bash
# ffmpeg: -r 10 behind a 30 fps video keeps the first three frames, runs 0.13 s late and gives two frames too many.
#
# Guess: -r 10 as an output option takes every third frame, so that 60 frames at 30 fps become 20, as the fps filter
# does.
# Seen with ffmpeg 9.0.2 (imageio-ffmpeg 0.8.1): 22 frames, 0 1 2 5 8 11 ... 59. From the third on, frame n shows frame
# 3n-4 of the source, not 3n. The filter fps=10 gives 20 frames, 1 4 7 ... 58. So labels that are looked up as n / 10 s
# belong to another moment, 4 source frames (0.13 s) later than the picture, and the film is 2.2 s instead of 2.0 s
# long.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check imageio-ffmpeg==0.8.1
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import subprocess
import sys

import imageio_ffmpeg

ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
first = subprocess.run([ffmpeg, "-version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
print(f"imageio-ffmpeg {imageio_ffmpeg.__version__}: {first.split(' Copyright')[0]}")
SIZE = 64 * 64


def call(*options, data=None):
    return subprocess.run([ffmpeg, "-v", "error", "-y", *options], input=data, capture_output=True, check=True).stdout


def numbers(*options):
    out = call("-i", "source.mkv", *options, "-f", "rawvideo", "-pix_fmt", "gray", "-")
    return [out[at] // 4 for at in range(0, len(out), SIZE)]


# Each frame is flat, and its grey value is four times its number.
frames = b"".join(bytes([4 * n]) * SIZE for n in range(60))
raw = ["-f", "rawvideo", "-pix_fmt", "gray", "-s", "64x64", "-r", "30", "-i", "-"]
call(*raw, "-c:v", "ffv1", "source.mkv", data=frames)
option, filtered = numbers("-r", "10"), numbers("-vf", "fps=10")
print(f"-r 10:      {len(option)} frames {option}")
print(f"-vf fps=10: {len(filtered)} frames {filtered}")
sys.exit(not (option == [0, 1] + list(range(2, 60, 3)) and filtered == list(range(1, 60, 3))))
PYTHON
