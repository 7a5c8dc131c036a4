"""What the scripts that compare maps of machines share: an environment, a clock, a table."""

import os
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def enter(folder, packages):
    """Goes on, on one thread, in the virtual environment of a folder, which has these packages and this one."""
    python = folder / "venv" / "bin" / "python"
    if pathlib.Path(sys.prefix) == folder / "venv":
        return
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
    for what in (packages, ["--no-deps", "--force-reinstall", str(ROOT)]):
        if subprocess.run([python, "-m", "pip", "install", "--quiet", *what], check=False).returncode != 0:
            print(f"{', '.join(what)} could not be installed: nothing is compared", file=sys.stderr)
            sys.exit(2)
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"}
    os.execve(python, [python, *sys.argv], os.environ | threads)


def seconds(work):
    """What `work` returns, and how long it takes."""
    start = time.perf_counter()
    out = work()
    return out, time.perf_counter() - start


def table(head, rows):
    """Prints a table in Markdown."""
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)
