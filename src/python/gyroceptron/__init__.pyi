from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Certificate", "Error", "Model", "__version__", "load", "train"]

__version__: str

class Error(ValueError): ...

class Certificate:
    @property
    def holds(self) -> bool: ...
    @property
    def summary(self) -> str: ...
    @property
    def rows(self) -> list[dict[str, Any]]: ...

class Model:
    @property
    def kind(self) -> str: ...
    @property
    def dof(self) -> int: ...
    @property
    def epsilon(self) -> float: ...
    @property
    def flow_time(self) -> float | None: ...
    @property
    def angles(self) -> list[float]: ...
    @property
    def parameters(self) -> NDArray[np.float64]: ...
    @property
    def validation(self) -> float | None: ...
    @property
    def region(self) -> tuple[list[float], list[float]] | None: ...
    @property
    def units(self) -> tuple[list[float], list[float]] | None: ...
    def predict(
        self,
        points: ArrayLike,
        steps: int = 1,
        every: int = 1,
        outside: Literal["warn", "stop", "ignore"] = "warn",
    ) -> NDArray[np.float64]: ...
    def inverse(self, points: ArrayLike) -> NDArray[np.float64]: ...
    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]: ...
    def invariant(self, points: ArrayLike) -> NDArray[np.float64]: ...
    def verify(self, samples: int = 200, radius: float = 1.6, seed: int = 0) -> Certificate: ...
    def at(self, epsilon: float | None = None, flow_time: float | None = None) -> Model: ...
    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None: ...

def load(path: str | PathLike[str]) -> Model: ...
def train(
    input: ArrayLike,
    output: ArrayLike,
    circle_action: Sequence[int] | Sequence[Sequence[int]],
    *,
    architecture: Literal[
        "gyroceptron", "normal-form", "coupling-gyroceptron", "henon-net", "sympnet"
    ] = "gyroceptron",
    psi: tuple[int, int] | None = None,
    near_identity: tuple[int, int] | None = None,
    kicks: tuple[int, int] | None = None,
    twists: tuple[int, int] | tuple[int, tuple[int, int]] | None = None,
    perturbation: tuple[int, int] | None = None,
    layers: tuple[int, int] | None = None,
    optimiser: Literal["l-bfgs", "lm", "adam"] = "l-bfgs",
    iterations: int | None = None,
    starts: int = 1,
    near_identity_penalty: float = 0.0,
    patience: int = 0,
    target: float = 0.0,
    plateau: int | None = None,
    epsilon: float | None = None,
    flow_time: float | None = None,
    theta: float | None = None,
    theta_fixed: bool = False,
    theta_penalty: float = 0.0,
    units: Literal["fitted", "data"] = "fitted",
    validation: float = 0.1,
    seed: int = 0,
    report: str | PathLike[str] | None = None,
    callback: Callable[[str, int, float, float | None], bool | None] | None = None,
) -> Model: ...
