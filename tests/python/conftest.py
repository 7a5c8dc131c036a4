import shutil
import subprocess

import numpy as np
import pytest

import gyroceptron


def rotation(z, angle):
    """Turns the first of two planes, q1 q2 p1 p2."""
    c, s = np.cos(angle), np.sin(angle)
    q1, q2, p1, p2 = z.T
    return np.stack([c * q1 + s * p1, q2, c * p1 - s * q1, p2], axis=1)


def flow(z, epsilon, time, steps=400):
    """An oscillator that pushes a slow particle: H = (q1^2 + p1^2)/2 (1 + epsilon cos q2) +
    epsilon p2^2/2, by Strang's splitting."""
    h = time / steps
    z = z.copy()
    for _ in range(steps):
        z[:, 1] += 0.5 * h * epsilon * z[:, 3]
        action = 0.5 * (z[:, 0] ** 2 + z[:, 2] ** 2)
        z[:, 3] += h * epsilon * action * np.sin(z[:, 1])
        z = rotation(z, h * (1 + epsilon * np.cos(z[:, 1])))
        z[:, 1] += 0.5 * h * epsilon * z[:, 3]
    return z


@pytest.fixture(scope="session")
def pairs():
    points = np.random.default_rng(1).uniform(-1, 1, (800, 4))
    return points, flow(points, 0.05, 0.7)


@pytest.fixture(scope="session")
def model(pairs):
    return gyroceptron.train(*pairs, [1, 0], recipe="paper", epsilon=0.05, optimiser="lm", iterations=60, seed=4)


@pytest.fixture(scope="session")
def program():
    """The program, where it is on the path."""
    path = shutil.which("gyroceptron")
    if path is None:
        pytest.skip("no program `gyroceptron` on the path")

    def call(*arguments):
        done = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done

    return call
