"""Dark images for training: exposure drop and physics-based sensor noise.

>>> import darkqa_light
>>> dark = darkqa_light.degrade(image, "L3", key="kitchen/12.png")                  # noisy
>>> target = darkqa_light.degrade(image, "L3", key="kitchen/12.png", noise=False)   # as bright, without noise
"""

from darkqa_light._core import __version__, cameras, degrade, ladder, replay, sensor_state

__all__ = ["__version__", "cameras", "degrade", "ladder", "replay", "sensor_state"]
