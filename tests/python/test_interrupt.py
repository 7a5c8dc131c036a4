"""Ctrl-C."""

import signal
import threading
import time

import numpy as np
import pytest

import gyroceptron

HUGE = 2**40


@pytest.fixture(autouse=True)
def heard():
    """Also where a shell in the background has the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def normal_form(pairs):
    shape = {"kicks": (2, 2), "twists": (2, (2, 2))}
    return gyroceptron.train(
        *pairs, [1, 0], recipe="paper", architecture="normal-form", epsilon=0.05, iterations=3, **shape
    )


def interrupted_after(seconds, call):
    """How long a call goes on after the signal of Ctrl-C."""
    sent = []

    def send():
        time.sleep(seconds)
        sent.append(time.perf_counter())
        signal.raise_signal(signal.SIGINT)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            call()
            pytest.fail("it ended by itself")
        return time.perf_counter() - sent[0]
    finally:
        thread.join()


@pytest.mark.parametrize("which", ["model", "normal_form"])
@pytest.mark.parametrize(
    "points, steps, every",
    [(1, HUGE, HUGE), (1, 3 * 10**6, 1), (700, HUGE, HUGE), (700, HUGE, HUGE // 5), (50_000, 300, 1)],
)
def test_predict(request, pairs, which, points, steps, every):
    model = request.getfixturevalue(which)
    initial = np.resize(0.5 * pairs[0], (points, 4))

    def call():
        model.predict(initial, steps, every, outside="ignore")

    # Long before the shortest of them would end.
    assert interrupted_after(0.1, call) < 1.0


@pytest.mark.parametrize("method", ["inverse", "jacobian", "invariant"])
def test_functions_of_points(pairs, model, method):
    points = np.resize(0.5 * pairs[0], (4_000_000, 4))
    assert interrupted_after(0.4, lambda: getattr(model, method)(points)) < 1.0


@pytest.mark.parametrize("which", ["model", "normal_form"])
def test_verify(request, which):
    model = request.getfixturevalue(which)
    assert interrupted_after(0.3, lambda: model.verify(samples=1_000_000)) < 1.0
    # What comes after is whole.
    assert model.verify(samples=5).rows == model.verify(samples=5).rows
    assert all(row["samples"] == 5 for row in model.verify(samples=5).rows if row["law"] == "evaluation")


@pytest.fixture(scope="module")
def of_a_plane():
    """A model and a polynomial of a turn by an angle that falls with the radius."""
    before = np.random.default_rng(1).uniform(-0.9, 0.9, (300, 2))
    angle = 2.3 - 0.4 * (before**2).sum(axis=1, keepdims=True)
    after = before * np.cos(angle) + before[:, ::-1] * [1, -1] * np.sin(angle)
    model = gyroceptron.train(before, after, [1], kicks=(2, 2), twists=(1, 3), iterations=40, starts=1)
    return {"model": model, "polynomial": gyroceptron.SymplecticPolynomial(before, after, 6)}


INNER = np.random.default_rng(2).uniform(-0.5, 0.5, (2000, 2))
BOX = ([-9.0, -9.0], [9.0, 9.0])
OF_MAPS = {
    "survival": lambda m: m.survival(INNER, HUGE, *BOX),
    "lyapunov_exponent": lambda m: m.lyapunov_exponent([0.4, 0.1], HUGE),
    "alignment_index": lambda m: m.alignment_index([0.4, 0.1], HUGE),
    "periodic_orbits": lambda m: m.periodic_orbits(np.resize(INNER, (200_000, 2)), 97),
    "symmetric_orbits": lambda m: m.symmetric_orbits("positions", -0.5, 0.5, 97, samples=10**6),
}


@pytest.mark.parametrize("of", ["model", "polynomial"])
@pytest.mark.parametrize("what", OF_MAPS)
def test_orbits(of_a_plane, of, what):
    assert interrupted_after(0.2, lambda: OF_MAPS[what](of_a_plane[of])) < 1.0


def test_the_aperture(of_a_plane):
    model = of_a_plane["model"]
    directions, radii = [[1.0, 0.0], [0.0, 1.0]], list(np.linspace(0.01, 0.5, 50))
    call = lambda: model.dynamic_aperture([0.0, 0.0], directions, radii, HUGE, *BOX)  # noqa: E731
    assert interrupted_after(0.2, call) < 1.0


def test_the_certificate_of_a_polynomial(of_a_plane):
    assert interrupted_after(0.2, lambda: of_a_plane["polynomial"].verify(samples=50_000)) < 1.0


def test_many_samples_of_a_polynomial(of_a_plane):
    assert interrupted_after(0.3, lambda: of_a_plane["polynomial"].verify(samples=4_000_000)) < 1.0


def test_distances_from_a_circle(of_a_plane):
    phase = 0.7 * np.arange(3000)
    circle = gyroceptron.InvariantCircle(np.stack([np.cos(phase), np.sin(phase)], axis=1), 0.7 / (2 * np.pi))
    assert interrupted_after(0.3, lambda: circle.distances(np.resize(INNER, (4_000_000, 2)))) < 1.0


def test_proofs(of_a_plane, tmp_path):
    model, file = of_a_plane["model"], tmp_path / "proof.json"
    # What is computed of all points of a curve at once takes long without optimisation.
    assert interrupted_after(0.3, lambda: gyroceptron.prove(model, circles=1000, end=(0.8, 0.0), output=file)) < 3.0
    # What comes after is whole.
    assert gyroceptron.prove(model, circles=1, end=(0.8, 0.0), output=file, overwrite=True)["holds"]
    assert gyroceptron.check_proof(model, file)["circles"] == 1


def test_frequencies():
    phase = 0.3 * np.arange(10**6)
    signal = np.stack([np.cos(phase) + 0.1 * np.cos(2.3 * phase), np.sin(phase)], axis=1)
    assert interrupted_after(0.3, lambda: gyroceptron.spectral_lines(signal)) < 1.0
    assert interrupted_after(0.3, lambda: gyroceptron.InvariantCircle(signal[:300_000], 0.3 / (2 * np.pi))) < 1.5
    orbits = np.repeat(signal[:4096, None], 5000, axis=1)
    assert interrupted_after(0.3, lambda: gyroceptron.tunes(orbits)) < 1.0
    # In parts the tunes are those of each orbit alone.
    few = np.stack([signal[:512], 0.5 * signal[512:1024]], axis=1)
    alone = [gyroceptron.tunes(few[:, k]) for k in range(2)]
    for k, found in enumerate(gyroceptron.tunes(few)):
        assert np.array_equal(found, np.stack([one[k] for one in alone]))


def test_lines_of_force():
    lines = gyroceptron.FieldLines()
    assert interrupted_after(0.2, lambda: lines.trace(lines.starts(64), 10**6)) < 1.0
    assert interrupted_after(0.2, lambda: lines.lyapunov_exponent(lines.starts(1)[0], HUGE)) < 1.0


def test_train(pairs):
    assert interrupted_after(0.5, lambda: gyroceptron.train(*pairs, [1, 0], recipe="paper", iterations=10**6)) < 1.0


def test_pairs_are_made_ready(pairs):
    many = [np.resize(points, (200_000, 4)) for points in pairs]
    # The signal comes while they are looked at, before the first iteration.
    train = lambda: gyroceptron.train(*many, [1, 0], starts=1)  # noqa: E731
    assert interrupted_after(0.3, train) < 1.0


SCENE = """
name = "long"
seed = 3
flow_time = 50.0
[system]
kind = "oscillators"
epsilon = 0.01
[data]
validation = 0.0
windows = [{ low = [-1.6, -1.6, -1.6, -1.6], high = [1.6, 1.6, 1.6, 1.6], samples = 200000 }]
[training]
iterations = 1
[[models]]
name = "gyroceptron"
network = { kind = "gyroceptron", psi = { count = 3, width = 4 }, near_identity = { count = 3, width = 4 } }
"""


def test_flows_of_a_scene(tmp_path):
    """Before there is an iteration, with a checkpoint."""
    path = tmp_path / "long.toml"
    path.write_text(SCENE)
    assert interrupted_after(1.0, lambda: gyroceptron.run(path, tmp_path / "out")) < 1.0


def test_an_estimate():
    assert interrupted_after(0.5, lambda: gyroceptron.plan("long-steps")) < 1.0


def test_the_search_for_a_circle_action(pairs):
    """Short trainings, before the one that was asked for."""
    assert interrupted_after(0.3, lambda: gyroceptron.train(*pairs, starts=1, iterations=1)) < 1.0


def test_the_bits_are_those_of_single_steps(pairs, model):
    """Whatever parts a roll-out is made in."""
    z = 0.3 * pairs[0][:2]
    states = model.predict(z, 5000, 2500, outside="ignore")
    for _ in range(5000):
        z = model.predict(z, outside="ignore")[1]
    assert np.array_equal(states[-1], z)
    alone = model.predict(0.3 * pairs[0][0], 5000, 5000, outside="ignore")
    assert np.array_equal(alone[-1], states[-1][0])


def test_the_error_of_a_polynomial(of_a_plane):
    before = np.resize(INNER, (6_000_000, 2))
    assert interrupted_after(0.3, lambda: of_a_plane["polynomial"].error(before, before)) < 1.0


def test_a_polynomial_is_fitted():
    """Most of the time passes in one decomposition of a matrix, which nobody waits for: so it is the last test."""
    before = np.random.default_rng(3).uniform(-0.5, 0.5, (20_000, 4))
    after = np.concatenate([before[:, 2:], -before[:, :2] + 0.1 * np.sin(before[:, 2:])], axis=1)
    assert interrupted_after(0.3, lambda: gyroceptron.SymplecticPolynomial(before, after, 6)) < 1.0
