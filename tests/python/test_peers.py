"""The scripts that compare with other programs, where those cannot be had."""

import os
import pathlib
import subprocess
import sys

import pytest

PEERS = pathlib.Path(__file__).resolve().parent.parent.parent / "benches" / "peers"


pytest.importorskip("ensurepip", reason="the scripts make virtual environments")


NONE = "a-package-that-nobody-has"


# The second is that of the learned rivals.
@pytest.mark.parametrize(
    "code",
    [
        "import pathlib, shared; shared.enter(pathlib.Path({folder!r}), [{none!r}])",
        "import pathlib, compare; compare.FOLDER, compare.JAX = pathlib.Path({folder!r}), {none!r}; "
        "compare.environment()",
    ],
)
def test_without_the_packages_of_the_rivals_nothing_is_compared(tmp_path, code):
    code = code.format(folder=str(tmp_path), none=NONE)
    environment = os.environ | {"PIP_NO_INDEX": "1", "PYTHONPATH": str(PEERS)}
    command = [sys.executable, "-c", code + "; print('compared')"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 2
    assert NONE in run.stderr and "could not be installed: nothing is compared" in run.stderr
    assert "compared" not in run.stdout
