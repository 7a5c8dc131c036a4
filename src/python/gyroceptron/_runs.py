"""Scenes: a run in this process or on the workers of Dask, and its jobs for other engines."""

import html
import json
import math
import os
import pathlib
import time
import uuid
import warnings

from . import _native
from ._native import Error


class Report:
    """The report of a run, from its folder; ``data`` is its ``report.json``."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.data = json.loads((self.path / "report.json").read_text(encoding="utf-8"))

    @property
    def holds(self):
        """Whether no verdict of the run says that something does not hold."""
        return self.data["holds"]

    def __repr__(self):
        verdict = "holds" if self.holds else "A CHECK DOES NOT HOLD"
        return f"<gyroceptron.Report of {self.data['scene']['name']} in {self.path}: {verdict}>"

    def _repr_html_(self):
        page = (self.path / "report.html").read_text(encoding="utf-8")
        frame = f'<iframe srcdoc="{html.escape(page)}" style="width: 100%; height: 40em; border: 0"'
        return f'{frame} title="Report"></iframe>'


def _read(scene, seed=None, quick=False, weights=None):
    name, text, lacking = _native._scene(os.fspath(scene), seed, quick, weights)
    for part in lacking:
        warnings.warn(f"part {part} is left out: it needs weights=FILE", stacklevel=3)
    return name, text


def _folder(out, name):
    # Workers may be in other folders.
    return os.path.abspath(pathlib.Path("gyroceptron-out") / name if out is None else out)


def plan(scene, *, seed=None, quick=False, weights=None, estimate=True):
    """The jobs of a scene (data sets, trainings, the report) as dictionaries, each after those that it needs.

    The keys are those of the lines of ``gyroceptron run SCENE --plan``, but for the command. With ``estimate`` each
    job has an estimate of its seconds on this machine, for which each kind of network is trained for a moment.
    """
    _, text = _read(scene, seed, quick, weights)
    return json.loads(_native._plan(text, estimate))


def run_job(
    scene,
    job,
    out=None,
    *,
    seed=None,
    quick=False,
    weights=None,
    digest=None,
    overwrite=False,
    threads=None,
    callback=None,
):
    """Does a job of the plan, by its ``id``, in a folder of its own below ``out``.

    Returns "done", "was done before" if nothing was left to do, or "interrupted" when the callback returned
    False. A job that was interrupted or killed goes on from its checkpoint.
    """
    name, text = _read(scene, seed, quick, weights)
    return _native._run_job(text, job, digest, _folder(out, name), overwrite, threads, callback)


def merge(
    scene,
    out=None,
    *,
    seed=None,
    quick=False,
    weights=None,
    digest=None,
    overwrite=False,
    threads=None,
    callback=None,
):
    """Makes the report of all jobs below ``out``, with the same bytes as a run in one process.

    Jobs that are missing, or are of another scene, seed or version, are an error that names them. Returns None
    when the callback returned False.
    """
    name, text = _read(scene, seed, quick, weights)
    return _merged(text, digest, _folder(out, name), overwrite, threads, callback)


def _merged(text, digest, out, overwrite, threads, callback):
    return Report(out) if _native._merge(text, digest, out, overwrite, threads, callback) else None


def run(
    scene="quickstart",
    out=None,
    *,
    seed=None,
    quick=False,
    weights=None,
    resume=False,
    overwrite=False,
    threads=None,
    callback=None,
    client=None,
):
    """Runs a scene, given by its name or as a .toml file, into a folder; returns its report.

    With a ``client`` of Dask distributed, its workers make the data and train the networks, a job each,
    and this process makes the report, with the same bytes as without a client. The folder must be at the same place
    for all of them. A job whose worker dies is taken over by another one, which goes on from its checkpoint, as often
    as Dask allows it (three times); a second call does not repeat what is done. Each job has one thread, unless
    ``threads`` are given.

    ``callback(name, iteration, loss, validation)`` is called after each iteration of a training, and with None for
    the last three when a stage begins or a job is done. When it returns False, the run stops and returns None. A
    later call goes on, with ``resume=True``, or by itself with a client.
    """
    name, text = _read(scene, seed, quick, weights)
    out = _folder(out, name)
    if client is None:
        there = _native._run(text, out, resume, overwrite, threads, callback)
        return Report(out) if there else None
    if resume:
        raise Error("resume: expected False with a client, whose jobs go on by themselves, found True")
    if not callable(getattr(client, "scheduler_info", None)):
        raise Error(f"client: expected a distributed.Client, found {client!r}")
    if not client.scheduler_info(n_workers=-1)["workers"]:
        raise Error("client: expected one with workers, found none")
    _native._check_merge(text, out, overwrite)
    if not _on_workers(client, text, out, overwrite, threads, callback):
        return None
    return _merged(text, None, out, overwrite, None, callback)


def _goes_on(callback, words):
    """As of the callback of a run in this process: what is neither None nor true ends it."""
    answer = None if callback is None else callback(words, None, None, None)
    return answer is None or bool(answer)


def _job_of_worker(text, job, out, overwrite, threads, end, _needs):
    looked = -math.inf

    def go_on(*_):
        nonlocal looked
        if time.monotonic() - looked < 0.2:
            return True
        looked = time.monotonic()
        return not os.path.exists(end)

    return _native._run_job(text, job["id"], job["digest"], out, overwrite, threads, go_on)


def _on_workers(client, text, out, overwrite, threads, callback):
    """Does all jobs but the report on the workers of a client; whether the callback let it."""
    from distributed import as_completed, wait

    # In the keys, so that a job whose folder was removed is not taken for one that is done.
    call, futures = uuid.uuid4().hex[:8], {}
    # A thread of a worker cannot be stopped from here: jobs end when this file is there.
    end = os.path.join(out, f"end-{call}")
    for job in json.loads(_native._plan(text, False)):
        if job["kind"] == "merge":
            continue
        futures[job["id"]] = client.submit(
            _job_of_worker,
            text,
            job,
            out,
            overwrite,
            # A worker has a thread for each of the jobs that it does at the same time.
            1 if threads is None else threads,
            end,
            [futures[need] for need in job["needs"]],
            key=f"{job['id']}-{job['digest'][:8]}-{call}",
            pure=False,
        )
    names = {future.key: name for name, future in futures.items()}
    done = False
    try:
        for future in as_completed(list(futures.values()), loop=client.loop):
            future.result()
            if not _goes_on(callback, f"job {names[future.key]} is done"):
                break
        else:
            done = True
    finally:
        if not done:
            under_way = [future for future in futures.values() if future.status == "pending"]
            os.makedirs(out, exist_ok=True)
            pathlib.Path(end).touch()
            try:
                wait(under_way, timeout=10)
            except Exception:
                # They end after an iteration, some time.
                client.cancel(under_way)
            else:
                os.remove(end)
    return done
