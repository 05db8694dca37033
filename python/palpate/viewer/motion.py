"""Controls of a body in motion: strikes, slow motion, the watched node, mode shapes one by one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate.body import free_end
from palpate.dynamics import ModalBasis
from palpate.errors import ViewerError
from palpate.fields import LINEAR_STRAIN_LIMIT, SurfaceStrain
from palpate.mesh.triangles import node_normals
from palpate.scene import StrikeTable
from palpate.simulation import Contact, Simulation
from palpate.viewer.messages import vector, whole

# So many of the lowest modes are offered.
LISTED_MODES = 20
# Oscillations of a mode shape in a second of the person's time.
SHOWN_HZ = 1.0
# A mode shape swings by this part of the body's size, unless the strain would leave the range of linear elasticity.
MODE_SWING = 0.08
# Strain of the surface is not linear: it is that of displacements of this part of the size.
SMALL = 1e-4
# A strike lasts this part of the first period. A shorter one would strain what it hits far more than all the rest.
STRIKE_PERIODS = 0.06
# Strain that the default strike is seen to lead to at instants of the first period (peaks between them are higher, and
# so are those of other places), how many, and parts the strike is cut into.
DEFAULT_STRAIN, INSTANTS, STRIKE_PARTS = 0.5 * LINEAR_STRAIN_LIMIT, 24, 9
# It is tried where so large a part of the surface follows the first mode less, on at least so many nodes.
FOLLOWING, NEIGHBOURS = 0.9, 6
# Impulses go up to this many times the default.
STRONGEST = 10.0
# Slow motion that the page offers, and the fastest swing that an eye follows.
TIME_SCALES, FOLLOWED_HZ = (1.0, 0.25, 0.1), 4.0
# The history shows the first of these spans (s) that holds so many periods of the first mode.
SPANS, PERIODS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0), 6
# Columns of the history: body time, displacement of the watched node, kinetic, strain, total energy, work.
HISTORY_COLUMNS = 8


class MovingBody:
    """The moving side of a session: one body of its running loop."""

    def __init__(self, simulation: Simulation, index: int = 0):
        built, scene = simulation.bodies[index], simulation.scene
        dynamics = scene.bodies[index].dynamics or scene.dynamics
        assert built.motion is not None and built.body is not None and dynamics is not None
        self.index = index
        self._simulation, self._built = simulation, built
        self._green, self._motion = built.green, built.motion
        self._size = float(built.green.extents.max())
        self._first_strike = dynamics.strike
        self._patch_radius = scene.tools[0].contact_radius
        self._duration = STRIKE_PERIODS / float(built.motion.basis.frequencies[0])
        self.watched = self._closest_node(self._first_strike.point) if self._first_strike else free_end(built.body)
        self.impulse = self._default_impulse()
        given = 0.0 if self._first_strike is None else float(np.linalg.norm(self._first_strike.impulse))
        self.max_impulse = max(STRONGEST * self.impulse, given)
        self.struck_at: float | None = None
        self._mode: _ShownMode | None = None
        self._touched: np.ndarray | None = None
        simulation.watch(self.watched, index)
        self.set_time_scale(self._first_time_scale())

    def header(self) -> dict[str, Any]:
        """Return the part of the scene message about the motion."""
        basis, strike = self._motion.basis, self._first_strike
        # After the scene's own strike there is nothing before it to be seen.
        shown = (PERIODS if strike is None else 2 * PERIODS) / basis.frequencies[0]
        return {
            "body": self.index,
            "frequencies": basis.frequencies[:LISTED_MODES].tolist(),
            "modes": len(basis),
            "time_scale": self.time_scale,
            "impulse": self.impulse,
            "max_impulse": self.max_impulse,
            "span": next((span for span in SPANS if span >= shown), SPANS[-1]),
            "youngs_modulus": self._green.youngs_modulus,
            "strike": None if strike is None else {"point": strike.point, "impulse": strike.impulse},
        }

    def frame_header(self) -> dict[str, Any]:
        """Return the part of a frame message about the motion."""
        rank = int(np.searchsorted(self._green.surface_nodes, self.watched))
        mode = None if self._mode is None else self._mode.header
        return {"watched": rank, "struck_at": self.struck_at, "mode": mode}

    def strike(self, message: Mapping[str, Any], reach: float, now: float) -> None:
        """Give the strike of a message, in the body's frame, at the body time ``now``; it ends a mode that is shown."""
        point, impulse = np.array(vector(message, "point")), np.array(vector(message, "impulse"))
        size = float(np.linalg.norm(impulse))
        positions = self._green.surface_positions
        if np.abs(point - 0.5 * (positions.min(axis=0) + positions.max(axis=0))).max() > reach:
            raise ViewerError("strike: the point is far away from the body")
        if not 0.0 < size <= self.max_impulse:
            raise ViewerError(f"strike: the impulse must lie between 0 and {self.max_impulse:.3g} N s on this body")
        self._give(StrikeTable(point=tuple(point), impulse=tuple(impulse), duration=self._duration), now)

    def repeat(self, now: float) -> None:
        """Give the scene's own strike at the body time ``now``."""
        if self._first_strike is None:
            raise ViewerError("repeat: the scene has no strike of its own")
        self._give(self._first_strike, now)

    def _give(self, strike: StrikeTable, now: float) -> None:
        self.end_mode()
        self._watch(self._closest_node(strike.point))
        point = self._built.points_to_scene(np.array(strike.point))
        impulse = self._built.vectors_to_scene(np.array(strike.impulse))
        self._simulation.strike(point.tolist(), impulse.tolist(), strike.duration, self.index)
        self.struck_at = now

    def set_time_scale(self, time_scale: float) -> None:
        """Slow motion."""
        self._simulation.set_time_scale(time_scale)

    @property
    def time_scale(self) -> float:
        """Seconds that the body advances in a second."""
        return self._simulation.time_scale

    def show_mode(self, message: Mapping[str, Any]) -> None:
        """Show a mode of the list, counted from 1; 0 ends that."""
        chosen = whole(message, "number", 0, min(LISTED_MODES, len(self._motion.basis)))
        self._mode = None if chosen == 0 else self._prepare_mode(chosen)

    def end_mode(self) -> None:
        """Show the body itself again."""
        self._mode = None

    def pose(self, displacements: np.ndarray) -> np.ndarray:
        """Displacements to be drawn (s, 3), m: those of the mode that is shown, or the body's own."""
        if self._mode is None:
            return displacements
        return self._green.free_displacements + self._mode.displacements(time.monotonic())

    @property
    def shows_mode(self) -> bool:
        """Whether a mode shape is drawn in place of the body's motion."""
        return self._mode is not None

    def follow(self, contacts: list[Contact]) -> None:
        """Watch the node in the middle of a contact that has begun."""
        contact = next((contact for contact in contacts if contact.body == self.index), None)
        if contact is not None and not np.array_equal(contact.point, self._touched):
            self._watch(int(contact.nodes[np.argmax(contact.weights)]))
        self._touched = None if contact is None else contact.point

    def _first_time_scale(self) -> float:
        """Slow enough for the scene's own strike to be followed by eye; a body without one moves at its own pace."""
        if self._first_strike is None:
            return 1.0
        frequency = self._motion.basis.frequencies[0]
        return next((scale for scale in TIME_SCALES if scale * frequency <= FOLLOWED_HZ), TIME_SCALES[-1])

    def _watch(self, node: int) -> None:
        self.watched = node
        self._simulation.watch(node, self.index)

    def _closest_node(self, point: Any) -> int:
        positions = self._green.surface_positions + self._green.free_displacements
        return int(self._green.surface_nodes[np.argmin(np.linalg.norm(positions - np.array(point), axis=1))])

    def _prepare_mode(self, chosen: int) -> _ShownMode:
        basis = self._motion.basis
        shape = basis.shapes[self._green.surface_nodes, :, chosen - 1]
        largest = float(np.linalg.norm(shape, axis=1).max())
        swing = min(MODE_SWING * self._size / largest, LINEAR_STRAIN_LIMIT / self._strain_of(shape))
        return _ShownMode(chosen, float(basis.frequencies[chosen - 1]), swing * shape, swing * largest)

    def _strain_of(self, displacements: np.ndarray) -> float:
        """Largest strain of small displacements, as large as these: without that of the body's own loads."""
        measure, free = self._green.strain_measure, self._green.free_displacements
        if isinstance(measure, SurfaceStrain):
            part = SMALL * self._size / np.linalg.norm(displacements, axis=1).max()
            return measure.largest(part * displacements) / part
        return float(measure.magnitudes(measure.sample(free + displacements) - measure.sample(free)).max())

    def _default_impulse(self) -> float:
        """Impulse along the normal where the surface follows the first mode well within the strain limit, N s.

        From rest a short strike `I` gives each mode the velocity `g . I` of its mean shape `g` over the patch, and from
        then on it swings freely; a longer one is a row of short ones. The strain is proportional to the impulse.
        """
        basis, surface = self._motion.basis, self._green.surface_nodes
        shapes, green = basis.shapes[surface], self._green
        normals = node_normals(green.surface_positions, green.surface_corners)
        follows = np.abs(np.einsum("ij,ij->i", shapes[:, :, 0], normals))
        node = int(np.argsort(follows)[int(FOLLOWING * (len(surface) - 1))])
        modal_impulse = normals[node] @ np.tensordot(self._patch_around(node), shapes, axes=1)
        instants = np.geomspace(0.2 * self._duration, 1.0 / basis.frequencies[0], INSTANTS)
        parts = (np.arange(STRIKE_PARTS) + 1) / (STRIKE_PARTS + 1)
        shares = np.sin(np.pi * parts) / np.sin(np.pi * parts).sum()
        swings = np.zeros((len(basis), INSTANTS))
        for part, share in zip(parts, shares, strict=True):
            since = instants - part * self._duration
            after = since > 0
            swings[:, after] += share * _ringing(basis, self._motion.scheme, modal_impulse, since[after])
        poses = shapes.reshape(-1, len(basis)) @ swings
        return DEFAULT_STRAIN / max(self._strain_of(pose.reshape(-1, 3)) for pose in poses.T)

    def _patch_around(self, node: int) -> np.ndarray:
        """Weights (s,) about as a contact there has them: its radius, or on a coarse mesh the nearest neighbours."""
        positions = self._green.surface_positions
        distance = np.linalg.norm(positions - positions[node], axis=1)
        radius = max(self._patch_radius, 1.01 * np.partition(distance, NEIGHBOURS)[NEIGHBOURS])
        weights = np.where(distance < radius, (1 - (distance / radius) ** 2) ** 2, 0.0)
        return weights / weights.sum()


class _ShownMode:
    """A mode shape swinging at :data:`SHOWN_HZ` from the moment it is made."""

    def __init__(self, chosen: int, frequency: float, swing: np.ndarray, largest: float):
        self._swing, self._started = swing, time.monotonic()
        self.header = {"number": chosen, "frequency": frequency, "shown_hz": SHOWN_HZ, "amplitude": largest}

    def displacements(self, now: float) -> np.ndarray:
        return np.sin(2 * np.pi * SHOWN_HZ * (now - self._started)) * self._swing


def _ringing(basis: ModalBasis, scheme: tuple[float, ...], velocities: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Modal displacements (m, t) of free modes that start from zero with velocities (m,).

    `q = v (e^(s1 t) - e^(s2 t)) / (s1 - s2)` with the roots `s = -xi w +- w sqrt(xi^2 - 1)`, also for modes damped
    beyond the critical.
    """
    a, b = scheme[3:]
    decay = (a + b * basis.eigenvalues) / 2
    # Two equal roots are told apart by a part that round-off hides.
    root = np.sqrt((decay**2 - basis.eigenvalues * (1 + 1e-9)).astype(complex))
    s1, s2 = (-decay + root)[:, None], (-decay - root)[:, None]
    return (velocities[:, None] * (np.exp(s1 * instants) - np.exp(s2 * instants)) / (s1 - s2)).real


def history(rows: np.ndarray, since: float) -> np.ndarray:
    """Rows of the log as the page plots them, see HISTORY_COLUMNS: one for each step of the body after a body time."""
    rows = rows[np.flatnonzero(np.diff(rows["body_time"], prepend=since) > 0)]
    total = rows["kinetic"] + rows["strain"] + rows["coupling"]
    return np.column_stack([rows["body_time"], rows["watched"], rows["kinetic"], rows["strain"], total, rows["work"]])
