"""Exceptions of Palpate. Each message is one line: what is wrong, where, and what to do."""

from __future__ import annotations

from collections.abc import Sequence


class Error(Exception):
    """Base of everything Palpate raises for a user's mistake or a broken input."""


class MeshError(Error):
    """A mesh or surface that cannot be used."""


class BodyError(Error):
    """A body, boundary condition or touch that makes no sense."""


class StoreError(Error):
    """A precomputed file that is damaged or belongs to another body."""


class PrecisionError(Error):
    """An answer that the numbers of a store do not carry, by its own estimate of its error."""


class SceneError(Error):
    """A scene file with a mistake in it, or something asked of a scene that it does not have or cannot take."""


class SimulationError(Error):
    """A simulation that cannot go on: its loop does not run, or a fault has latched."""


class FitError(Error):
    """Measurements that cannot be read, or that the material of a scene cannot be fitted to."""


class UnitError(Error):
    """An unknown unit, or a quantity that cannot be read."""


class UnclearUnitError(UnitError):
    """A file without a unit of length whose body would be of no likely size in metres.

    Attributes
    ----------
    fitting
        Units in which it would be, most common first.

    """

    def __init__(self, message: str, fitting: Sequence[str] = ()):
        super().__init__(message)
        self.fitting = tuple(fitting)


class ViewerError(Error):
    """The browser viewer cannot be served, or was asked for something it cannot do."""


class DeviceError(Error):
    """A haptic device that cannot be found or opened, or a device in Python whose methods fail."""


class ClusterError(Error):
    """Workers that cannot be reached or used, or a computation that they did not finish."""


def system_text(error: OSError) -> str:
    """Message of an error of the operating system, with its file where it has one."""
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}"


class PalpateWarning(UserWarning):
    """Base of everything Palpate warns of: the answer stands, but not as well as asked."""


class MeshWarning(PalpateWarning):
    """Something about a mesh was changed, left out or lost."""


class LockingWarning(PalpateWarning):
    """The elements are too stiff for the material: nearly incompressible, they lock."""


class StoreWarning(PalpateWarning):
    """Something in the way of a precomputed file was thrown away."""


class PrecisionWarning(PalpateWarning):
    """An answer, or the typical answers of a store, may be wrong by more than a per cent."""


class SchedulingWarning(PalpateWarning):
    """The system did not give the force loop the scheduling that was asked for: ticks may begin late."""


class DeviceWarning(PalpateWarning):
    """A haptic device that renders less than the scene asks for, or has a fault."""


class TouchWarning(PalpateWarning):
    """A touch, the tool of a run or the loads of the body strain it beyond what linear elasticity can answer."""


class RecordingWarning(PalpateWarning):
    """A recording is not whole, or its replay gives other numbers."""
