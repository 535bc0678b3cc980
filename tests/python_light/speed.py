"""Speeds of the module, as src/docs/training.md prints them. Measured by hand; no test depends on time.

    python tests/python_light/speed.py

Prints the best of short repetitions: images per second of wall time with one and two threads, and of CPU time.
"""

import time

import numpy as np

import darkqa_light

SIZES = [(480, 640), (1440, 2560)]
SECONDS = 2.0


def rates(call, images, seconds=SECONDS):
    """(images per second, images per CPU second) of the best call within so many seconds."""
    call()
    wall, cpu, end = [], [], time.perf_counter() + seconds
    while time.perf_counter() < end or len(wall) < 3:
        begin, begin_cpu = time.perf_counter(), time.process_time()
        call()
        wall.append(time.perf_counter() - begin)
        cpu.append(time.process_time() - begin_cpu)
    return images / min(wall), images / min(cpu)


def picture(height, width):
    """A smooth picture with some noise, so that neither black nor white prevails."""
    rows, columns = np.mgrid[:height, :width] / [[[height]], [[width]]]
    light = 40 + 150 * np.stack([rows, columns, rows * columns], axis=-1)
    return (light + np.random.default_rng(0).normal(0, 8, light.shape)).clip(0, 255).astype(np.uint8)


def calls(image, threads):
    """Named calls, each with the number of images that it makes."""
    for variant in ["ev", "noise", "auto", "motion"]:
        for profile in ["paper", "physical"] if variant == "noise" else ["paper"]:
            yield f"{variant} {profile}", 1, lambda v=variant, p=profile: darkqa_light.degrade(image, "L2", v, p, key="a", threads=threads)
    yield "noise paper, float32", 1, lambda: darkqa_light.degrade(image, "L2", key="a", linear=True, threads=threads)
    yield "noise paper, ladder of 5", 5, lambda: darkqa_light.ladder(image, key="a", threads=threads)


def main():
    for height, width in SIZES:
        image = picture(height, width)
        for threads in [1, 2]:
            for name, images, call in calls(image, threads):
                wall, cpu = rates(call, images)
                print(f"{width}x{height}  threads {threads}  {name:26} {wall:8.1f} per s  {cpu:8.1f} per CPU s", flush=True)


if __name__ == "__main__":
    main()
