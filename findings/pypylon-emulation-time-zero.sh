#!/usr/bin/env bash
# pypylon's emulated camera: every frame has the time stamp 0, although it keeps its frame rate on the clock.
#
# Guess: GrabResult.TimeStamp grows by 100 ms from frame to frame when the emulated camera runs at 10 Hz.
# Seen with pypylon 26.9 (pylon 12.4.2): TimeStamp is 0 for all frames, while they arrive 0.1 s apart, ImageNumber
# counts from 1, and BlockID from 0. So a recorder that is tested with the emulation writes all frames at one moment,
# and whoever sorts, thins out or synchronises by this stamp gets a single frame, or divides by zero.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pypylon==26.9 numpy==2.4.6
PYLON_CAMEMU=1 "$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import sys
import time

from pypylon import pylon

print(f"pypylon {importlib.metadata.version('pypylon')}, pylon {pylon.GetPylonVersionString()}")
camera = pylon.InstantCamera(pylon.TlFactory.GetInstance().CreateFirstDevice())
camera.Open()
camera.Width.Value, camera.Height.Value = 64, 48
camera.AcquisitionFrameRateEnable.Value = True
camera.AcquisitionFrameRateAbs.Value = 10.0
camera.StartGrabbingMax(5)
stamps, numbers, blocks, clock = [], [], [], []
while camera.IsGrabbing():
    with camera.RetrieveResult(5000, pylon.TimeoutHandling_ThrowException) as result:
        stamps.append(result.TimeStamp)
        numbers.append(result.ImageNumber)
        blocks.append(result.BlockID)
        clock.append(time.monotonic())
camera.Close()
print(f"TimeStamp {stamps}, ImageNumber {numbers}, BlockID {blocks}")
print("seconds between frames:", [round(after - before, 2) for before, after in zip(clock, clock[1:])])
sys.exit(not (stamps == [0] * 5 and numbers == [1, 2, 3, 4, 5] and blocks == [0, 1, 2, 3, 4]))
PYTHON
