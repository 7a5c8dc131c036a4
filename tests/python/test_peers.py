"""The scripts that compare with other programs, where those cannot be had."""

import os
import pathlib
import subprocess
import sys

import pytest

PEERS = pathlib.Path(__file__).resolve().parent.parent.parent / "benches" / "peers"


pytest.importorskip("ensurepip", reason="the scripts make virtual environments")


def test_without_the_packages_of_the_rivals_nothing_is_compared(tmp_path):
    code = f"import pathlib, shared; shared.enter(pathlib.Path({str(tmp_path)!r}), ['a-package-that-nobody-has'])"
    environment = os.environ | {"PIP_NO_INDEX": "1", "PYTHONPATH": str(PEERS)}
    command = [sys.executable, "-c", code + "; print('compared')"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 2
    assert "a-package-that-nobody-has could not be installed" in run.stderr
    assert "compared" not in run.stdout
