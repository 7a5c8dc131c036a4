from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, SupportsFloat, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Certificate",
    "Error",
    "FieldLines",
    "InvariantCircle",
    "Model",
    "ProgressBar",
    "Report",
    "SymplecticPolynomial",
    "__version__",
    "check_proof",
    "load",
    "merge",
    "plan",
    "prove",
    "rotation_number",
    "run",
    "run_job",
    "spectral_lines",
    "train",
    "tunes",
]

__version__: str

_Layers = (
    tuple[int, int]
    | tuple[int, tuple[int, int]]
    | tuple[int, int, str]
    | tuple[int, tuple[int, int], str]
    | tuple[int, int, int]
    | tuple[int, tuple[int, int], int]
    | list[int]
)

class Error(ValueError):
    """An error of the library; its message has the values that explain it."""

class _Trust(TypedDict):
    verdict: str
    error: str
    reasons: list[str]
    next: str

class _Record(TypedDict):
    iteration: int
    loss: float
    held_out: float | None

class _PeriodicOrbit(TypedDict):
    points: NDArray[np.float64]
    multiplier: NDArray[np.float64]
    trace: float
    residue: float
    missed: float
    inside: bool | None

class Certificate:
    """The measured structure of a model, `Model.verify`."""

    @property
    def holds(self) -> bool:
        """Whether no law is violated or vacuous."""
    @property
    def summary(self) -> str:
        """One line: how many laws hold, by what headroom, or which do not."""
    @property
    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each law."""
    @property
    def notes(self) -> list[str]:
        """Notes beside the laws; empty if there are none."""
    def _repr_html_(self) -> str: ...

class Model:
    """A trained or loaded network. Points are (..., 2n), q1 ... qn, p1 ... pn, in units of the data.

    It never changes; equal models are the same map, bit for bit. It can be copied and pickled.
    """

    @property
    def kind(
        self,
    ) -> Literal[
        "gyroceptron",
        "normal-form",
        "coupling-gyroceptron",
        "kicked-gyroceptron",
        "henon-net",
        "symp-net",
        "blocks",
    ]:
        """The name of its architecture, if it has one."""
    @property
    def structure(
        self,
    ) -> Literal["plain", "nearly-periodic", "normal-form", "nearly-integrable", "mixed"]:
        """The structure that its blocks give it."""
    @property
    def blocks(self) -> list[dict[str, Any]]:
        """Its blocks, as train takes them."""
    @property
    def dof(self) -> int:
        """The degrees of freedom n: points have 2n numbers."""
    @property
    def epsilon(self) -> float:
        """Epsilon of its near-identity part."""
    @property
    def flow_time(self) -> float | None:
        """The time of the flow map that the model approximates, where it is known."""
    @property
    def angles(self) -> list[float]:
        """The angles of its circles, in radians."""
    @property
    def parameters(self) -> NDArray[np.float64]:
        """All parameters, (P,): a copy that cannot be written to."""
    @property
    def validation(self) -> float | None:
        """The held-out mean squared error of its training, in units of the network."""
    @property
    def region(self) -> tuple[list[float], list[float]] | None:
        """The corners (low, high) of the box of its training points, 2n numbers each."""
    @property
    def units(self) -> tuple[list[float], list[float]] | None:
        """(centre, factors), 2n numbers each, if the data has other units than the network."""
    @property
    def trust(self) -> _Trust | None:
        """Whether to trust the model, and why not; None for a model that was loaded."""
    @property
    def history(self) -> list[_Record] | None:
        """The records of its training; None for a model that was loaded."""
    @property
    def notes(self) -> list[str]:
        """Notes on its training: units, and the circle action that was found."""
    def predict(
        self,
        points: ArrayLike,
        steps: int = 1,
        every: int = 1,
        outside: Literal["warn", "stop", "ignore"] = "warn",
        grid: int | None = None,
        grid_numbers: Literal["integers", "floats"] | None = None,
    ) -> NDArray[np.float64]:
        """Trajectories from points (..., 2n): (abs(steps) // every + 1, ..., 2n); steps < 0 go back."""
    def inverse(self, points: ArrayLike) -> NDArray[np.float64]:
        """The preimages of points (..., 2n) under one step: (..., 2n)."""
    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]:
        """The Jacobians of one step at points (..., 2n): (..., 2n, 2n)."""
    def invariant(self, points: ArrayLike) -> NDArray[np.float64]:
        """The invariant of the network at points (..., 2n): (...)."""
    def periodic_orbits(
        self, guesses: ArrayLike, period: int = 1, apart: float = 1e-6
    ) -> list[_PeriodicOrbit]:
        """The orbits of exactly `period` steps that Newton's method finds from guesses (N, 2n)."""
    def symmetric_orbits(
        self, reversor: str, low: float, high: float, period: int = 1, *, samples: int = 200
    ) -> list[_PeriodicOrbit]:
        """The orbits of exactly `period` steps that begin on the line of symmetry of a reversible map of a plane."""
    def island(
        self, guess: ArrayLike, period: int = 1, *, around: ArrayLike, reach: float = 0.15
    ) -> dict[str, float] | None:
        """The island of the elliptic orbit near `guess` on a ray: low, high, width and angle; None without one."""
    def survival(
        self,
        points: ArrayLike,
        steps: int,
        low: Sequence[float] | None = None,
        high: Sequence[float] | None = None,
    ) -> NDArray[np.int64]:
        """The number of steps after which each orbit leaves a box, 0 if it begins outside, steps + 1 if it stays."""
    def dynamic_aperture(
        self,
        centre: ArrayLike,
        directions: ArrayLike,
        radii: Sequence[float],
        steps: int,
        low: Sequence[float] | None = None,
        high: Sequence[float] | None = None,
    ) -> NDArray[np.float64]:
        """The largest radius along each direction (M, 2n) up to which all orbits stay in a box: (M,)."""
    def lyapunov_exponent(self, point: ArrayLike, steps: int) -> float:
        """The finite-time Lyapunov exponent: ln of the growth per step of a small distance."""
    def alignment_index(self, point: ArrayLike, steps: int) -> float:
        """The smaller alignment index of the orbit from a point: 0 up to rounding in chaos."""
    def manifold(
        self,
        guess: ArrayLike,
        period: int = 1,
        *,
        stable: bool = False,
        forward: bool = True,
        start: float = 1e-6,
        spacing: float = 1e-2,
        length: float = 1.0,
    ) -> NDArray[np.float64]:
        """A branch of the stable or unstable manifold of a periodic orbit of a map of a plane: (N, 2)."""
    def verify(self, samples: int = 200, radius: float = 1.6, seed: int = 0) -> Certificate:
        """Measures the structure of the network at seeded points."""
    def at(
        self, epsilon: float | None = None, flow_time: float | None = None, **controls: float
    ) -> Model:
        """The same weights at another epsilon or flow time, or at values of its controls."""
    @property
    def controls(self) -> dict[str, tuple[float, float]]:
        """The controls that the model depends on, with their ranges."""
    def control_derivatives(self, points: ArrayLike, **controls: float) -> NDArray[np.float64]:
        """The derivatives of one step by the controls, (..., 2n, controls)."""
    def orbit_response(self, guess: ArrayLike, period: int = 1, **controls: float) -> dict[str, Any]:
        """A periodic orbit, with its derivatives and those of its trace by the controls."""
    def rotation_response(
        self,
        start: tuple[float, float],
        centre: tuple[float, float],
        steps: int = 1000,
        **controls: float,
    ) -> tuple[float, NDArray[np.float64]]:
        """The turns per step of an orbit about a centre, and their derivatives by the controls."""
    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Writes the model file."""
    def plot_portrait(
        self, points: ArrayLike, steps: int = 1000, plane: int = 1, ax: Any | None = None
    ) -> Any:
        """Plots orbits as dots in one plane (q, p), on axes of matplotlib."""
    def source_code(
        self, language: Literal["c", "jax", "torch"], name: str = "model"
    ) -> dict[str, str]:
        """The map as source code, {file name: text}."""
    def to_jax(self) -> Callable[[Any], Any]:
        """The map as a function of arrays of JAX, with attributes inverse, iterate and invariant."""
    def to_torch(self) -> Callable[[Any], Any]:
        """The map as a function of tensors of PyTorch, with attributes inverse, iterate and invariant."""
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> Model: ...
    def __deepcopy__(self, _memo: dict[int, Any]) -> Model: ...
    def _repr_html_(self) -> str: ...

class InvariantCircle:
    """The closed curve on which an orbit (T, 2) of a map of a plane lies, as a Fourier series."""

    def __init__(self, orbit: ArrayLike, turns: float) -> None: ...
    @property
    def turns(self) -> float:
        """The rotation number of the curve, in turns per step."""
    @property
    def error(self) -> float:
        """The largest distance of the second half of the orbit from the points that the curve predicts."""
    @property
    def area(self) -> float:
        """The area inside the curve, with the sign of its direction."""
    def flux(
        self, section: str | PathLike[str], controls: Sequence[float] | None = None
    ) -> float:
        """The integral of rho over the inside, of a file of rho; of R, Z and B_phi in tesla the toroidal flux in webers."""
    def points(self, count: int) -> NDArray[np.float64]:
        """`count` points of the curve at equal distances of the angle: (count, 2)."""
    def distances(self, points: ArrayLike) -> NDArray[np.float64]:
        """The distances of points (..., 2) from the curve: (...)."""

class SymplecticPolynomial:
    """A symplectic map whose generating function is a polynomial of least squares, fitted to pairs (N, 2n).

    Without a degree it is raised until the error on held-out pairs, a share `validation` of all, falls no more by a tenth.
    With reversor, the reflection of "positions" or "momenta" turns it into its inverse; with mirrored, it commutes with
    the reflection of these planes, 1 being that of q1 and p1. section is a file of the density of the area form, as for
    train, without controls. Ctrl-C ends the fit within a second.
    """

    def __init__(
        self,
        input: ArrayLike,
        output: ArrayLike,
        degree: int | None = None,
        reversor: Literal["positions", "momenta"] | None = None,
        section: str | PathLike[str] | None = None,
        mirrored: Sequence[int] = ...,
        validation: float | None = None,
        seed: int = 0,
    ) -> None: ...
    @staticmethod
    def load(path: str | PathLike[str]) -> SymplecticPolynomial:
        """The polynomial of a file that save wrote."""
    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Writes a file, which load reads."""
    @property
    def degree(self) -> int:
        """The total degree of the generating function."""
    @property
    def parameters(self) -> NDArray[np.float64]:
        """The coefficients of the generating function, without the constant."""
    @property
    def region(self) -> tuple[list[float], list[float]]:
        """The box of the pairs: the lowest and the highest of each coordinate."""
    def error(self, input: ArrayLike, output: ArrayLike) -> float:
        """The root mean square distance of the images of input from output, both (N, 2n)."""
    def predict(
        self,
        points: ArrayLike,
        steps: int = 1,
        every: int = 1,
        outside: Literal["warn", "stop", "ignore"] = "warn",
    ) -> NDArray[np.float64]:
        """The states of trajectories from points (..., 2n): (abs(steps) // every + 1, ..., 2n); steps < 0 go back.

        NaN from where one leaves the box of a section.
        """
    def inverse(self, points: ArrayLike) -> NDArray[np.float64]:
        """The preimages of points (..., 2n)."""
    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]:
        """The Jacobians at points (..., 2n): (..., 2n, 2n)."""
    def periodic_orbits(
        self, guesses: ArrayLike, period: int = 1, apart: float = 1e-6
    ) -> list[_PeriodicOrbit]:
        """The orbits of exactly `period` steps that Newton's method finds from guesses (N, 2n)."""
    def symmetric_orbits(
        self, reversor: str, low: float, high: float, period: int = 1, *, samples: int = 200
    ) -> list[_PeriodicOrbit]:
        """The orbits of exactly `period` steps that begin on the line of symmetry of a reversible map of a plane."""
    def island(
        self, guess: ArrayLike, period: int = 1, *, around: ArrayLike, reach: float = 0.15
    ) -> dict[str, float] | None:
        """The island of the elliptic orbit near `guess` on a ray: low, high, width and angle; None without one."""
    def lyapunov_exponent(self, point: ArrayLike, steps: int) -> float:
        """The finite-time Lyapunov exponent of the orbit from `point`, per step."""
    def alignment_index(self, point: ArrayLike, steps: int) -> float:
        """The smaller alignment index of the orbit from `point`: 0 up to rounding in chaos."""
    def manifold(
        self,
        guess: ArrayLike,
        period: int = 1,
        *,
        stable: bool = False,
        forward: bool = True,
        start: float = 1e-6,
        spacing: float = 1e-2,
        length: float = 1.0,
    ) -> NDArray[np.float64]:
        """A branch of a manifold of the periodic orbit near `guess`, of a map of a plane: points (N, 2)."""
    def verify(self, samples: int = 200, seed: int = 0) -> Certificate:
        """Tests the structure of the map in the middle of the box of its pairs."""
    def survival(
        self,
        points: ArrayLike,
        steps: int,
        low: Sequence[float] | None = None,
        high: Sequence[float] | None = None,
    ) -> NDArray[np.int64]:
        """The number of steps after which each orbit is outside of a box, 0 at the start, steps + 1 if it stays."""
    def dynamic_aperture(
        self,
        centre: ArrayLike,
        directions: ArrayLike,
        radii: Sequence[float],
        steps: int,
        low: Sequence[float] | None = None,
        high: Sequence[float] | None = None,
    ) -> NDArray[np.float64]:
        """The largest radius along each direction (M, 2n) up to which all orbits stay in a box: (M,)."""

class FieldLines:
    """Field lines of coils, and the map of a section along them: points are (..., 2), R and Z in metres."""

    def __init__(
        self,
        coils: str | PathLike[str] | None = None,
        currents: Sequence[float] | None = None,
        field_periods: int | None = None,
        *,
        stellarator_symmetric: bool = True,
        section: float = 0.0,
        periods: int = 1,
        reach: float = 0.1,
        axis: tuple[float, float] | None = None,
        error: float = 1e-10,
    ) -> None: ...
    @property
    def axis(self) -> list[float]:
        """R and Z of the magnetic axis, in metres."""
    @property
    def error(self) -> float:
        """The error of a map, in metres."""
    @property
    def turns(self) -> float:
        """Turns about the axis per map of a line close to it, with whole turns, from R towards Z; NaN if it has none."""
    def starts(self, lines: int) -> NDArray[np.float64]:
        """The points where lines begin, (lines, 2): from the axis outwards to the reach."""
    def trace(self, points: ArrayLike, maps: int, *, near_coils: bool = True) -> NDArray[np.float64]:
        """The points of lines, map after map: (maps + 1, ..., 2); NaN for a line that is lost."""
    def distance_to_coils(self, points: ArrayLike, maps: int = 1) -> NDArray[np.float64]:
        """How near lines from points (..., 2) come to a coil in so many maps, in metres: (...)."""
    def inverse(self, points: ArrayLike) -> NDArray[np.float64]:
        """The points from which lines come to points (..., 2) in one map."""
    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]:
        """The Jacobians of a map at points (..., 2): (..., 2, 2)."""
    def density(self, points: ArrayLike) -> NDArray[np.float64]:
        """The toroidal field |B_phi| at points (..., 2), in tesla: (...)."""
    def field(self, places: ArrayLike) -> NDArray[np.float64]:
        """The field of the coils at places (..., 3), Cartesian, in tesla: (..., 3)."""
    def field_gradient(self, places: ArrayLike) -> NDArray[np.float64]:
        """The derivatives of the field at places (..., 3), in tesla per metre: (..., 3, 3)."""
    def periodic_orbits(
        self, guesses: ArrayLike, period: int = 1, apart: float = 1e-6
    ) -> list[_PeriodicOrbit]:
        """The orbits of exactly `period` steps that Newton's method finds from guesses (N, 2n)."""
    def symmetric_orbits(
        self, reversor: str, low: float, high: float, period: int = 1, *, samples: int = 200
    ) -> list[_PeriodicOrbit]:
        """The orbits of exactly `period` steps that begin on the line of symmetry of a reversible map of a plane."""
    def island(
        self, guess: ArrayLike, period: int = 1, *, around: ArrayLike, reach: float = 0.15
    ) -> dict[str, float] | None:
        """The island of the elliptic orbit near `guess` on a ray: low, high, width and angle; None without one."""
    def manifold(
        self,
        guess: ArrayLike,
        period: int = 1,
        *,
        stable: bool = False,
        forward: bool = True,
        start: float = 1e-6,
        spacing: float = 1e-2,
        length: float = 1.0,
    ) -> NDArray[np.float64]:
        """A branch of a manifold of the periodic orbit near `guess`: points (N, 2)."""
    def survival(
        self, points: ArrayLike, maps: int, low: Sequence[float], high: Sequence[float]
    ) -> NDArray[np.int64]:
        """The number of maps after which each line is outside of a box, 0 at the start, maps + 1 if it stays."""
    def lyapunov_exponent(self, point: ArrayLike, steps: int) -> float:
        """The finite-time Lyapunov exponent of the orbit from `point`, per step."""
    def alignment_index(self, point: ArrayLike, steps: int) -> float:
        """The smaller alignment index of the orbit from `point`: 0 up to rounding in chaos."""
    def write_section(
        self, path: str | PathLike[str], points: ArrayLike, overwrite: bool = False
    ) -> None:
        """Writes B_phi on a grid around points: a file that train takes as its section."""

def tunes(orbits: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The turns per step of orbits (T, M, 2n) in every plane, and how much those of their halves differ."""

def spectral_lines(
    signal: ArrayLike, count: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The strongest lines of a signal (T, 2), x and y of x + iy: frequencies (K,), amplitudes (K, 2)."""

def rotation_number(
    orbit: ArrayLike, centre: tuple[float, float], near: float = 0.0
) -> tuple[Any, Any]:
    """The rotation number of an orbit (T, 2) or of orbits (T, M, 2) about a centre, in turns a step, and its error."""

def prove(
    model: Model,
    frequencies: Sequence[str] | None = None,
    *,
    circles: int = 8,
    start: Sequence[float] | None = None,
    end: Sequence[float] = ...,
    output: str | PathLike[str] | None = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Proves that a model of one degree of freedom has invariant circles, which no orbit crosses."""

def check_proof(model: Model, path: str | PathLike[str]) -> dict[str, Any]:
    """Verifies a file of proofs of a model again, without any search."""

def load(path: str | PathLike[str]) -> Model:
    """Reads a model file."""

def train(
    input: ArrayLike,
    output: ArrayLike,
    circle_action: Literal["auto"]
    | SupportsFloat
    | Sequence[SupportsFloat]
    | Sequence[Sequence[SupportsFloat]]
    | NDArray[Any] = "auto",
    *,
    recipe: Literal["recommended", "paper"] | None = None,
    scene: str | PathLike[str] | None = None,
    architecture: Literal[
        "gyroceptron",
        "normal-form",
        "coupling-gyroceptron",
        "kicked-gyroceptron",
        "henon-net",
        "symp-net",
        "sympnet",
    ]
    | None = None,
    psi: _Layers | None = None,
    near_identity: _Layers | None = None,
    kicks: _Layers | None = None,
    twists: _Layers | None = None,
    turned_twists: _Layers | None = None,
    perturbation: _Layers | None = None,
    layers: _Layers | None = None,
    radius: float | None = None,
    reversor: Literal["positions", "momenta"] | None = None,
    blocks: Sequence[Mapping[str, Any]] | None = None,
    optimiser: Literal["l-bfgs", "lm", "adam"] | None = None,
    iterations: int | None = None,
    starts: int | None = None,
    ramp: Sequence[tuple[float, int] | tuple[float | None, int, int] | dict[str, float | None]] | None = None,
    near_identity_penalty: float | None = None,
    loss_weights: Literal["auto", "none"] | Sequence[float] | None = None,
    patience: int | None = None,
    target: float | None = None,
    plateau: int | None = None,
    epsilon: float | NDArray[Any] | tuple[float, NDArray[Any]] | None = None,
    flow_time: float | NDArray[Any] | tuple[float, NDArray[Any]] | None = None,
    theta: float | None = None,
    theta_fixed: bool = False,
    theta_penalty: float | None = None,
    controls: dict[str, ArrayLike] | None = None,
    control_degree: int | None = None,
    section: str | PathLike[str] | None = None,
    units: Literal["fitted", "data"] = "fitted",
    validation: float = 0.1,
    seed: int = 0,
    report: str | PathLike[str] | None = None,
    checkpoint: str | PathLike[str] | None = None,
    resume: bool = False,
    callback: Callable[[str, int, float, float | None], bool | None] | None = None,
) -> Model:
    """Trains a network on pairs, the rows of input and output, (N, 2n) each."""

class ProgressBar:
    """A ``callback`` for :func:`train` and :func:`run` that shows bars of tqdm, in a terminal or a notebook."""

    def __init__(self, **options: Any) -> None: ...
    def __call__(
        self, name: str, iteration: int | None, loss: float | None, validation: float | None
    ) -> None: ...
    def close(self) -> None:
        """Ends the bar that is shown."""
    def __enter__(self) -> ProgressBar: ...
    def __exit__(self, *_: object) -> None: ...

class Report:
    """The report of a run, from its folder; ``data`` is its ``report.json``."""

    path: Path
    data: dict[str, Any]

    def __init__(self, path: str | PathLike[str]) -> None: ...
    @property
    def holds(self) -> bool:
        """Whether no verdict of the run says that something does not hold."""
    def __repr__(self) -> str: ...
    def _repr_html_(self) -> str: ...

class _Job(TypedDict):
    id: str
    kind: Literal["data", "training", "merge"]
    part: str | None
    network: str | None
    seed: int | None
    epsilon: float | None
    flow_time: float | None
    needs: list[str]
    wave: int
    digest: str
    seconds: float | None

_RunCallback = Callable[[str, int | None, float | None, float | None], bool | None]

def plan(
    scene: str | PathLike[str],
    *,
    seed: int | None = None,
    quick: bool = False,
    weights: str | PathLike[str] | None = None,
    estimate: bool = True,
) -> list[_Job]:
    """The jobs of a scene (data sets, trainings, the report), each after those that it needs."""

def run_job(
    scene: str | PathLike[str],
    job: str,
    out: str | PathLike[str] | None = None,
    *,
    seed: int | None = None,
    quick: bool = False,
    weights: str | PathLike[str] | None = None,
    digest: str | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    callback: _RunCallback | None = None,
) -> Literal["done", "was done before", "interrupted"]:
    """Does a job of the plan in a folder of its own below ``out``."""

def merge(
    scene: str | PathLike[str],
    out: str | PathLike[str] | None = None,
    *,
    seed: int | None = None,
    quick: bool = False,
    weights: str | PathLike[str] | None = None,
    digest: str | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    callback: _RunCallback | None = None,
) -> Report | None:
    """Makes the report of all jobs below ``out``, with the same bytes as a run in one process."""

def run(
    scene: str | PathLike[str] = "quickstart",
    out: str | PathLike[str] | None = None,
    *,
    seed: int | None = None,
    quick: bool = False,
    weights: str | PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    threads: int | None = None,
    callback: _RunCallback | None = None,
    client: Any | None = None,
) -> Report | None:
    """Runs a scene into a folder, here or on the workers of a Dask client; returns its report."""
