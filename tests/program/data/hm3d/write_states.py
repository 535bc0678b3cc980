"""Writes the agent states of a walk as OpenEQA has them: write_states.py FOLDER SCENE_ID COUNT FORM.

Classes stand in their modules as habitat-sim 0.2.5, attrs, NumPy and numpy-quaternion have them, so that pickles name them. FORM is
`attrs21` (state as a tuple, NumPy 1), `attrs22` (state as a dict, NumPy 2), `protocol2`, or `evil` (the last state calls os.system before anything else).
"""

import copyreg
import math
import os
import pickle
import struct
import sys
import types
from pathlib import Path

folder, scene_id, count, form = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), sys.argv[4]
core = "numpy._core.multiarray" if form == "attrs22" else "numpy.core.multiarray"


def stands_in(module, name):
    """Makes a class or function importable under a name."""

    def named(thing):
        parts = module.split(".")
        for i in range(len(parts)):
            sys.modules.setdefault(".".join(parts[: i + 1]), types.ModuleType(".".join(parts[: i + 1])))
        thing.__module__, thing.__name__, thing.__qualname__ = module, name, name
        setattr(sys.modules[module], name, thing)
        return thing

    return named


class Record:
    def __init__(self, *values):
        self.values = values

    def __reduce_ex__(self, protocol):
        state = dict(zip(self.fields, self.values)) if form == "attrs22" else self.values
        return copyreg.__newobj__, (type(self),), state


@stands_in("habitat_sim.agent.agent", "SixDOFPose")
class SixDOFPose(Record):
    fields = ("position", "rotation")


@stands_in("habitat_sim.agent.agent", "AgentState")
class AgentState(Record):
    fields = ("position", "rotation", "sensor_states")


@stands_in("quaternion", "quaternion")
class Quaternion:
    def __init__(self, *wxyz):
        self.wxyz = wxyz

    def __reduce__(self):
        return Quaternion, self.wxyz


@stands_in("numpy", "dtype")
class Dtype:
    def __init__(self, code):
        self.code = code

    def __reduce__(self):
        return Dtype, (self.code, False, True), (3, "<", None, None, None, -1, -1, 0)


@stands_in(core, "_reconstruct")
def reconstruct():
    pass


@stands_in("numpy", "ndarray")
class Array:
    def __init__(self, code, values):
        self.code, self.data = code, struct.pack("<%d%s" % (len(values), {"f4": "f", "f8": "d"}[code]), *values)
        self.count = len(values)

    def __reduce__(self):
        return reconstruct, (Array, (0,), b"b"), (1, (self.count,), Dtype(self.code), False, self.data)


class Evil:
    def __reduce__(self):
        return os.system, ("touch " + str(folder / "was-run"),)


folder.mkdir(parents=True)
for i in range(count):
    half, place = 0.3 * i / 2, [3.2 - 0.01 * i, 0.0, 2.5]
    turn = Quaternion(math.cos(half), 0.0, math.sin(half), 0.0)
    eye = SixDOFPose(Array("f4", [place[0], 1.25, place[2]]), turn)
    state = AgentState(Array("f8", place), turn, {"rgb": eye})
    stored = {"scene_id": scene_id, "agent_state": state, "resolution": [1080, 1920], "hfov": 90.0}
    if form == "evil" and i + 1 == count:
        stored = dict({"first": Evil()}, **stored)
    (folder / ("%05d.pkl" % i)).write_bytes(pickle.dumps(stored, protocol=2 if form == "protocol2" else 4))
