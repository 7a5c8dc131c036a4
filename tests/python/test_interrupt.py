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


def test_train(pairs):
    assert interrupted_after(0.5, lambda: gyroceptron.train(*pairs, [1, 0], recipe="paper", iterations=10**6)) < 1.0


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
