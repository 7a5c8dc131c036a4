"""The pairs of real systems in tests/data are those of their script."""

import pathlib
import sys

import numpy as np
import pytest

DATA = pathlib.Path(__file__).parents[1] / "data"
sys.path.insert(0, str(DATA))
import make_real  # noqa: E402


@pytest.mark.parametrize(
    "name, package, map_of",
    [
        ("three-body", "rebound", make_real.three_body),
        ("spring-pendulum", "scipy", make_real.spring_pendulum),
    ],
)
def test_pairs_are_made_again(name, package, map_of):
    pytest.importorskip(package, reason=f"without {package} the pairs are not made again")
    for file in (f"{name}.npz", f"{name}-check.npz"):
        pairs = np.load(DATA / file)
        points, images = pairs["input"][:50], pairs["output"][:50]
        assert pairs["input"].shape[1] == 4 and len(pairs["input"]) >= 300
        assert np.abs(map_of(points)[1] - images).max() < 1e-10


def test_variables_are_those_of_the_particles():
    points = make_real.three_body_points(100, 5)
    again = make_real.variables(make_real.particles(points))
    assert np.abs(again - points).max() < 1e-13


@pytest.mark.parametrize(
    "package, map_of, points",
    [
        ("rebound", make_real.three_body, make_real.three_body_points),
        ("scipy", make_real.spring_pendulum, make_real.spring_pendulum_points),
    ],
)
def test_maps_are_symplectic(package, map_of, points):
    pytest.importorskip(package)
    point, step = points(1, 6)[0], 1e-5
    jacobian = np.zeros((4, 4))
    for k in range(4):
        d = step * np.eye(4)[k]
        a, b, c, e = map_of(np.array([point + d, point - d, point + 2 * d, point - 2 * d]))[1]
        jacobian[:, k] = (8 * (a - b) - (c - e)) / (12 * step)
    omega = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    assert np.abs(jacobian.T @ omega @ jacobian - omega).max() < 1e-7
