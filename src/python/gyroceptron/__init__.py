"""Symplectic gyroceptrons: nearly-periodic symplectic maps that are trained on pairs.

Points are rows of 2n numbers, q1 ... qn, p1 ... pn. All numbers are float64; results
have the bits that the program ``gyroceptron`` gives.
"""

from ._native import (
    Certificate,
    Error,
    FieldLines,
    InvariantCircle,
    Model,
    SymplecticPolynomial,
    __version__,
    check_proof,
    load,
    prove,
    rotation_number,
    spectral_lines,
    train,
    tunes,
)
from ._progress import ProgressBar
from ._runs import Report, merge, plan, run, run_job

__all__ = [
    "Certificate",
    "Error",
    "FieldLines",
    "InvariantCircle",
    "Model",
    "ProgressBar",
    "Report",
    "SymplecticPolynomial",
    "__version__",
    "check_proof",
    "load",
    "merge",
    "plan",
    "prove",
    "rotation_number",
    "run",
    "run_job",
    "spectral_lines",
    "train",
    "tunes",
]
