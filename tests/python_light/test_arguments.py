"""Arguments of the module: layouts of arrays, wrong values, and random ones."""

import random
import unittest
from pathlib import Path

import numpy as np

import darkqa_light

IMAGE = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
CALLS = 10_000


class Layouts(unittest.TestCase):
    def check(self, view):
        expected = darkqa_light.degrade(np.array(view, order="C", copy=True), key="a")
        np.testing.assert_array_equal(darkqa_light.degrade(view, key="a"), expected)

    def test_views_are_as_their_copies(self):
        self.check(IMAGE[::2, ::-3])
        self.check(IMAGE[..., ::-1])
        self.check(IMAGE.transpose(1, 0, 2))
        self.check(np.asfortranarray(IMAGE))
        self.check(np.broadcast_to(np.array([1, 120, 255], dtype=np.uint8), (9, 5, 3)))
        self.check(np.frombuffer(b"x" + IMAGE.tobytes(), dtype=np.uint8, offset=1).reshape(IMAGE.shape))

    def test_what_is_read_only_is_read_alone(self):
        image = IMAGE.copy()
        image.setflags(write=False)
        self.check(image)
        np.testing.assert_array_equal(image, IMAGE)

    def test_results_are_new_and_writable(self):
        for result in [darkqa_light.degrade(IMAGE, "L0"), darkqa_light.degrade(IMAGE)]:
            self.assertFalse(np.shares_memory(result, IMAGE))
            result[0] = 0

    def test_an_image_of_one_pixel(self):
        for variant in ["ev", "noise", "auto", "motion"]:
            result = darkqa_light.degrade(np.full((1, 1, 3), 255, np.uint8), "L3", variant)
            self.assertEqual(result.shape, (1, 1, 3))

    def test_an_empty_batch_is_empty(self):
        empty = np.empty((0, 4, 5, 3), np.uint8)
        self.assertEqual(darkqa_light.degrade(empty).shape, (0, 4, 5, 3))
        self.assertEqual(darkqa_light.degrade(empty, linear=True).dtype, np.float32)
        self.assertEqual(darkqa_light.ladder(empty, ["L1", 3]).shape, (0, 2, 4, 5, 3))


class Batches(unittest.TestCase):
    batch = np.stack([IMAGE, IMAGE // 2, IMAGE[::-1]])

    def test_an_image_of_a_batch_is_as_if_alone(self):
        for variant in ["ev", "noise", "auto", "motion"]:
            for threads in [1, 2, 5]:
                made = darkqa_light.degrade(self.batch, "L2", variant, key="a", threads=threads)
                named = darkqa_light.degrade(self.batch, "L2", variant, key=["x", "y", "z"], threads=threads)
                for i, key in enumerate("xyz"):
                    np.testing.assert_array_equal(made[i], darkqa_light.degrade(self.batch[i], "L2", variant, key=f"a/{i}"))
                    np.testing.assert_array_equal(named[i], darkqa_light.degrade(self.batch[i], "L2", variant, key=key))

    def test_ladders_are_as_their_levels(self):
        levels = ["L0", "L3", 3.7, "L1", "E8", "L3"]
        for variant in ["ev", "noise", "auto"]:
            for profile in ["paper", "physical"]:
                for options in [{}, {"noise": False}, {"linear": True}]:
                    made = darkqa_light.ladder(self.batch, levels, variant, profile, key="a", **options)
                    self.assertEqual(made.shape, (3, 6, 20, 30, 3))
                    for i, level in enumerate(levels):
                        how = {"level": level} if isinstance(level, str) else {"ev": level}
                        one = darkqa_light.degrade(self.batch, variant=variant, profile=profile, key="a", **how, **options)
                        np.testing.assert_array_equal(made[:, i], one)

    def test_the_ladder_of_one_image(self):
        self.assertEqual(darkqa_light.ladder(IMAGE).shape, (5, 20, 30, 3))
        self.assertEqual(darkqa_light.ladder(IMAGE, variant="motion").shape, (5, 20, 30, 3))


class Meaning(unittest.TestCase):
    def test_seed_and_key_decide_the_noise(self):
        same = darkqa_light.degrade(IMAGE, seed=1, key="a")
        np.testing.assert_array_equal(same, darkqa_light.degrade(IMAGE, seed=1, key="a"))
        self.assertTrue((same != darkqa_light.degrade(IMAGE, seed=2, key="a")).any())
        self.assertTrue((same != darkqa_light.degrade(IMAGE, seed=1, key="b")).any())

    def test_numbers_of_ev_are_levels(self):
        for ev in [6, 6.0, np.float32(6), np.int64(6), 6.004]:
            np.testing.assert_array_equal(darkqa_light.degrade(IMAGE, ev=ev), darkqa_light.degrade(IMAGE, "L3"))
        np.testing.assert_array_equal(darkqa_light.degrade(IMAGE, ev=0), IMAGE)
        self.assertEqual(darkqa_light.sensor_state(ev=3.708)["ev"], 3.71)

    def test_codes_are_the_light_rounded(self):
        for variant in ["ev", "noise", "auto", "motion"]:
            for noise in [True, False]:
                how = {"level": "L2", "variant": variant, "key": "a", "noise": noise}
                light = darkqa_light.degrade(IMAGE, linear=True, **how)
                self.assertEqual(light.dtype, np.float32)
                codes = 255 * light.astype(np.float64) ** (1 / 2.2)
                self.assertLess(np.abs(codes - darkqa_light.degrade(IMAGE, **how)).max(), 0.51)

    def test_the_target_is_the_mean_of_noisy_images(self):
        grey = np.full((64, 64, 3), 180, np.uint8)
        for profile in ["eld", "physical"]:
            state = darkqa_light.sensor_state(ev=1, profile=profile, key="a")
            state |= {"bias": [0.0] * 4, "ratio": 40.0}
            target = darkqa_light.replay(grey, state, noise=False, linear=True)
            self.assertEqual(np.unique(target.round(5)).size, 1 if np.ptp(target, axis=-1).max() < 1e-5 else 3)
            noisy = [darkqa_light.replay(grey, state | {"key": str(i)}, linear=True) for i in range(8)]
            self.assertLess(np.abs(np.mean(noisy) / np.mean(target) - 1), 0.02)
            self.assertGreater(np.std(noisy), 0.01 * np.mean(target))

    def test_a_state_can_be_changed(self):
        state = darkqa_light.sensor_state("L1", profile="eld", key="a")
        self.assertTrue(all(isinstance(value, (int, float, str, list)) for value in state.values()))
        weak, strong = (darkqa_light.replay(IMAGE, state | {"read_scale": scale}, linear=True) for scale in [0.0, 40.0])
        target = darkqa_light.replay(IMAGE, state, noise=False, linear=True)
        self.assertGreater(np.std(strong - target), 2 * np.std(weak - target))

    def test_a_batch_of_a_state_has_one_camera(self):
        state = darkqa_light.sensor_state("L1", key="a")
        batch = darkqa_light.replay(np.stack([IMAGE, IMAGE]), state)
        np.testing.assert_array_equal(batch[1], darkqa_light.replay(IMAGE, state | {"key": "a/1"}))
        self.assertTrue((batch[0] != batch[1]).any())


class Refusals(unittest.TestCase):
    def refuse(self, kind, words, function, *args, **kwargs):
        with self.assertRaises(kind) as caught:
            function(*args, **kwargs)
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_images(self):
        degrade = darkqa_light.degrade
        self.refuse(TypeError, ["image", "numpy.ndarray", "list"], degrade, IMAGE.tolist())
        self.refuse(TypeError, ["image", "numpy.ndarray", "NoneType"], degrade, None)
        self.refuse(TypeError, ["image", "uint8", "float32"], degrade, IMAGE.astype(np.float32))
        self.refuse(TypeError, ["image", "uint8", "int8"], degrade, IMAGE.view(np.int8))
        self.refuse(ValueError, ["image", "(H, W, 3)", "(20, 30)"], degrade, IMAGE[..., 0])
        self.refuse(ValueError, ["image", "(H, W, 3)", "(3, 20, 30)"], degrade, IMAGE.transpose(2, 0, 1))
        self.refuse(ValueError, ["image", "pixel", "(0, 5, 3)"], degrade, np.empty((0, 5, 3), np.uint8))
        self.refuse(ValueError, ["image", "pixel", "(2, 5, 0, 3)"], degrade, np.empty((2, 5, 0, 3), np.uint8))

    def test_views_that_are_larger_than_memory(self):
        sample = np.zeros((1, 1, 1, 3), np.uint8)
        self.refuse(ValueError, ["image", "2**28 pixels"], darkqa_light.degrade, np.broadcast_to(sample[0], (10**6, 10**6, 3)))
        batch = np.broadcast_to(sample, (10**9, 10**3, 10**3, 3))
        for call in [darkqa_light.degrade, darkqa_light.ladder]:
            self.refuse(MemoryError, ["image", "bytes"], call, batch)

    def test_levels(self):
        degrade = darkqa_light.degrade
        self.refuse(ValueError, ["level", "L0 to L5", "L7"], degrade, IMAGE, "L7")
        self.refuse(TypeError, ["level", "str", "ev", "int"], degrade, IMAGE, 3)
        self.refuse(ValueError, ["level, ev"], degrade, IMAGE, "L3", ev=3)
        self.refuse(ValueError, ["ev", "from 0 to 16", "-1"], degrade, IMAGE, ev=-1)
        self.refuse(ValueError, ["ev", "from 0 to 16", "NaN"], degrade, IMAGE, ev=float("nan"))
        self.refuse(TypeError, ["ev", "number", "str"], degrade, IMAGE, ev="3")
        self.refuse(ValueError, ["ev", "T33.33"], degrade, IMAGE, variant="motion", ev=3)
        self.refuse(ValueError, ["level", "T33.33", "T900"], degrade, IMAGE, "T900", "motion")
        self.refuse(ValueError, ["levels", "from 1 to"], darkqa_light.ladder, IMAGE, [])
        self.refuse(TypeError, ["levels", "list", "str"], darkqa_light.ladder, IMAGE, "L3")

    def test_settings(self):
        degrade = darkqa_light.degrade
        self.refuse(ValueError, ["variant", "ev, noise, auto, motion", "both"], degrade, IMAGE, variant="both")
        self.refuse(TypeError, ["variant", "str", "int"], degrade, IMAGE, variant=1)
        self.refuse(ValueError, ["profile", "paper, eld, level, physical", "papre"], degrade, IMAGE, profile="papre")
        self.refuse(ValueError, ["camera", "sony-a7s2", "leica"], degrade, IMAGE, camera="leica")
        self.refuse(ValueError, ["no/such.toml"], degrade, IMAGE, camera=Path("no/such.toml"))
        self.refuse(TypeError, ["camera", "str", "int"], degrade, IMAGE, camera=3)
        self.refuse(ValueError, ["seed", "from 0", "-1"], degrade, IMAGE, seed=-1)
        self.refuse(ValueError, ["seed", str(2**64)], degrade, IMAGE, seed=2**64)
        self.refuse(TypeError, ["seed", "int", "float"], degrade, IMAGE, seed=1.0)
        self.refuse(TypeError, ["key", "str", "int"], degrade, IMAGE, key=1)
        self.refuse(TypeError, ["key", "str", "list"], degrade, IMAGE, key=["a"])
        self.refuse(ValueError, ["key", "2 keys", "fewer"], degrade, np.stack([IMAGE, IMAGE]), key=["a"])
        self.refuse(ValueError, ["threads", "from 1 to 256", "0"], degrade, IMAGE, threads=0)
        self.refuse(TypeError, ["threads", "int", "str"], degrade, IMAGE, threads="2")
        self.refuse(TypeError, ["noise", "bool", "str"], degrade, IMAGE, noise="no")
        self.refuse(ValueError, ["width", "motion"], darkqa_light.sensor_state, "L3", "auto")

    def test_states(self):
        state, replay = darkqa_light.sensor_state(), darkqa_light.replay
        self.refuse(TypeError, ["state", "dict", "list"], replay, IMAGE, [])
        self.refuse(ValueError, ["variant"], replay, IMAGE, {})
        self.refuse(ValueError, ["system_gain", "0.01"], replay, IMAGE, state | {"system_gain": 0})
        self.refuse(ValueError, ["state"], replay, IMAGE, state | {"ratio": float("nan")})
        self.refuse(ValueError, ["nonsense"], replay, IMAGE, state | {"nonsense": 1})
        self.refuse(ValueError, ["version", "synthesis"], replay, IMAGE, state | {"version": 1})
        del state["bias"]
        self.refuse(ValueError, ["bias"], replay, IMAGE, state)


class Random(unittest.TestCase):
    def test_no_argument_crashes_the_interpreter(self):
        draw = random.Random(5)
        accepted = refused = 0
        for _ in range(CALLS):
            try:
                self.call(draw)
                accepted += 1
            except (TypeError, ValueError):
                refused += 1
        self.assertGreater(min(accepted, refused), CALLS // 20)

    def call(self, draw):
        levels = ["L0", "L1", "L3", "L5", "l2", "E3.3", "T33.33", "L9", "", "\udcff", None, 3, b"L3"]
        numbers = [0, 0.5, 3.7, 16, 16.01, -0.0, 1e300, float("nan"), np.float64(2), 2**70, "3", None, True]
        options = {
            "variant": draw.choice(["ev", "noise", "auto", "motion"] * 6 + ["", "all", 1, None]),
            "profile": draw.choice(["paper", "eld", "level", "physical"] * 6 + ["Paper", [], None]),
            "camera": draw.choice([None] * 6 + darkqa_light.cameras() + ["x", "/", "\0", ".toml", 3]),
            "seed": draw.choice([0, 1, 2**64 - 1, np.uint8(3)] * 6 + [2**64, -1, 1.5, "1"]),
            "key": draw.choice(["", "a", "ä\U0001f600", "\0"] * 6 + ["\ud800", 1, ["a", "b"], ["a", 1], iter("ab")]),
        }
        options = {name: value for name, value in options.items() if draw.random() < 0.5}
        further = {
            "noise": draw.choice([True, False] * 6 + [1, None]),
            "linear": draw.choice([True, False] * 6 + ["", None]),
            "threads": draw.choice([1, 2] * 12 + [0, -1, 257, 2**70, 1.0, None]),
        }
        further = {name: value for name, value in further.items() if draw.random() < 0.5}
        image = self.image(draw)
        match draw.randrange(4):
            case 0:
                result = darkqa_light.ladder(image, draw.choices(levels[:6] + numbers[:4] + [draw.choice(levels + numbers)], k=draw.randrange(4)), **options, **further)
            case 1:
                state = darkqa_light.sensor_state(draw.choice(levels[:6]), **options, width=draw.choice([1, 30, 640, 0, 1 << 40]))
                if draw.random() < 0.7:
                    value = draw.choice([0, -1, 1e308, float("inf"), float("nan"), "x", None, [], [1.0] * 4, 1 << 80])
                    state[draw.choice([*state, "x"])] = value
                result = darkqa_light.replay(image, state, **further)
            case 2:
                result = darkqa_light.degrade(image, **options, **further, ev=draw.choice(numbers))
            case _:
                result = darkqa_light.degrade(image, draw.choice(levels), **options, **further)
        assert np.isfinite(result).all()
        assert result.shape[-3:] == image.shape[-3:]

    def image(self, draw):
        shape = [draw.choice([0, 1, 2, 3, 5, 17, 33]) for _ in range(draw.choice([2, 2, 2, 2, 3, 3, 1, 0, 4]))]
        shape += draw.choice([[3]] * 8 + [[1], [4], []])
        dtype = draw.choice(["uint8"] * 16 + ["int8", "uint16", "float32", ">f8", "bool", "object", "U3", "M8[s]"])
        array = np.zeros(shape, dtype)
        if dtype == "uint8":
            array[...] = draw.randrange(256)
            array.flat[: array.size // 2] = 255
        for _ in range(draw.randrange(3)):
            match draw.randrange(6):
                case 0 if array.ndim > 0:
                    array = array[::-1]
                case 1 if array.ndim > 1:
                    array = array[:, ::2]
                case 2:
                    array = np.asfortranarray(array)
                case 3:
                    array.setflags(write=False)
                case 4 if array.ndim > 2:
                    array = array.swapaxes(0, 1)
                case 5:
                    array = array.view(type("Sub", (np.ndarray,), {}))
        return draw.choice([array] * 30 + [None, "x", b"xxx", [[[1, 2, 3]]], memoryview(bytes(12))])


if __name__ == "__main__":
    unittest.main()
