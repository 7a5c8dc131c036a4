#!/usr/bin/env python3
"""The same work here and in JAX, alternately, and the table of their times.

    python3 benches/peers/compare.py [--rounds N] [WORKLOAD ...]
    python3 benches/peers/compare.py --accuracy    errors of JAX's tanh and 1 - tanh^2

Makes a virtual environment of its own in target/peers (JAX from PyPI), builds the
Rust side, lets it write parameters, points and results, and checks that both do
the same work. Then each variant of JAX runs a few times, and the fastest runs
alternately with the Rust side. Figures are medians with the smallest and largest.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
FOLDER = ROOT / "target" / "peers"
JAX = "jax[cpu]==0.10.2"
PACKAGES = ["numpy", "scipy", "mpmath"]


def environment():
    """Goes on in the virtual environment, making it when there is none."""
    python = FOLDER / "venv" / "bin" / "python"
    made = FOLDER / "venv" / " ".join([JAX, *PACKAGES])
    if not made.exists():
        subprocess.run([sys.executable, "-m", "venv", FOLDER / "venv"], check=True)
        installed = subprocess.run([python, "-m", "pip", "install", "--quiet", JAX, *PACKAGES], check=False)
        if installed.returncode != 0:
            print(f"{JAX}, {', '.join(PACKAGES)} could not be installed: nothing is compared", file=sys.stderr)
            sys.exit(2)
        made.touch()
    if pathlib.Path(sys.prefix) != FOLDER / "venv":
        os.execv(python, [python, *sys.argv])


class Process:
    """Asks a line, gets a line."""

    def __init__(self, command, **options):
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options
        )

    def ask(self, line):
        # Threads of the other process that wait for work keep a core busy for a while.
        time.sleep(0.2)
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit("a process ended: see its message above")
        return json.loads(answer)


def jax_worker(name, dtype):
    """A process of its own: devices and threads are fixed when JAX starts."""
    import jax_side

    workload = jax_side.Workload(FOLDER / "data", name, dtype)
    variants = {}
    for label, build, arguments in jax_side.VARIANTS[workload.meta["kind"]](workload):
        variants[label] = (build(), arguments)
    block = lambda out: [leaf.block_until_ready() for leaf in out] if isinstance(out, tuple) else out.block_until_ready()
    for line in sys.stdin:
        request = line.strip()
        if request == "variants":
            print(json.dumps(list(variants)), flush=True)
            continue
        verb, label = request.split(" ", 1)
        run, arguments = variants[label]
        start = time.perf_counter()
        out = run(*arguments)
        block(out)
        seconds = time.perf_counter() - start
        print(json.dumps(jax_side.agrees(workload, out) if verb == "check" else seconds), flush=True)


def best_variant(worker, tolerance):
    """The fastest of three runs each, after one that compiles and is checked."""
    best = (float("inf"), None)
    for label in worker.ask("variants"):
        error = worker.ask(f"check {label}")
        if not error < tolerance:
            sys.exit(f"{label}: another result, {error:e}")
        seconds = min(worker.ask(f"run {label}") for _ in range(3))
        best = min(best, (seconds, label))
    return best[1]


def start_jax(name, dtype, threads):
    environment = dict(os.environ)
    command = [sys.executable, __file__, "--worker", name, dtype]
    if threads == 1:
        command = ["taskset", "-c", "0", *command]
    else:
        environment["XLA_FLAGS"] = f"--xla_force_host_platform_device_count={threads}"
    return Process(command, env=environment)


def accuracy():
    """Against 200 bits, where the neurons of a trained network are, and further out."""
    import jax
    import jax.numpy as jnp
    import mpmath
    import numpy

    jax.config.update("jax_enable_x64", True)
    mpmath.mp.prec = 200
    random = numpy.random.default_rng(1)
    for low, high in ((0, 4), (4, 17)):
        x = random.uniform(low, high, 3000)
        computed = zip(x, *map(numpy.asarray, jax.jit(lambda x: (jnp.tanh(x), 1 - jnp.tanh(x) ** 2))(x)))
        ulps, relative = 0.0, 0.0
        for a, t, s in computed:
            a = mpmath.mpf(float(a))
            tanh, sech2 = mpmath.tanh(a), 1 / mpmath.cosh(a) ** 2
            ulps = max(ulps, abs(float(mpmath.mpf(float(t)) - tanh)) / numpy.spacing(float(tanh)))
            relative = max(relative, abs(float((mpmath.mpf(float(s)) - sech2) / sech2)))
        print(f"|x| in {low} ... {high}: tanh {ulps:.2f} ulp, 1 - tanh^2 {relative:.1e} relative")
    return 0


def figure(samples):
    unit, factor = ("ms", 1e3) if statistics.median(samples) < 1 else ("s", 1)
    middle, low, high = (f(samples) * factor for f in (statistics.median, min, max))
    return f"{middle:.3g} {unit} ({low:.3g} … {high:.3g})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--accuracy", action="store_true")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("workloads", nargs="*")
    options = parser.parse_args()
    if options.worker:
        return jax_worker(*options.worker)
    if options.accuracy:
        return accuracy()

    bench = ["cargo", "bench", "--quiet", "--bench", "peers", "--"]
    subprocess.run([*bench, "prepare", FOLDER / "data"], check=True, cwd=ROOT)
    ours = Process([*bench, "serve"], cwd=ROOT)
    data = FOLDER / "data"
    names = options.workloads or sorted(p.parent.name for p in data.glob("*/meta.json"))
    print("| work | here, f64 | JAX f64 | ratio | JAX f32 | ratio | variants of JAX |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for name in names:
        threads = json.loads((data / name / "meta.json").read_text())["threads"]
        cells, labels = [], []
        for dtype, tolerance in (("float64", 1e-9), ("float32", 1e-1)):
            jax = start_jax(name, dtype, threads)
            label = best_variant(jax, tolerance)
            here, other = [], []
            for _ in range(options.rounds):
                here.append(ours.ask(name))
                other.append(jax.ask(f"run {label}"))
            jax.process.stdin.close()
            jax.process.wait()
            if dtype == "float64":
                cells.append(figure(here))
            ratios = [b / a for a, b in zip(here, other)]
            cells += [figure(other), f"{statistics.median(ratios):.2f} ×"]
            labels.append(label)
        print(f"| {name} | {' | '.join(cells)} | {'; '.join(labels)} |", flush=True)
    return 0


if __name__ == "__main__":
    environment()
    sys.exit(main())
