"""Scenes: runs here and in pieces, on workers of Dask, with workers that die."""

import json
import os
import pathlib
import signal
import sys
import threading
import time

import pytest

import gyroceptron

SCENE = """
name = "small"
seed = 3
flow_time = 0.5
plots = ["loss"]
[system]
kind = "oscillators"
epsilon = 0.01
[data]
validation = 0.5
windows = [{ low = [-1.6, -1.6, -1.6, -1.6], high = [1.6, 1.6, 1.6, 1.6], samples = 400 }]
[training]
iterations = ITERATIONS
checkpoint_every = 10
[rollout]
steps = 100
every = 10
initial = [[1.5, 0.15, 0.0, 0.0], [1.5, 1.0, 0.0, 0.0]]
[[models]]
name = "gyroceptron"
seeds = 3
network = { kind = "gyroceptron", psi = { count = 3, width = 4 }, near_identity = { count = 3, width = 4 } }
weights = { kind = "normal", scale = 0.15 }
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SCENE.replace("ITERATIONS", "60"))
    return path


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """Scenes of so many iterations with the bytes of their reports."""
    made = {}

    def of(iterations):
        if iterations not in made:
            folder = tmp_path_factory.mktemp("whole")
            path = folder / "small.toml"
            path.write_text(SCENE.replace("ITERATIONS", str(iterations)))
            gyroceptron.run(path, folder / "out")
            made[iterations] = path, (folder / "out" / "report.json").read_bytes()
        return made[iterations]

    return of


def test_a_run_gives_its_report(scene, tmp_path, program):
    told = []
    report = gyroceptron.run(scene, tmp_path / "out", callback=lambda *words: told.append(words))
    assert report.holds is True
    assert report.data["scene"]["name"] == "small"
    assert "holds" in repr(report) and "small" in repr(report)
    page = report._repr_html_()
    assert page.startswith("<iframe srcdoc=") and page.count("<iframe") == 1 and "&lt;html" in page
    names = [name for name, *numbers in told if numbers == [None] * 3]
    assert "training gyroceptron-seed-2" in names and names[-1] == "report"
    iterations = [words[1] for words in told if words[0] == "gyroceptron"]
    assert iterations == list(range(1, 61))
    program("run", scene, "--out", tmp_path / "program")
    assert (tmp_path / "program/report.json").read_bytes() == (tmp_path / "out/report.json").read_bytes()
    with pytest.raises(gyroceptron.Error, match="holds an earlier run"):
        gyroceptron.run(scene, tmp_path / "out")
    other = gyroceptron.run(scene, tmp_path / "out", seed=4, overwrite=True, threads=1)
    assert other.data["scene"]["seed"] == 4
    quick = gyroceptron.run(scene, tmp_path / "quick", quick=True)
    assert quick.data["scene"]["training"]["iterations"] == 20


def test_a_run_that_is_stopped_goes_on(scene, tmp_path, whole):
    def stop(name, iteration, loss, validation):
        return not (name == "gyroceptron-seed-2" and iteration == 30)

    assert gyroceptron.run(scene, tmp_path / "out", callback=stop) is None
    assert not (tmp_path / "out/report.json").exists()
    gyroceptron.run(scene, tmp_path / "out", resume=True)
    assert (tmp_path / "out/report.json").read_bytes() == whole(60)[1]

    def fails(*_):
        raise LookupError("mine")

    with pytest.raises(LookupError, match="mine"):
        gyroceptron.run(scene, tmp_path / "other", callback=fails)


def test_ctrl_c_ends_a_run(tmp_path):
    path = tmp_path / "long.toml"
    path.write_text(SCENE.replace("ITERATIONS", "1000000"))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    checkpoint = tmp_path / "out/checkpoint-gyroceptron"

    def send():
        while not checkpoint.exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            gyroceptron.run(path, tmp_path / "out")
    finally:
        thread.join()
        signal.signal(signal.SIGINT, before)


def test_jobs_of_a_plan(scene, tmp_path, whole, program):
    jobs = gyroceptron.plan(scene)
    assert [job["id"] for job in jobs] == [
        "data",
        "train-gyroceptron",
        "train-gyroceptron-seed-2",
        "train-gyroceptron-seed-3",
        "merge",
    ]
    lines = program("run", scene, "--plan").stdout.splitlines()
    for line, job in zip(map(json.loads, lines), jobs, strict=True):
        assert {key: line[key] for key in job if key != "seconds"} == {k: v for k, v in job.items() if k != "seconds"}
    assert all(job["seconds"] > 0 for job in jobs[:-1])
    assert all(job["seconds"] is None for job in gyroceptron.plan(scene, estimate=False))
    out = tmp_path / "out"
    with pytest.raises(gyroceptron.Error, match="data not begun, train-gyroceptron not begun"):
        gyroceptron.merge(scene, out)
    for job in jobs[:-1]:
        assert gyroceptron.run_job(scene, job["id"], out, digest=job["digest"], threads=1) == "done"
    assert gyroceptron.run_job(scene, "data", out) == "was done before"
    with pytest.raises(gyroceptron.Error, match="another scene, version or file"):
        gyroceptron.run_job(scene, "data", out, digest="0")
    assert gyroceptron.merge(scene, out).holds
    assert (out / "report.json").read_bytes() == whole(60)[1]


distributed = pytest.importorskip("distributed", reason="no Dask distributed")


def workers_of(count, **options):
    """A scheduler and processes that work for it, on this machine."""
    return distributed.LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=50,
        **options,
    )


@pytest.mark.parametrize("count", [1, 2, 3])
def test_any_number_of_workers_gives_the_same_bytes(count, tmp_path, whole):
    scene, expected = whole(60)
    with workers_of(count) as cluster, distributed.Client(cluster) as client:
        told = []
        report = gyroceptron.run(scene, tmp_path / "out", client=client, callback=lambda *w: told.append(w[0]))
        assert report.holds
        assert (tmp_path / "out/report.json").read_bytes() == expected
        assert {f"job train-gyroceptron{s} is done" for s in ("", "-seed-2", "-seed-3")} <= set(told)
        # Of what is done nothing is done again.
        stamp = (tmp_path / "out/report.json").stat().st_mtime_ns
        gyroceptron.run(scene, tmp_path / "out", client=client)
        assert (tmp_path / "out/report.json").stat().st_mtime_ns == stamp


def test_a_worker_of_other_instructions(tmp_path, whole):
    scene, expected = whole(60)
    with workers_of(1, env={"GYROCEPTRON_SIMD": "portable"}) as cluster, distributed.Client(cluster) as client:
        gyroceptron.run(scene, tmp_path / "out", client=client)
    assert (tmp_path / "out/report.json").read_bytes() == expected
    timings = json.loads((tmp_path / "out/jobs/train-gyroceptron/timings.json").read_text())
    assert timings["machine"]["instructions"] == "portable instructions"
    assert timings["machine"]["threads"] == 1


def test_a_worker_that_is_killed(tmp_path, whole):
    scene, expected = whole(1500)
    out = tmp_path / "out"
    with workers_of(2) as cluster, distributed.Client(cluster) as client:
        at_work, killed = out / "jobs/train-gyroceptron/checkpoint-gyroceptron", []

        def kill():
            while not at_work.exists():
                time.sleep(0.002)
            for address, pid in client.run(os.getpid).items():
                if any("train-gyroceptron-" in str(key) for key in client.processing()[address]):
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)
                    return

        thread = threading.Thread(target=kill)
        thread.start()
        gyroceptron.run(scene, out, client=client)
        thread.join()
    assert killed, "no worker was at work"
    assert (out / "report.json").read_bytes() == expected


def test_two_clients_on_one_folder(tmp_path, whole):
    scene, expected = whole(60)
    out, failed = tmp_path / "out", []
    with workers_of(2) as cluster:

        def go():
            try:
                with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
                    gyroceptron.run(scene, out, client=client)
            except BaseException as error:
                failed.append(error)

        both = [threading.Thread(target=go) for _ in range(2)]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()
    assert not failed, failed
    assert (out / "report.json").read_bytes() == expected


def test_jobs_that_fail_say_why(scene, tmp_path):
    with workers_of(1) as cluster, distributed.Client(cluster) as client:
        with pytest.raises(gyroceptron.Error, match="resume"):
            gyroceptron.run(scene, tmp_path / "out", client=client, resume=True)
        gyroceptron.run(scene, tmp_path / "out", client=client)
        # Before anything is trained.
        with pytest.raises(gyroceptron.Error, match="holds an earlier run"):
            gyroceptron.run(scene, tmp_path / "out", client=client, seed=9)
        assert (tmp_path / "out/jobs/data/job.json").exists()
        other = gyroceptron.run(scene, tmp_path / "out", client=client, seed=9, overwrite=True)
        assert other.data["scene"]["seed"] == 9
        bad = tmp_path / "bad.toml"
        bad.write_text(SCENE.replace("ITERATIONS", "10").replace("1.6, 1.6, 1.6, 1.6", "1e300, 1.6, 1.6, 1.6"))
        with pytest.raises(gyroceptron.Error):
            gyroceptron.run(bad, tmp_path / "bad", client=client)
        stop = gyroceptron.run(scene, tmp_path / "stop", client=client, callback=lambda *_: False)
        assert stop is None and not (tmp_path / "stop/report.json").exists()
        assert gyroceptron.run(scene, tmp_path / "stop", client=client).holds


def test_a_client_without_workers(scene, tmp_path):
    with workers_of(0) as cluster, distributed.Client(cluster) as client:
        with pytest.raises(gyroceptron.Error, match="client: expected one with workers, found none"):
            gyroceptron.run(scene, tmp_path / "out", client=client)
    assert not (tmp_path / "out").exists()
