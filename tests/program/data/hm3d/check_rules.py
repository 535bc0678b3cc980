"""Checks of single functions of the script, which lies beside this file."""

import array
import math
import pickle
import struct
import time

import hm3d_frames as script


def view(code, numbers, shape=None):
    form = memoryview(array.array(code, numbers)).cast("B")
    return form.cast(code, shape) if shape else form.cast(code)


def refusal(data):
    try:
        script.read_state("walk/0.pkl", data)
    except script.Refused as problem:
        return str(problem)
    raise AssertionError("not refused")


# A view is kept if most pixels are far, few are holes, and three instances have 1 % of the pixels each.
ids = view("I", [1, 2, 3] + [1] * 97)
far, three = view("f", [2.0] * 100), ids
assert script.unfit(far, three) is None
assert script.unfit(view("f", [0.75] * 50 + [2.0] * 50), three) == "too near"
assert script.unfit(view("f", [0.75] * 49 + [2.0] * 51), three) is None
assert script.unfit(view("f", [0.0] * 10 + [2.0] * 90), three) == "holes"
assert script.unfit(view("f", [0.0] * 9 + [2.0] * 91), three) is None
assert script.unfit(far, view("I", [0, 2, 3] + [0] * 97)) == "few instances"
assert script.unfit(view("f", [2.0] * 201), view("I", [1, 1, 1, 2, 2, 3, 3] + [1] * 194)) == "few instances"

# Floors are told apart by a gap of more than 1.5 m.
assert script.floors([(0, 3.1, 0), (0, 0.0, 0), (0, 1.5, 0), (0, 4.7, 0)]) == [1, 0, 0, 2]

# The pose of a camera that is turned by 90 degrees to the left looks along -x, 1.5 m above the agent.
half = math.pi / 4
pose = script.camera_pose({"place": [1.0, 2.0, 3.0], "turn": [0.0, math.sin(half), 0.0, math.cos(half)]}, 1.5)
expected = [0, 0, 1, 1, 0, 1, 0, 3.5, -1, 0, 0, 3, 0, 0, 0, 1]
assert all(abs(a - b) < 1e-12 for a, b in zip(pose, expected)), pose

# Arrays of either byte order, and of protocol 5.
kind = script.Dtype("f8", False, True)
kind.__setstate__((3, ">", None, None, None, -1, -1, 0))
assert kind.read(struct.pack(">2d", 1.5, -2.0)) == [1.5, -2.0]
assert script.from_buffer(bytearray(struct.pack("<2f", 1.5, -2.0)), script.Dtype("f4"), (2,), "C").numbers == [1.5, -2.0]

# What is no state is refused, whatever it is; also a pickle of 11 bytes that wants room for 2 thousand million entries.
start = time.time()
for data in [b"", b"no pickle", pickle.dumps([]), pickle.dumps({"agent_state": 3}), b"\x80\x04]r\xff\xff\xff\x7f.", b"\x80\x04Pid\n."]:
    assert refusal(data).startswith("walk/0.pkl: not the state of an agent: "), refusal(data)
assert time.time() - start < 10
assert "more than 1048576 bytes" in refusal(bytes(script.MOST_PICKLE_BYTES + 1))
for call in [b"cbuiltins\neval\n", b"chabitat_sim.agent.agent\nAgentState.__init__.__globals__\n", b"cnumpy\nload\n"]:
    assert "nothing of it was run" in refusal(call + b"."), call
