"""Tunes of orbits and how long they stay: what is asked of the map of a ring."""

import numpy as np
import pytest

import gyroceptron

TURNS = 0.2114


def henon(z):
    """A turn of q and p after a kick by the square of q, in each of two planes that know of each other."""
    q, p = z[..., :2], z[..., 2:]
    kick = np.stack([q[..., 0] ** 2 - 0.1 * q[..., 1] ** 2, -0.2 * q[..., 0] * q[..., 1]], -1)
    p = p - kick
    turns = 2 * np.pi * np.array([TURNS, 0.31])
    return np.concatenate([np.cos(turns) * q + np.sin(turns) * p, -np.sin(turns) * q + np.cos(turns) * p], -1)


@pytest.fixture(scope="module")
def model():
    z = np.random.default_rng(1).uniform(-0.4, 0.4, (600, 4))
    block = dict(layer="turned-kick", part="near-identity", widths=[2, 2], degree=3, radius=4.0)
    return gyroceptron.train(
        z, henon(z), [[1, 0], [0, 1]], blocks=[block], epsilon=1.0, units="data", starts=1, iterations=80
    )


def test_tunes_are_those_of_the_map(model):
    starts = np.array([[0.05, 0.02, 0.0, 0.0], [0.2, 0.1, 0.0, 0.0]])
    states = [starts]
    for _ in range(1000):
        states.append(henon(states[-1]))
    turns, changes = gyroceptron.tunes(np.array(states))
    assert turns.shape == changes.shape == (2, 2)
    assert np.abs(turns[0] - [TURNS, 0.31]).max() < 1e-2 and changes.max() < 1e-6
    # They shift with amplitude, and are those of the model.
    assert np.abs(turns[1] - turns[0]).max() > 1e-3
    own, _ = gyroceptron.tunes(model.predict(starts, steps=1000))
    assert np.abs(own - turns).max() < 1e-4
    alone, _ = gyroceptron.tunes(np.array(states)[:, 1])
    assert (alone == turns[1]).all()
    assert np.isnan(gyroceptron.tunes(np.array(states)[:8])[0]).all()
    with pytest.raises(gyroceptron.Error, match="orbits"):
        gyroceptron.tunes(np.zeros((3, 3)))


def test_orbits_survive_until_they_leave(model):
    radii = np.linspace(0.02, 1.0, 50)
    starts = np.stack([radii, 0.1 * radii, 0 * radii, 0 * radii], -1)
    box = [2.0] * 4
    found = model.survival(starts.reshape(5, 10, 4), 300, [-v for v in box], box)
    assert found.shape == (5, 10) and found.dtype == np.int64
    here, own = starts, np.full(50, 301)
    for step in range(1, 301):
        with np.errstate(all="ignore"):
            here = henon(here)
        out = ~(np.abs(here) <= 2.0).all(axis=1)
        own[out & (own == 301)] = step
    aperture = [radii[np.argmax(t < 301) - 1] for t in (found.ravel(), own)]
    assert 0.3 < aperture[1] < 0.9 and abs(aperture[0] - aperture[1]) <= 0.02
    # The box of the training points, unless another is given.
    assert (model.survival(starts, 300) <= found.ravel()).all()
    with pytest.raises(gyroceptron.Error, match="low"):
        model.survival(starts, 10, [-1.0], [1.0])
