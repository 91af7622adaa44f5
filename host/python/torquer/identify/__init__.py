"""Values of a scene fitted to measured forces, tips and shapes, and their derivatives (torquer-identify)."""

from . import measured, report
from .experiment import Experiment
from .fit import Identification, identify

__all__ = ["Experiment", "Identification", "identify", "measured", "report"]
