"""Tunes of orbits and how long they stay: what is asked of the map of a ring."""

import numpy as np
import pytest

import gyroceptron

TURNS = 0.2114


def turned(z, turns):
    """Each plane turned from p towards q."""
    (q, p), angles = (z[..., :2], z[..., 2:]), 2 * np.pi * turns
    return np.concatenate([np.cos(angles) * q + np.sin(angles) * p, -np.sin(angles) * q + np.cos(angles) * p], -1)


def henon(z):
    """A turn of q and p after a kick by the square of q, in each of two planes that know of each other."""
    q, p = z[..., :2], z[..., 2:]
    kick = np.stack([q[..., 0] ** 2 - 0.1 * q[..., 1] ** 2, -0.2 * q[..., 0] * q[..., 1]], -1)
    p = p - kick
    return turned(np.concatenate([q, p], -1), np.array([TURNS, 0.31]))


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
    # Along a ray it is the aperture.
    rays = [[1.0, 0.1, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    low = [-v for v in box]
    along = model.dynamic_aperture([0.0] * 4, rays, list(radii), 300, low, box)
    assert along.shape == (2,) and along[0] == aperture[0]
    assert model.dynamic_aperture([0.0] * 4, rays, [1e3, 2e3], 300, low, box).tolist() == [0.0, 0.0]
    before = np.random.default_rng(2).uniform(-0.5, 0.5, (3000, 4))
    polynomial = gyroceptron.SymplecticPolynomial(before, henon(before), 8)
    (near, none) = (
        polynomial.dynamic_aperture([0.0] * 4, rays, given, 300, [-v for v in box], box)
        for given in (list(radii), [1e3, 2e3])
    )
    assert near.shape == (2,) and abs(near[0] - aperture[1]) <= 0.04 and none.tolist() == [0.0, 0.0]
    # The box of its pairs is smaller.
    assert (polynomial.dynamic_aperture([0.0] * 4, rays, list(radii), 300) < near).all()
    with pytest.raises(gyroceptron.Error, match="centre"):
        polynomial.dynamic_aperture([0.0, 0.0], rays, list(radii), 300)
    with pytest.raises(gyroceptron.Error, match="radii"):
        model.dynamic_aperture([0.0] * 4, rays, [0.2, 0.1], 300, low, box)
    with pytest.raises(gyroceptron.Error, match="directions"):
        model.dynamic_aperture([0.0] * 4, [[1.0, 0.0]], [0.1], 300, low, box)


def test_spectral_lines_are_found_by_size():
    t = np.arange(400)
    signal = np.exp(2j * np.pi * 0.2137 * t) + (0.1 - 0.2j) * np.exp(-2j * np.pi * 0.31 * t)
    frequencies, amplitudes = gyroceptron.spectral_lines(np.stack([signal.real, signal.imag], -1), 2)
    assert np.abs(frequencies - [0.2137, -0.31]).max() < 1e-8
    assert np.abs(amplitudes - [[1.0, 0.0], [0.1, -0.2]]).max() < 1e-6
    assert gyroceptron.spectral_lines(np.zeros((400, 2)))[0].shape == (0,)
    with pytest.raises(gyroceptron.Error, match="signal"):
        gyroceptron.spectral_lines(signal.real)


def test_a_symplectic_polynomial_is_fitted_without_training(model):
    z = np.random.default_rng(3).uniform(-0.3, 0.3, (600, 4))
    own = gyroceptron.SymplecticPolynomial(z, henon(z), 3)
    # A kick by a cubic function between linear maps is a cubic generating function.
    assert (own.degree, len(own.parameters)) == (3, 34) and own.error(z, henon(z)) < 1e-14
    assert "degree 3" in repr(own)
    assert gyroceptron.SymplecticPolynomial(z, henon(z), 2).error(z, henon(z)) > 1e-3
    low, high = own.region
    assert np.allclose(low, np.minimum(z, henon(z)).min(axis=0)) and np.all(np.array(high) > low)
    starts = np.array([[[0.05, 0.02, 0.0, 0.0], [0.2, 0.1, 0.0, 0.0]]])
    states, here = own.predict(starts, 20, 5), starts
    assert states.shape == (5, 1, 2, 4) and (states[0] == starts).all()
    for kept in states[1:]:
        for _ in range(5):
            here = henon(here)
        assert np.abs(kept - here).max() < 1e-13
    # Omega by the literal definition, and derivatives by differences.
    jacobian = own.jacobian(starts)
    form = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    assert jacobian.shape == (1, 2, 4, 4)
    assert np.abs(np.swapaxes(jacobian, -1, -2) @ form @ jacobian - form).max() < 1e-14
    step = np.eye(4)[1] * 1e-5
    ends = [own.predict(starts[0, 1] + sign * step)[1] for sign in (1, -1)]
    assert np.abs((ends[0] - ends[1]) / 2e-5 - jacobian[0, 1, :, 1]).max() < 1e-9
    # Orbits that leave are lost when those of the map are, well within the pairs.
    radii = np.linspace(0.01, 0.3, 30)
    rays = np.stack([radii, 0.1 * radii, 0 * radii, 0 * radii], -1)
    assert (own.survival(rays, 200, [-0.1] * 4, [0.1] * 4) == model.survival(rays, 200, [-0.1] * 4, [0.1] * 4)).all()
    assert (own.survival(rays[:3], 200) == 201).all()
    with pytest.warns(UserWarning, match="training points"):
        own.predict([0.6, 0.0, 0.0, 0.0])
    with pytest.raises(gyroceptron.Error, match="training points"):
        own.predict([0.6, 0.0, 0.0, 0.0], outside="stop")
    own.predict([0.6, 0.0, 0.0, 0.0], outside="ignore")
    # A turn on either side of the kick by half the angle: reversible by the reflection of the momenta.
    half = lambda z: turned(z, 0.5 * np.array([TURNS, 0.31]))  # noqa: E731
    both = lambda z: half(turned(henon(half(z)), -np.array([TURNS, 0.31])))  # noqa: E731
    even = gyroceptron.SymplecticPolynomial(z, both(z), 3, reversor="momenta")
    assert even.error(z, both(z)) < 1e-14 and len(even.parameters) == 18
    mirror = [1, 1, -1, -1]
    back = mirror * even.predict(mirror * even.predict(z, outside="ignore")[1], outside="ignore")[1]
    assert np.abs(back - z).max() < 1e-13
    assert gyroceptron.SymplecticPolynomial(z, henon(z), 3, reversor="momenta").error(z, henon(z)) > 1e-3
    # The inverse, as a step back and by itself.
    ends = own.predict(starts, 20, 20)[1]
    assert np.abs(own.predict(ends, -20, 20)[1] - starts).max() < 1e-13
    assert np.abs(own.inverse(own.predict(z, outside="ignore")[1]) - z).max() < 1e-14
    # A kick by the cube of each q changes its sign with all coordinates, and so does the whole map.
    odd = lambda z: turned(z - [0, 0, 0.1, 0.2] * z[..., [0, 1, 0, 1]] ** 3, np.array([TURNS, 0.31]))  # noqa: E731
    mirrored = gyroceptron.SymplecticPolynomial(z, odd(z), 4, mirrored=[1, 2])
    assert len(mirrored.parameters) == 45 and mirrored.error(z, odd(z)) < 1e-14
    assert np.abs(mirrored.predict(-z)[1] + mirrored.predict(z)[1]).max() < 1e-14
    # Without a degree one is found on held-out pairs, as by the program.
    found = gyroceptron.SymplecticPolynomial(z, henon(z))
    assert found.degree == 3 and found.error(z, henon(z)) < 1e-14
    for polynomial in [own, even, mirrored]:
        certificate = polynomial.verify(samples=20)
        assert certificate.holds, certificate.summary
    with pytest.warns(UserWarning, match="do not keep"):
        gyroceptron.SymplecticPolynomial(z, henon(z) * [1, 1, 1, 0.999], validation=0.2, seed=3)
    for asked, words in [
        (lambda: gyroceptron.SymplecticPolynomial(z, henon(z), 3, mirrored=[3]), "mirrored plane"),
        (lambda: gyroceptron.SymplecticPolynomial(z, henon(z), validation=0.0), "choose the degree"),
        (lambda: gyroceptron.SymplecticPolynomial(z, henon(z), 3, reversor="both"), "reversor"),
        (lambda: gyroceptron.SymplecticPolynomial(z[:20], henon(z)[:20], 8), "degree of a generating function"),
        (lambda: gyroceptron.SymplecticPolynomial(z, henon(z)[:-1], 3), "600"),
        (lambda: gyroceptron.SymplecticPolynomial(z[:, :3], henon(z), 3), "input"),
        (lambda: gyroceptron.SymplecticPolynomial(z, z * [1, 1, -1, -1], 3), "symplectic"),
        (lambda: own.predict(starts, outside="never"), "outside"),
        (lambda: own.predict(starts, 0), "steps"),
        (lambda: own.predict(z[:, :2]), "columns"),
    ]:
        with pytest.raises(gyroceptron.Error, match=words):
            asked()
