"""The module in forked processes and in threads, and its memory."""

import multiprocessing
import os
import resource
import sys
import threading
import unittest
from pathlib import Path

import numpy as np

import darkqa_light

IMAGE = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
CALLS = 10_000


def made(threads):
    """An image of each variant, as bytes."""
    return [darkqa_light.degrade(IMAGE, "L2", variant, key="a", threads=threads).tobytes() for variant in ["ev", "noise", "auto"]]


@unittest.skipUnless(hasattr(os, "fork"), "this system has no fork")
class Forks(unittest.TestCase):
    def test_children_make_the_images_of_their_parent(self):
        expected = made(2)
        context = multiprocessing.get_context("fork")
        with context.Pool(3) as pool:
            results = pool.map_async(made, [1, 2, 3, 2, 1, 2]).get(timeout=120)
        self.assertEqual(results, [expected] * 6)

    def test_a_fork_while_other_threads_make_images(self):
        end = threading.Event()

        def work():
            while not end.is_set():
                darkqa_light.degrade(IMAGE, key="b", threads=2)

        workers = [threading.Thread(target=work) for _ in range(2)]
        for worker in workers:
            worker.start()
        try:
            for _ in range(20):
                self.assertEqual(self.exit_code_of_child(), 0)
        finally:
            end.set()
            for worker in workers:
                worker.join()

    def exit_code_of_child(self):
        child = os.fork()
        if child == 0:
            # Ends without a result if it waits for a thread that it does not have.
            import signal

            signal.alarm(60)
            os._exit(0 if made(2) == made(1) else 1)
        _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status)


class Threads(unittest.TestCase):
    def test_the_interpreter_runs_while_images_are_made(self):
        """A thread counts while one long call runs: the call does not hold the GIL."""
        batch = np.broadcast_to(np.tile(IMAGE, (8, 8, 1)), (12, 384, 512, 3))
        darkqa_light.degrade(IMAGE)
        state = {"is_done": False}

        def call():
            darkqa_light.degrade(batch, key="a")
            state["is_done"] = True

        worker = threading.Thread(target=call)
        worker.start()
        count = 0
        while not state["is_done"]:
            count += 1
            worker.join(0.001)
        self.assertGreater(count, 3)

    def test_the_number_of_threads_changes_no_byte(self):
        for threads in [2, 3, 8]:
            self.assertEqual(made(threads), made(1))


@unittest.skipUnless(sys.platform == "linux", "reads /proc")
class Memory(unittest.TestCase):
    def test_memory_does_not_grow(self):
        def resident():
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            return pages * resource.getpagesize()

        batch = np.stack([IMAGE, IMAGE])

        def calls(count):
            for i in range(count):
                darkqa_light.degrade(IMAGE, key=str(i))
                if i % 10 == 0:
                    darkqa_light.ladder(batch, ["L1", 3.3], key=str(i), linear=True, threads=2)
                    darkqa_light.replay(IMAGE, darkqa_light.sensor_state(key=str(i)))
                    try:
                        darkqa_light.degrade(IMAGE, "L9")
                    except ValueError:
                        pass

        calls(CALLS // 10)
        before = resident()
        calls(CALLS)
        grown = resident() - before
        self.assertLess(grown, 4 << 20, "bytes more after 10,000 calls")


if __name__ == "__main__":
    unittest.main()
