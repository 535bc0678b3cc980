#!/usr/bin/env python3
"""Renders frames of HM3D with habitat-sim, in the layout that `darkqa-eval import habitat` reads.

    python hm3d_frames.py --hm3d HM3D/val --config HM3D/hm3d_annotated_basis.scene_dataset_config.json \\
        --out RENDERS (--walks STATES | --cover) [--scenes LIST] [--every 2] [--size 2560x1440] [--hfov 90] [--height 1.5] [--seed 0]
    darkqa-eval import habitat --src RENDERS --out FRAMES

--walks renders the agent states that OpenEQA publishes (open-eqa-hm3d-states-v0.tgz, or the folder in it). --cover needs no
walk: it chooses places that cover each scene, by a seed. Scenes without `.semantic.txt` are skipped by name. A scene with
`done.json` is not rendered again.

It needs Python 3.7 or later and habitat-sim, and imports nothing else outside the standard library. It is written after the
source of habitat-sim v0.2.5 and v0.3.3 and after OpenEQA's data/hm3d/extract-frames.py and config.py (facebookresearch/open-eqa
at b5752aa). The project has run it with a stand-in for habitat-sim alone, not with habitat-sim itself.
"""

import argparse
import collections
import hashlib
import io
import json
import math
import os
import pickle
import random
import re
import shutil
import struct
import sys
import tarfile
import zlib
from pathlib import Path

SCHEMA = "darkqa.renders/1"
# The archive of agent states, as OpenEQA's data/README.md names it.
STATES_MD5 = "0db1a723573a5b9f5139e0df2ae960e0"
# States a second of a walk. The archive does not say it; guessed from the 10 frames a second of OpenEQA's demonstration.
RATE = 10.0
# No state of a walk is as large as this; a file that is larger is something else.
MOST_PICKLE_BYTES = 1 << 20
# A scene is refused if so many frames in succession, from its first on, have no instance.
BLANK_FRAMES = 8

# --cover, all chosen. Distances are in metres.
SAMPLES, MOST_PLACES = 4000, 60
CLEARANCE, REACH, FLOOR_GAP = 0.4, 1.5, 1.5
NEAR, MOST_HOLES, INSTANCES, INSTANCE_SHARE = 0.8, 0.1, 3, 0.01

CONFIG_HINT = (
    "habitat-sim writes 0 everywhere if the scene is not in the scene_dataset_config that it opens, or has no annotation there: "
    "set --config to hm3d_annotated_basis.scene_dataset_config.json of the HM3D in which --hm3d lies"
)


class Refused(Exception):
    """A walk, scene or folder that is not rendered, and why."""


# The agent states of a walk. A pickle can call anything that it names, so none of the classes that it names is loaded: each name
# below stands for a plain class of this file, and any other name is refused.


class Record:
    """An object of attrs, whose state is a dict (attrs 22.2 and later) or a tuple of its fields in order (before)."""

    fields = ()

    def __setstate__(self, state):
        values = state if isinstance(state, dict) else dict(zip(self.fields, state))
        for name in self.fields:
            setattr(self, name, values[name])


class SixDOFPose(Record):
    """habitat_sim/agent/agent.py: place and rotation of a sensor."""

    fields = ("position", "rotation")


class AgentState(Record):
    """habitat_sim/agent/agent.py: place and rotation of the agent, and of its sensors."""

    fields = ("position", "rotation", "sensor_states")


class Quaternion:
    """numpy-quaternion's `quaternion`, which pickles as its four numbers."""

    def __init__(self, w, x, y, z):
        self.numbers = [x, y, z, w]


class Dtype:
    """The type of the numbers in an array of NumPy."""

    def __init__(self, code, *_):
        self.code, self.order = code, "<"

    def __setstate__(self, state):
        self.order = ">" if state[1] == ">" else "<"

    def read(self, data):
        letter = {"f4": "f", "f8": "d", "i4": "i", "i8": "q"}[self.code]
        return list(struct.unpack("%s%d%s" % (self.order, len(data) // struct.calcsize("=" + letter), letter), data))


class Array:
    """An array of NumPy, as the list of its numbers."""

    def __init__(self, *_):
        self.numbers = []

    def __setstate__(self, state):
        self.numbers = state[2].read(state[4])


def from_buffer(data, kind, *_):
    """An array as pickles of protocol 5 hold it."""
    array = Array()
    array.numbers = kind.read(bytes(data))
    return array


def latin1(text, encoding):
    """`_codecs.encode`, by which the oldest pickles hold bytes."""
    return text.encode("latin1" if encoding == "latin1" else "ascii")


ADMITTED = {
    ("habitat_sim.agent.agent", "AgentState"): AgentState,
    ("habitat_sim.agent.agent", "SixDOFPose"): SixDOFPose,
    ("quaternion", "quaternion"): Quaternion,
    ("quaternion.numpy_quaternion", "quaternion"): Quaternion,
    ("numpy", "ndarray"): Array,
    ("numpy", "dtype"): Dtype,
    ("_codecs", "encode"): latin1,
}
for core in ("numpy.core", "numpy._core"):  # NumPy 1 and 2
    ADMITTED[core + ".multiarray", "_reconstruct"] = Array
    ADMITTED[core + ".multiarray", "scalar"] = lambda kind, data: kind.read(data)[0]
    ADMITTED[core + ".numeric", "_frombuffer"] = from_buffer


class StateUnpickler(pickle._Unpickler):
    """Reads a state without running anything outside this file. The unpickler in C would reserve gigabytes if a pickle says so."""

    def find_class(self, module, name):
        if (module, name) not in ADMITTED:
            raise Refused("it names %s.%s, which no agent state needs; nothing of it was run" % (module, name))
        return ADMITTED[module, name]


def numbers(value, count):
    """The numbers of a vector or quaternion (x, y, z, w)."""
    values = [float(number) for number in getattr(value, "numbers", value)]
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ValueError("%d finite numbers expected, not %r" % (count, values))
    return values


def read_state(name, data):
    """The state of one pickle: its scene, the agent's place and rotation, and the height of its camera, if it has one."""
    try:
        if len(data) > MOST_PICKLE_BYTES:
            raise Refused("it has more than %d bytes, which no agent state has" % MOST_PICKLE_BYTES)
        stored = StateUnpickler(io.BytesIO(data)).load()
        agent = stored["agent_state"]
        place = numbers(agent.position, 3)
        camera = agent.sensor_states.get("rgb")
        height = None if camera is None else numbers(camera.position, 3)[1] - place[1]
        scene = str(stored["scene_id"]).replace("\\", "/").rsplit("/", 1)[-1].split(".")[0]
        return {"name": Path(name).stem, "scene": scene, "place": place, "turn": numbers(agent.rotation, 4), "height": height}
    except Refused as problem:
        raise Refused("%s: %s" % (name, problem))
    except Exception as problem:  # What a damaged pickle raises is not known beforehand.
        raise Refused("%s: not the state of an agent: %s: %s" % (name, type(problem).__name__, problem))


def archived(path):
    """The pickles of an archive, which is read without being unpacked."""
    with tarfile.open(str(path)) as archive:
        for member in archive:
            parts = member.name.replace("\\", "/").split("/")
            if member.name.startswith("/") or ".." in parts or not (member.isfile() or member.isdir()):
                raise Refused("%s: the member %r is a link or leads out of the archive; nothing was rendered" % (path, member.name))
            if member.isfile() and parts[-1].endswith(".pkl"):
                yield (parts[-2] if len(parts) > 1 else path.stem), parts[-1], archive.extractfile(member).read(MOST_PICKLE_BYTES + 1)


def in_folder(path):
    """The pickles below a folder."""
    for file in path.rglob("*.pkl"):
        with open(str(file), "rb") as data:
            yield file.parent.name, file.name, data.read(MOST_PICKLE_BYTES + 1)


def hash_of(walk):
    """The scene of a walk, by its name: 000-hm3d-<scene>."""
    return walk.rsplit("-", 1)[-1]


def read_walks(path):
    """The pickles of each walk, sorted by name, and what is known of where they come from."""
    origin = {"name": path.name}
    if path.is_file():
        origin["md5"] = md5 = hashlib.md5(path.read_bytes()).hexdigest()
        known = md5 == STATES_MD5
        say("%s: md5 %s, %s" % (path, md5, "OpenEQA's archive v0" if known else "not OpenEQA's archive v0 (%s)" % STATES_MD5))
    walks = collections.defaultdict(list)
    try:
        for walk, name, data in archived(path) if path.is_file() else in_folder(path):
            walks[walk].append((name, data))
    except (tarfile.TarError, EOFError, zlib.error) as problem:
        raise Refused("%s: neither a folder nor a whole archive of tar: %s" % (path, problem))
    if not walks:
        raise Refused("%s: no .pkl in it; the agent states of OpenEQA or a folder of them expected" % path)
    return {walk: sorted(walks[walk]) for walk in sorted(walks)}, origin


def walk_views(walk, files, every, first):
    """The views of a walk, one in `every` seconds, and its entry in scenes.json. `first` is the number of its first state."""
    states = [read_state("%s/%s" % (walk, name), data) for name, data in files]
    scene, height = hash_of(walk), states[0]["height"]
    for state in states:
        if state["scene"] != scene:
            raise Refused("%s/%s.pkl: its scene_id is of the scene %r, not of %r" % (walk, state["name"], state["scene"], scene))
    if height is None:
        raise Refused("%s: its first state has no sensor \"rgb\", whose height is that of the camera" % walk)
    step = max(1, round(every * RATE))
    views = [dict(states[i], t=(first + i) / RATE) for i in range(0, len(states), step)]
    digest = hashlib.sha256(b"".join(data for _, data in files)).hexdigest()
    return views, {"name": walk, "states": len(states), "camera_height_m": height, "sha256": digest}


# --cover: places that cover a scene.


def walking(sim, start, end):
    """The length of the shortest path, in metres."""
    path = habitat_sim.ShortestPath()
    path.requested_start, path.requested_end = start, end
    return path.geodesic_distance if sim.pathfinder.find_path(path) else math.inf


def straight(start, end):
    return math.sqrt(sum((float(start[axis]) - float(end[axis])) ** 2 for axis in range(3)))


def farthest_points(sim, points):
    """Farthest-point sampling (Gonzalez 1985) by walking distance, and how far the worst covered point lies from a chosen one."""
    chosen, distance = [0], [math.inf] * len(points)
    while True:
        new = chosen[-1]
        for i, point in enumerate(points):
            # A path is at least as long as the straight line.
            if straight(points[new], point) < distance[i]:
                distance[i] = 0.0 if i == new else min(distance[i], walking(sim, points[new], point))
        farthest = max(range(len(points)), key=distance.__getitem__)
        if distance[farthest] <= REACH or len(chosen) == MOST_PLACES:
            return [points[i] for i in chosen], distance[farthest]
        chosen.append(farthest)


def nearest_first(sim, places):
    """The places in the order of a visit: always the nearest that was not visited."""
    tour, left = [places[0]], list(places[1:])
    while left:
        steps = [walking(sim, tour[-1], place) for place in left]
        tour.append(left.pop(steps.index(min(steps))))
    return tour


def floors(places):
    """The number of the floor of each place. Two floors are told apart by a gap between heights."""
    order, floor, found = sorted(range(len(places)), key=lambda i: float(places[i][1])), 0, [0] * len(places)
    for before, after in zip(order, order[1:]):
        floor += float(places[after][1]) - float(places[before][1]) > FLOOR_GAP
        found[after] = floor
    return found


def cover_views(sim, scene, seed):
    """Four views at each place of a scene, and the entry in scenes.json."""
    finder = sim.pathfinder
    if not finder.is_loaded or finder.num_islands == 0:
        raise Refused("it has no navigation mesh (.basis.navmesh), which --cover needs")
    finder.seed(seed)
    island = max(range(finder.num_islands), key=finder.island_area)
    drawn = [finder.get_random_navigable_point(island_index=island) for _ in range(SAMPLES)]
    drawn = [point for point in drawn if all(math.isfinite(float(point[axis])) for axis in range(3))]
    free = [point for point in drawn if finder.distance_to_closest_obstacle(point) >= CLEARANCE]
    if not free:
        raise Refused("none of %d points of its largest navigable area is %g m from every obstacle" % (SAMPLES, CLEARANCE))
    chosen, rest = farthest_points(sim, free)
    places, draw, views = nearest_first(sim, chosen), random.Random("%d/%s" % (seed, scene)), []
    for i, (place, floor) in enumerate(zip(places, floors(places))):
        start = draw.random() * 2 * math.pi
        for heading in range(4):
            half = (start + heading * math.pi / 2) / 2
            turn = [0.0, math.sin(half), 0.0, math.cos(half)]
            views.append({"name": "%03d-%d" % (i, heading), "place": numbers([place[axis] for axis in range(3)], 3), "turn": turn, "floor": floor})
    entry = {"samples": len(drawn), "free": len(free), "places": len(places), "floors": 1 + max(floors(places))}
    return views, dict(entry, farthest_sample_m=rest if math.isfinite(rest) else None)


def unfit(depth, semantic):
    """Why a view of --cover is left out; None if it is kept."""
    pixels = len(depth)
    if sum(1 for metres in depth if metres > NEAR) * 2 <= pixels:
        return "too near"
    if sum(1 for metres in depth if metres == 0) >= MOST_HOLES * pixels:
        return "holes"
    counts = collections.Counter(semantic)
    counts.pop(0, None)
    return None if sum(1 for count in counts.values() if count >= INSTANCE_SHARE * pixels) >= INSTANCES else "few instances"


# Files.


def write_png(path, image):
    """8-bit RGB; a fourth channel is dropped. Rows are not filtered."""
    height, width, channels = image.shape
    codes, rows = image.tobytes(), []
    for y in range(height):
        source, row = codes[y * width * channels : (y + 1) * width * channels], bytearray(1 + 3 * width)
        for channel in range(3):
            row[1 + channel :: 3] = source[channel::channels]
        rows.append(bytes(row))
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(b"".join(rows), 6)), (b"IEND", b"")]
    data = b"".join(struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + data)


def write_npy(path, values, code):
    """An array as NumPy writes it (numpy.lib.format, version 1.0)."""
    header = "{'descr': '<%s', 'fortran_order': False, 'shape': (%d, %d), }" % ((code,) + tuple(values.shape))
    header = header.ljust(-(-(len(header) + 11) // 64) * 64 - 11) + "\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode("ascii") + values.tobytes())


def write_json(path, value):
    path.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def say(text):
    print(text, file=sys.stderr, flush=True)


# The simulator.


def open_simulator(args, scene, height):
    """A simulator of one scene, with a camera for colour, depth and instances, as OpenEQA's config.py has them."""
    backend = habitat_sim.SimulatorConfiguration()
    config, glb = os.path.abspath(str(args.config)), os.path.abspath(str(scene.glb))
    # DATASETS.md of habitat-sim: the path as the configuration has it, or a part of it that it looks for.
    inside = glb.startswith(os.path.dirname(config) + os.sep)
    backend.scene_dataset_config_file, backend.random_seed = config, args.seed
    backend.scene_id = glb if inside else "%s/%s" % (scene.name, scene.glb.name)
    sensors = []
    for name, kind in (("rgb", "COLOR"), ("depth", "DEPTH"), ("semantic", "SEMANTIC")):
        sensor = habitat_sim.CameraSensorSpec()
        sensor.uuid, sensor.sensor_type = name, getattr(habitat_sim.SensorType, kind)
        sensor.resolution, sensor.hfov = [args.size[1], args.size[0]], args.hfov
        sensor.position, sensor.orientation = [0.0, height, 0.0], [0.0, 0.0, 0.0]
        sensors.append(sensor)
    agent = habitat_sim.agent.AgentConfiguration()
    agent.height, agent.radius, agent.sensor_specifications = 1.5, 0.1, sensors
    return habitat_sim.Simulator(habitat_sim.Configuration(backend, [agent]))


def observe(sim, view, size):
    """Colour, depth in metres and instances as the camera sees them."""
    state = habitat_sim.AgentState()
    for axis in range(3):
        state.position[axis] = view["place"][axis]
    state.rotation = list(view["turn"])  # Agent.set_state takes x, y, z, w.
    sim.get_agent(0).set_state(state)
    seen = sim.get_sensor_observations()
    maps = [memoryview(seen[name]) for name in ("rgb", "depth", "semantic")]
    for name, values, form in zip(("rgb", "depth", "semantic"), maps, ("B", "f", "iIlL")):
        if tuple(values.shape[:2]) != (size[1], size[0]) or values.format not in form or values.itemsize != (1 if name == "rgb" else 4):
            raise Refused("habitat-sim gave %s of the form %s %r" % (name, values.format, tuple(values.shape)))
    return maps


def camera_pose(view, height):
    """The matrix from camera to world, row by row. Axes are those of habitat-sim: y is up, the camera looks along -z."""
    x, y, z, w = view["turn"]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return sum([row + [view["place"][axis] + row[1] * height] for axis, row in enumerate(rows)], []) + [0.0, 0.0, 0.0, 1.0]


def render(args, sim, views, height, folder):
    """Writes the views of a scene, and returns how many were kept, and how many left out and why."""
    width, focal = args.size[0], args.size[0] / 2 / math.tan(math.radians(args.hfov) / 2)
    camera = {"fx": focal, "fy": focal, "cx": (width - 1) / 2, "cy": (args.size[1] - 1) / 2}
    for name in ("rgb", "depth", "semantic"):
        (folder / name).mkdir(parents=True)
    kept, left_out, annotated = 0, collections.Counter(), False
    with open(str(folder / "trajectory.jsonl"), "w", encoding="utf-8") as lines:
        for i, view in enumerate(views):
            rgb, depth, semantic = observe(sim, view, args.size)
            ids = semantic.tobytes()
            blank = ids.count(0) == len(ids)
            annotated = annotated or not blank
            if not annotated and i + 1 == min(BLANK_FRAMES, len(views)):
                raise Refused("every semantic number of its first %d frames is 0; %s" % (i + 1, CONFIG_HINT))
            why = "no instance" if blank else None
            if not blank and args.cover:
                why = unfit(memoryview(depth.tobytes()).cast("f"), memoryview(ids).cast("I"))
            if why:
                left_out[why] += 1
                continue
            write_png(folder / "rgb" / (view["name"] + ".png"), rgb)
            write_npy(folder / "depth" / (view["name"] + ".npy"), depth, "f4")
            write_npy(folder / "semantic" / (view["name"] + ".npy"), semantic, "i4")
            line = {"frame": view["name"], "pose": camera_pose(view, height), "intrinsics": camera}
            line.update({key: view[key] for key in ("t", "floor") if key in view})
            lines.write(json.dumps(line) + "\n")
            kept += 1
    if kept == 0:
        raise Refused("none of its %d views is kept: %s" % (len(views), dict(left_out)))
    return {"frames": kept, "left_out": dict(sorted(left_out.items()))}


# Scenes.


class Scene:
    """A folder NNNNN-<hash> of HM3D."""

    def __init__(self, folder):
        self.name, self.hash = folder.name, folder.name.split("-", 1)[1]
        self.glb, self.annotation = folder / (self.hash + ".basis.glb"), folder / (self.hash + ".semantic.txt")


def render_scene(args, scene, walks, settings):
    """Renders one scene into a folder of its own, which gets its name when it is whole."""
    folder = args.out / "partial" / scene.name
    if folder.exists():
        shutil.rmtree(str(folder))
    entry, views, height, first = {"scene": scene.name, "settings": settings}, [], args.height, 0
    entry["annotation_sha256"] = sha256(scene.annotation)
    if not scene.glb.is_file():
        raise Refused("no %s in its folder" % scene.glb.name)
    if args.walks:
        entry["walks"] = []
        for walk, files in walks:
            more, origin = walk_views(walk, files, args.every, first)
            if len(walks) > 1:
                more = [dict(view, name="%s-%s" % (walk, view["name"])) for view in more]
            height = origin["camera_height_m"] if first == 0 else height
            if abs(origin["camera_height_m"] - height) > 0.01:
                raise Refused("its walks have cameras at different heights: %s" % ", ".join(walk for walk, _ in walks))
            views, first = views + more, first + len(files)
            entry["walks"].append(origin)
    sim = open_simulator(args, scene, height)
    try:
        if args.cover:
            views, entry["cover"] = cover_views(sim, scene.name, args.seed)
        entry.update(render(args, sim, views, height, folder))
    finally:
        sim.close()
    shutil.copyfile(str(scene.annotation), str(folder / scene.annotation.name))
    write_json(folder / "done.json", entry)
    os.replace(str(folder), str(args.out / scene.name))
    return entry


def scenes_of(args):
    """All scenes of --hm3d."""
    if not args.hm3d.is_dir():
        raise Refused("--hm3d %s: no such folder" % args.hm3d)
    if not args.config.is_file():
        raise Refused("--config %s: no such file" % args.config)
    folders = sorted(path for path in args.hm3d.iterdir() if path.is_dir() and re.match(r"\d{5}-.", path.name))
    if not folders:
        raise Refused("--hm3d %s: no folder NNNNN-<scene> in it; HM3D/val or another split expected" % args.hm3d)
    return [Scene(folder) for folder in folders]


def named(scenes, names):
    """The scenes that --scenes names; all if it is not set."""
    if names is None:
        return scenes
    wanted = {name.strip() for name in names.split(",") if name.strip()}
    missing = wanted - {scene.name for scene in scenes} - {scene.hash for scene in scenes}
    if missing or not wanted:
        raise Refused("--scenes: no %s in --hm3d" % (", ".join(sorted(missing)) or "name"))
    return [scene for scene in scenes if wanted & {scene.name, scene.hash}]


def stored(args, scene, settings):
    """The entry of a scene that is rendered already; None if it is not."""
    folder = args.out / scene.name
    if not folder.exists():
        return None
    if not (folder / "done.json").is_file():
        raise Refused("%s exists, but has no done.json: remove it, or take another --out" % folder)
    entry = json.loads((folder / "done.json").read_text(encoding="utf-8"))
    if entry["settings"] != settings:
        different = sorted(key for key in settings if entry["settings"].get(key) != settings[key]) or sorted(entry["settings"])
        raise Refused("%s was rendered with another %s: take another --out" % (folder, ", ".join(different)))
    return entry


def settings_of(args):
    """What decides the frames besides the scene and the walk."""
    settings = {"habitat_sim": habitat_sim.__version__, "config": args.config.name, "config_sha256": sha256(args.config)}
    settings.update({"size": list(args.size), "hfov": args.hfov})
    settings.update({"every_s": args.every} if args.walks else {"height_m": args.height, "seed": args.seed})
    return settings


def render_all(args):
    """Renders every scene, and returns how many were refused."""
    present = scenes_of(args)
    scenes, settings, walks = named(present, args.scenes), settings_of(args), collections.defaultdict(list)
    info = {"schema": SCHEMA, "made_by": "hm3d_frames.py 1", "python": "%d.%d" % sys.version_info[:2]}
    info.update({"mode": "walks" if args.walks else "cover", "scenes": [], "skipped": [], "refused": []})

    def note(kind, name, why):
        say("%s: %s: %s" % (name, kind, why))
        info[kind].append({"name": name, "why": str(why)})

    if args.walks:
        found, info["states"] = read_walks(args.walks)
        info["rate_guessed"] = RATE
        say("the rate of walks is not stored: times are those of %g states a second" % RATE)
        for walk, files in found.items():
            walks[hash_of(walk)].append((walk, files))
            if hash_of(walk) not in {scene.hash for scene in present}:
                note("skipped", walk, "no folder NNNNN-%s in --hm3d" % hash_of(walk))
    done = {scene.name: stored(args, scene, settings) for scene in scenes}
    args.out.mkdir(parents=True, exist_ok=True)
    for i, scene in enumerate(scenes):
        entry = done[scene.name]
        if entry:
            say("%s: done already" % scene.name)
        elif not scene.annotation.is_file():
            note("skipped", scene.name, "no .semantic.txt")
        elif args.walks and not walks[scene.hash]:
            note("skipped", scene.name, "no walk of it")
        else:
            try:
                entry = render_scene(args, scene, walks[scene.hash], settings)
                say("%s: %d frames (%d of %d scenes)" % (scene.name, entry["frames"], i + 1, len(scenes)))
            except Refused as problem:
                note("refused", scene.name, problem)
        if entry:
            info["scenes"].append(entry)
        write_json(args.out / "scenes.json", info)
    shutil.rmtree(str(args.out / "partial"), ignore_errors=True)
    if not info["scenes"]:
        raise Refused("no scene was rendered; %s says why of each" % (args.out / "scenes.json"))
    frames = sum(entry["frames"] for entry in info["scenes"])
    counts = (args.out, frames, len(info["scenes"]), len(info["skipped"]), len(info["refused"]))
    say("%s: %d frames of %d scenes; %d skipped, %d refused" % counts)
    return len(info["refused"])


def size_of(text):
    """The size of an image, WxH."""
    match = re.match(r"([1-9]\d{0,4})x([1-9]\d{0,4})$", text)
    if not match:
        raise argparse.ArgumentTypeError("%r: WIDTHxHEIGHT expected, such as 2560x1440" % text)
    return int(match.group(1)), int(match.group(2))


def parse(words=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--hm3d", type=Path, required=True, metavar="DIR", help="a split of HM3D, with folders NNNNN-<scene>")
    parser.add_argument("--config", type=Path, required=True, metavar="FILE", help="hm3d_annotated_basis.scene_dataset_config.json")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where the renders go; about 37 MB a frame of 2560x1440")
    views = parser.add_mutually_exclusive_group(required=True)
    views.add_argument("--walks", type=Path, metavar="DIR|TGZ", help="the agent states of OpenEQA")
    views.add_argument("--cover", action="store_true", help="places that cover each scene")
    parser.add_argument("--scenes", metavar="LIST", help="names or hashes of scenes, separated by commas; default: all")
    parser.add_argument("--every", type=float, metavar="SECONDS", help="one state in so many seconds of a walk; 0 for each; default: 2")
    parser.add_argument("--size", type=size_of, default=(2560, 1440), metavar="WxH", help="default: 2560x1440")
    parser.add_argument("--hfov", type=float, default=90.0, metavar="DEGREES", help="horizontal field of view; default: 90")
    parser.add_argument("--height", type=float, metavar="METRES", help="of the camera, with --cover; default: 1.5")
    parser.add_argument("--seed", type=int, default=0, help="of the places and headings of --cover; default: 0")
    args = parser.parse_args(words)
    if args.walks and args.height is not None:
        parser.error("--height goes with --cover: the states of a walk hold the height of their camera")
    if args.cover and args.every is not None:
        parser.error("--every goes with --walks: the places of --cover have no time")
    args.every = 2.0 if args.every is None else args.every
    args.height = 1.5 if args.height is None else args.height
    if not (0 < args.hfov < 180 and 0 <= args.every < math.inf and 0 < args.height < 10 and 0 <= args.seed < 2**32):
        parser.error("--hfov above 0 and below 180, --every from 0, --height above 0 and below 10, and --seed from 0 and below 2^32 expected")
    return args


if __name__ == "__main__":
    arguments = parse()
    os.environ.setdefault("MAGNUM_LOG", "quiet")
    os.environ.setdefault("HABITAT_SIM_LOG", "quiet")
    try:
        import habitat_sim
    except ImportError as missing:
        sys.exit("habitat-sim is not here (%s): conda install -c conda-forge -c aihabitat habitat-sim headless" % missing)
    try:
        sys.exit(1 if render_all(arguments) else 0)
    except Refused as problem:
        sys.exit("hm3d_frames.py: %s" % problem)
