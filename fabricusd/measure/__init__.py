"""Measurement: photographs of a thread in, its scattering out.

simulate     a gantry that photographs a thread whose scattering is known
measure      a folder of photographs -> lobes, one value of f_s per view
fit_thread   lobes -> the thread that scatters like them, with intervals
"""

from fabricusd.measure.capture.pipeline import Measurement, measure
from fabricusd.measure.fit.fit import fit_thread
from fabricusd.measure.fit.result import Fitted
from fabricusd.measure.gantry.design import DESIGNS
from fabricusd.measure.gantry.simulate import simulate
from fabricusd.measure.lobes import Lobes, read_lobes, write_lobes

__all__ = [
    "DESIGNS",
    "Fitted",
    "Lobes",
    "Measurement",
    "fit_thread",
    "measure",
    "read_lobes",
    "simulate",
    "write_lobes",
]
