import os
from collections.abc import Sequence
from typing import Any, Literal, TypedDict, overload

import numpy as np
from numpy.typing import NDArray

__all__ = ["__version__", "cameras", "degrade", "ladder", "replay", "sensor_state"]

__version__: str

_Variant = Literal["ev", "noise", "auto", "motion"]
_Profile = Literal["paper", "eld", "level", "physical"]
_Camera = str | os.PathLike[str]
_Key = str | Sequence[str]

class _Sensor(TypedDict, total=False):
    # Only with sensor noise.
    amplify: Literal["shot-only", "all"]
    tone: Literal["none", "before-ev", "after-ev"]
    coupling: Literal["independent", "photon"]
    rgb_to_camera: list[list[float]]
    camera_to_rgb: list[list[float]]
    rgb_gain: float
    red_gain: float
    blue_gain: float
    system_gain: float
    ratio: float
    read_scale: float
    read_shape: float
    row_deviation: float
    bias: list[float]
    adu_range: float

class _State(_Sensor):
    version: int
    variant: _Variant
    seed: int
    key: str
    ev: float
    blur_px: float
    blur_angle: float

def cameras() -> list[str]: ...
@overload
def degrade(
    image: NDArray[np.uint8],
    level: str = "L3",
    variant: _Variant = "noise",
    profile: _Profile = "paper",
    camera: _Camera | None = None,
    seed: int = 0,
    key: _Key = "",
    *,
    ev: float | None = None,
    noise: bool = True,
    linear: Literal[False] = False,
    threads: int = 1,
) -> NDArray[np.uint8]: ...
@overload
def degrade(
    image: NDArray[np.uint8],
    level: str = "L3",
    variant: _Variant = "noise",
    profile: _Profile = "paper",
    camera: _Camera | None = None,
    seed: int = 0,
    key: _Key = "",
    *,
    ev: float | None = None,
    noise: bool = True,
    linear: Literal[True],
    threads: int = 1,
) -> NDArray[np.float32]: ...
@overload
def ladder(
    image: NDArray[np.uint8],
    levels: Sequence[str | float] = ("L1", "L2", "L3", "L4", "L5"),
    variant: _Variant = "noise",
    profile: _Profile = "paper",
    camera: _Camera | None = None,
    seed: int = 0,
    key: _Key = "",
    *,
    noise: bool = True,
    linear: Literal[False] = False,
    threads: int = 1,
) -> NDArray[np.uint8]: ...
@overload
def ladder(
    image: NDArray[np.uint8],
    levels: Sequence[str | float] = ("L1", "L2", "L3", "L4", "L5"),
    variant: _Variant = "noise",
    profile: _Profile = "paper",
    camera: _Camera | None = None,
    seed: int = 0,
    key: _Key = "",
    *,
    noise: bool = True,
    linear: Literal[True],
    threads: int = 1,
) -> NDArray[np.float32]: ...
def sensor_state(
    level: str = "L3",
    variant: _Variant = "noise",
    profile: _Profile = "paper",
    camera: _Camera | None = None,
    seed: int = 0,
    key: str = "",
    *,
    ev: float | None = None,
    width: int | None = None,
) -> _State: ...
@overload
def replay(
    image: NDArray[np.uint8],
    state: _State | dict[str, Any],
    *,
    noise: bool = True,
    linear: Literal[False] = False,
    threads: int = 1,
) -> NDArray[np.uint8]: ...
@overload
def replay(
    image: NDArray[np.uint8],
    state: _State | dict[str, Any],
    *,
    noise: bool = True,
    linear: Literal[True],
    threads: int = 1,
) -> NDArray[np.float32]: ...
