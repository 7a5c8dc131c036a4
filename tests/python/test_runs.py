"""Scenes: runs here and in pieces, on workers of Dask, with workers that die."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
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
    said = []
    report = gyroceptron.run(scene, tmp_path / "out", callback=lambda *words: said.append(words))
    assert report.holds is True
    assert report.data["scene"]["name"] == "small"
    assert "holds" in repr(report) and "small" in repr(report)
    page = report._repr_html_()
    assert page.startswith("<iframe srcdoc=") and page.count("<iframe") == 1 and "&lt;html" in page
    names = [name for name, *numbers in said if numbers == [None] * 3]
    assert "training gyroceptron-seed-2" in names and names[-1] == "report"
    iterations = [words[1] for words in said if words[0] == "gyroceptron"]
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
    with pytest.raises(gyroceptron.Error, match=r"data \(not begun\), train-gyroceptron \(not begun\)"):
        gyroceptron.merge(scene, out)
    for job in jobs[:-1]:
        assert gyroceptron.run_job(scene, job["id"], out, digest=job["digest"], threads=1) == "done"
    assert gyroceptron.run_job(scene, "data", out) == "was done before"
    with pytest.raises(gyroceptron.Error, match="scene, version or a file is another"):
        gyroceptron.run_job(scene, "data", out, digest="0")
    with pytest.raises(gyroceptron.Error, match="job merge"):
        gyroceptron.merge(scene, out, digest="0")
    with pytest.raises(gyroceptron.Error, match="seed: expected from 0"):
        gyroceptron.plan(scene, seed=-1)
    assert gyroceptron.merge(scene, out, digest=jobs[-1]["digest"]).holds
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
        said = []
        report = gyroceptron.run(scene, tmp_path / "out", client=client, callback=lambda *w: said.append(w[0]))
        assert report.holds
        assert (tmp_path / "out/report.json").read_bytes() == expected
        assert {f"job train-gyroceptron{s} is done" for s in ("", "-seed-2", "-seed-3")} <= set(said)
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
        at_work, killed = out / "jobs/train-gyroceptron/checkpoint", []

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
        with pytest.raises(gyroceptron.Error, match="client: expected a distributed.Client, found 'x'"):
            gyroceptron.run(scene, tmp_path / "x", client="x")


def test_workers_end_with_a_run_that_is_stopped(tmp_path):
    path, out = tmp_path / "long.toml", tmp_path / "out"
    path.write_text(SCENE.replace("ITERATIONS", "1000000"))
    found = []

    def stop(name, *_):
        if name == "job data is done":
            # Of any of the trainings: the worker does one at a time.
            while not found:
                time.sleep(0.01)
                found.extend(out.glob("jobs/train-*/checkpoint"))
            # As a comparison of NumPy answers.
            return np.False_

    with workers_of(1) as cluster, distributed.Client(cluster) as client:
        assert gyroceptron.run(path, out, client=client, callback=stop) is None
        before = found[0].stat().st_mtime_ns
        time.sleep(0.5)
        assert found[0].stat().st_mtime_ns == before
        assert sorted(entry.name for entry in out.iterdir()) == ["jobs"]


def test_a_client_without_workers(scene, tmp_path):
    with workers_of(0) as cluster, distributed.Client(cluster) as client:
        with pytest.raises(gyroceptron.Error, match="client: expected one with workers, found none"):
            gyroceptron.run(scene, tmp_path / "out", client=client)
    assert not (tmp_path / "out").exists()


CHAPTER = pathlib.Path(__file__).parents[2] / "src/guide/many_machines.md"


def recipe(words):
    """The block of the guide with these words."""
    blocks = re.findall(r"```\w+\n(.*?)```", CHAPTER.read_text(), re.DOTALL)
    [block] = [block for block in blocks if words in block]
    return block


def needs(*programs):
    for name in programs:
        if shutil.which(name) is None:
            pytest.skip(f"no program `{name}`")


@pytest.fixture
def shell(tmp_path, whole, program):
    """Runs a script in a folder with scene.toml; what it leaves in far is compared with a run without an engine."""
    scene, expected = whole(60)
    (tmp_path / "scene.toml").write_text(scene.read_text())

    def run(script, path=()):
        environment = {**os.environ, "PATH": os.pathsep.join([*map(str, path), os.environ["PATH"]])}
        done = subprocess.run(script, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return (tmp_path / "far/report.json").read_bytes() == expected

    return run


def write_plan(program, tmp_path):
    scene = tmp_path / "scene.toml"
    plan = program("run", scene, "--out", tmp_path / "far", "--plan").stdout
    (tmp_path / "plan.jsonl").write_text(plan)


def test_the_recipe_for_gnu_parallel(shell):
    needs("jq", "parallel")
    assert shell(["bash", "-e", "-c", recipe("parallel --halt")])


def test_the_recipe_for_slurm(shell, tmp_path):
    needs("jq")
    (tmp_path / "job.sh").write_text(recipe("SLURM_ARRAY_TASK_ID"))
    # Jobs are done when they are submitted, which is after those that they wait for.
    (tmp_path / "bin").mkdir()
    sbatch = tmp_path / "bin/sbatch"
    sbatch.write_text(
        """#!/bin/bash
set -e
echo "$@" >> calls
for word; do case $word in --array=*) range=${word#--array=};; esac; done
for SLURM_ARRAY_TASK_ID in $(seq ${range%-*} ${range#*-}); do
    export SLURM_ARRAY_TASK_ID
    bash "${@: -1}" >> log 2>&1
done
wc -l < calls
"""
    )
    sbatch.chmod(0o755)
    assert shell(["bash", "-e", "-c", recipe("sbatch --parsable")], [tmp_path / "bin"])
    calls = (tmp_path / "calls").read_text().splitlines()
    assert [re.search(r"--array=(\S+)", call)[1] for call in calls] == ["1-1", "2-4", "5-5"]
    assert ["afterok:1" in calls[1], "afterok:2" in calls[2], "afterok" in calls[0]] == [True, True, False]


def test_the_recipe_for_snakemake(shell, tmp_path, program):
    needs("snakemake")
    write_plan(program, tmp_path)
    (tmp_path / "Snakefile").write_text(recipe("rule all"))
    assert shell(["snakemake", "--cores", "2"])


def test_the_recipe_for_hyperqueue(shell, tmp_path, program):
    pytest.importorskip("hyperqueue", reason="no HyperQueue")
    write_plan(program, tmp_path)
    script = recipe("from hyperqueue import")
    assert script.count("client = Client()") == 1
    script = script.replace("Client, Job", "LocalCluster, Job").replace("Client()", "CLUSTER.client()")
    script = script.replace("\nplan,", "\nCLUSTER = LocalCluster()\nCLUSTER.start_worker()\nplan,")
    assert shell([sys.executable, "-c", script + "\nCLUSTER.stop()\n"])


def test_the_example_for_dask(tmp_path):
    (tmp_path / "example.py").write_text(recipe("LocalCluster(n_workers=2"))
    done = subprocess.run([sys.executable, "example.py"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "gyroceptron.Report of quickstart" in done.stdout and "holds" in done.stdout
    # With the options of the program that are given to it.
    scene = json.loads((tmp_path / "far/report.json").read_text())["scene"]
    assert scene["name"] == "quickstart" and (tmp_path / "far/jobs/merge/job.json").exists()
