"""A stand-in for habitat-sim: its names as v0.3.3 has them, over rooms of boxes that lie in a .basis.glb as JSON.

What the real classes have no field for cannot be set here either. An instance has its number in semantic maps only if the scene
is among the stages of the scene_dataset_config, and that says `has_semantic_textures`, as HM3D's annotated one does.
"""

import array
import glob
import json
import math
import os
import random
from types import SimpleNamespace

__version__ = "0.3.3"


class SimulatorConfiguration:
    __slots__ = ("scene_dataset_config_file", "scene_id", "random_seed")


class CameraSensorSpec:
    __slots__ = ("uuid", "sensor_type", "resolution", "hfov", "position", "orientation")


class SensorType:
    COLOR, DEPTH, SEMANTIC = "color", "depth", "semantic"


class AgentConfiguration:
    __slots__ = ("height", "radius", "sensor_specifications")


agent = SimpleNamespace(AgentConfiguration=AgentConfiguration)


class AgentState:
    __slots__ = ("position", "rotation")

    def __init__(self):
        self.position, self.rotation = [0.0, 0.0, 0.0], None


class ShortestPath:
    __slots__ = ("requested_start", "requested_end", "geodesic_distance")


class Configuration:
    def __init__(self, sim_cfg, agents):
        self.sim_cfg, self.agents = sim_cfg, agents


class PathFinder:
    """Islands are rectangles [x0, z0, x1, z1, height]; a path over two of them does not exist."""

    def __init__(self, islands):
        self.islands, self.random = islands, random.Random(0)
        self.is_loaded, self.num_islands = bool(islands), len(islands)

    def seed(self, new_seed):
        self.random = random.Random(new_seed)

    def island_area(self, island_index=-1):
        return sum((x1 - x0) * (z1 - z0) for x0, z0, x1, z1, _ in self.islands[island_index])

    def get_random_navigable_point(self, max_tries=10, island_index=-1):
        x0, z0, x1, z1, y = self.random.choice(self.islands[island_index])
        return [self.random.uniform(x0, x1), y, self.random.uniform(z0, z1)]

    def distance_to_closest_obstacle(self, pt, max_search_radius=2.0):
        spaces = [min(pt[0] - x0, x1 - pt[0], pt[2] - z0, z1 - pt[2]) for x0, z0, x1, z1, _ in sum(self.islands, [])]
        return min(max(spaces), max_search_radius)

    def find_path(self, path):
        path.geodesic_distance = 1.1 * math.sqrt(sum((a - b) ** 2 for a, b in zip(path.requested_start, path.requested_end)))
        return True


class Agent:
    def set_state(self, state):
        length = math.sqrt(sum(number * number for number in state.rotation))
        assert abs(length - 1) < 1e-4, "a rotation of unit length expected"
        self.state = state


class Simulator:
    open = None

    def __init__(self, config):
        assert Simulator.open is None, "the simulator of the scene before is still open"
        Simulator.open, self.config, self.agents = self, config, [Agent()]
        backend = config.sim_cfg
        with open(backend.scene_dataset_config_file) as file:
            stages = json.load(file)["stages"]
        folder = os.path.dirname(backend.scene_dataset_config_file)
        handles = [path for form in stages["paths"][".glb"] for path in glob.glob(os.path.join(folder, form))]
        found = sorted(handle for handle in handles if backend.scene_id in handle)
        self.annotated = bool(found) and stages.get("default_attributes", {}).get("has_semantic_textures", False)
        with open(found[0] if found else backend.scene_id) as file:
            self.scene = json.load(file)
        self.pathfinder = PathFinder(self.scene["islands"])
        with open(os.environ["STAND_IN_LOG"], "a") as log:
            log.write(os.path.basename(backend.scene_id) + "\n")

    def get_agent(self, agent_id):
        return self.agents[agent_id]

    def close(self):
        Simulator.open = None

    def get_sensor_observations(self):
        return {spec.uuid: self.draw(spec) for spec in self.config.agents[0].sensor_specifications}

    def draw(self, spec):
        """One image, turned upside down twice as habitat-sim does, so that its rows do not follow each other in memory."""
        height, width = spec.resolution
        state, rows = self.agents[0].state, []
        focal = width / 2 / math.tan(math.radians(spec.hfov) / 2)
        eye = [state.position[axis] + spec.position[axis] for axis in range(3)]
        for v in reversed(range(height)):
            for u in range(width):
                ray = turned(state.rotation, [(u + 0.5 - width / 2) / focal, (height / 2 - v - 0.5) / focal, -1.0])
                rows.append(self.hit(eye, ray))
        if spec.sensor_type == SensorType.COLOR:
            codes = bytearray(code for _, number, face in rows for code in color(number, face))
            return memoryview(codes).cast("B", (height, width, 4))[::-1]
        if spec.sensor_type == SensorType.DEPTH:
            return memoryview(array.array("f", [depth for depth, _, _ in rows])).cast("B").cast("f", (height, width))[::-1]
        ids = [number if self.annotated else 0 for _, number, _ in rows]
        return memoryview(array.array("I", ids)).cast("B").cast("I", (height, width))[::-1]

    def hit(self, eye, ray):
        """Depth along the axis, instance and face of the first box or wall that a ray meets. The ray's depth is 1."""
        x0, y0, z0, x1, y1, z1 = self.scene["room"]
        best = (0.0, 0, 0)
        for number, low, high in [[1, [x0, y0, z0], [x1, y1, z1]]] + self.scene["boxes"]:
            near, far, face, back = 0.0, math.inf, 0, 0
            for axis in range(3):
                if ray[axis] == 0:
                    if not low[axis] <= eye[axis] <= high[axis]:
                        near = math.inf
                    continue
                ends = sorted([(low[axis] - eye[axis]) / ray[axis], (high[axis] - eye[axis]) / ray[axis]])
                if ends[0] > near:
                    near, face = ends[0], axis
                if ends[1] < far:
                    far, back = ends[1], axis
            # From within, a room is seen by its walls (1), floor and ceiling (2).
            depth, side = (far, back) if number == 1 else (near, face)
            if near < far and depth > 0 and (best[1] == 0 or depth < best[0]):
                best = (depth, 2 if number == 1 and side == 1 else number, side)
        return best


def turned(rotation, vector):
    """A vector, turned by a quaternion x, y, z, w."""
    x, y, z, w = rotation
    cross = [y * vector[2] - z * vector[1], z * vector[0] - x * vector[2], x * vector[1] - y * vector[0]]
    twice = [y * cross[2] - z * cross[1], z * cross[0] - x * cross[2], x * cross[1] - y * cross[0]]
    return [vector[axis] + 2 * (w * cross[axis] + twice[axis]) for axis in range(3)]


def color(number, face):
    shade = (1.0, 0.8, 0.6)[face]
    codes = [int((40 + 53 * number * step % 200) * shade) for step in (1, 3, 7)]
    return codes + [255]
