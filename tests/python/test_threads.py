"""Calls from several threads of Python, with its global lock and without one."""

import sys
import sysconfig
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import gyroceptron


def test_threads_get_what_a_single_one_gets(model, pairs):
    points = pairs[0][:64]

    def calls(k):
        some = points[8 * (k % 8) :][:8]
        return (
            model.predict(some, 200, outside="ignore"),
            model.inverse(some),
            model.jacobian(some),
            model.verify(samples=4, seed=k).rows,
            gyroceptron.train(*pairs, [1, 0], recipe="paper", epsilon=0.05, iterations=3, seed=k).parameters,
        )

    alone = [calls(k) for k in range(4)]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(calls, range(4)))
    for one, other in zip(alone, together, strict=True):
        for a, b in zip(one, other, strict=True):
            assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b


def test_calls_of_two_threads_go_on_at_the_same_time(model, pairs):
    ticks, over = [], threading.Event()

    def tick():
        while not over.wait(1e-3):
            ticks.append(None)

    other = threading.Thread(target=tick)
    other.start()
    before = len(ticks)
    model.predict(pairs[0][:64], 20_000, 20_000, outside="ignore")
    during = len(ticks) - before
    over.set()
    other.join()
    assert during > 20, during


def test_the_module_leaves_the_global_lock_off():
    """A module that was not made for it would have turned it on, with a warning."""
    if sysconfig.get_config_var("Py_GIL_DISABLED"):
        assert not sys._is_gil_enabled()
