"""A scene brought to life: the 1 kHz force loop with simulated tools, and the same ticks offline."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Any

import numpy as np

from palpate import _native
from palpate.dynamics import Energy
from palpate.errors import SceneError, SimulationError
from palpate.fields import ElementStrain, StrainMeasure, SurfaceStress
from palpate.scene import BodyMotion, BuiltScene, Scene
from palpate.simulation.frame import Contact, Frame
from palpate.simulation.recording import LOG_DTYPE, RATE, Recording
from palpate.vectors import three_numbers

PERCENTILES = ("p50", "p99", "p999", "max")


class Simulation:
    """Force loop of a scene.

    As a context manager it runs at 1 kHz on a thread of its own; :meth:`run` needs no clock.

    Parameters
    ----------
    scene
        What to touch, and with what.

    Attributes
    ----------
    body
        The body; None for a scene of a store, which knows only its surface.
    green
        Its Green's function.
    motion
        Its modes and time integration; None for a body at rest.

    Raises
    ------
    Error
        A body that cannot be solved, or a contact radius that covers too many nodes.

    """

    def __init__(self, scene: Scene | BuiltScene):
        built = scene if isinstance(scene, BuiltScene) else scene.build()
        self.scene, self.body, self.green = built.scene, built.body, built.green
        tool, device = self.scene.tool, self.scene.device
        self._scale = 1.0
        self._tools = 1
        self._targets = [(0.0, 0.0, 0.0)] * self._tools
        self._grab = [False] * self._tools
        limits = (device.max_force, device.max_slew, device.ramp)
        self._contact_radius = tool.contact_radius
        self.motion = built.motion
        self._core = _native.SimulationCore(
            self.green._core,
            self._tools,
            tool.radius,
            tool.contact_radius,
            device.max_stiffness,
            limits,
            None if built.motion is None else self._moving(built.motion),
        )
        self._running = False

    def __repr__(self) -> str:
        tools = f"{self._tools} tool{'s' if self._tools > 1 else ''}"
        moves = "" if self.motion is None else ", a body in motion"
        return f"Simulation({self.scene.name}, {tools}{moves}, {'running' if self._running else 'stopped'})"

    def __enter__(self) -> Simulation:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def start(self) -> None:
        """Start the loop; tools are out of the scene until moved."""
        if not self._running:
            self._core.start()
            self._running = True

    def stop(self) -> None:
        """Stop the loop; devices are left at zero force."""
        self._core.stop()
        self._running = False

    def move(self, position: Sequence[float], velocity: Sequence[float] | None = None, tool: int = 0) -> None:
        """Send a simulated tool to a position, m. It follows smoothly; ``velocity`` is derived from its path.

        Raises
        ------
        SceneError
            No such tool, or a position that is not three finite numbers.

        """
        del velocity  # the simulated hand has its own
        self._targets[self._tool(tool)] = three_numbers(position, "a tool's position", SceneError)
        self._core.set_target(tool, self._targets[tool], True, self._grab[tool])

    def grab(self, on: bool, tool: int = 0) -> None:
        """Grab the surface near the tool, or let go."""
        self._grab[self._tool(tool)] = bool(on)
        self._core.set_target(tool, self._targets[tool], True, bool(on))

    def remove(self, tool: int = 0) -> None:
        """Take a tool out of the scene until it is moved again."""
        self._grab[self._tool(tool)] = False
        self._core.set_target(tool, self._targets[tool], False, False)

    def set_radius(self, contact_radius: float) -> None:
        """Contact radius of contacts that begin from now on, m."""
        self._core.configure(float(contact_radius), self._scale, False)
        self._contact_radius = float(contact_radius)

    @property
    def contact_radius(self) -> float:
        """Contact radius of contacts that begin from now on, m."""
        return self._contact_radius

    @property
    def youngs_modulus(self) -> float | None:
        """Young's modulus now, Pa; None for a body of several materials, with loads, or in motion."""
        reference = self.green.youngs_modulus
        return None if reference is None or self.motion is not None else reference * self._scale

    @property
    def stiffness_scale(self) -> float:
        """Young's modulus now over that of the Green's function."""
        return self._scale

    def largest_contact_radius(self, limit: float) -> float:
        """Largest contact radius up to ``limit`` (m) that can be weighed everywhere, to about a hundredth."""
        low, high = 0.0, limit
        if self._core.accepts_contact_radius(high):
            return high
        while high - low > 0.01 * limit:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._core.accepts_contact_radius(middle) else (low, middle)
        return low

    def set_youngs_modulus(self, youngs_modulus: float) -> None:
        """Change the stiffness of a body of one material at rest, without loads, Pa: it only scales the compliance."""
        reference = self.green.youngs_modulus
        if reference is None or self.motion is not None:
            raise SceneError(
                "the body has several materials, or loads, or moves: its stiffness cannot be changed while running"
            )
        if not (np.isfinite(youngs_modulus) and youngs_modulus > 0):
            raise SceneError(f"Young's modulus must be positive, got {youngs_modulus} Pa")
        self._scale = youngs_modulus / reference
        self._core.configure(self._contact_radius, self._scale, False)

    def strike(self, point: Sequence[float], impulse: Sequence[float], duration: float = 0.0) -> None:
        """Strike a body in motion: an impulse (3,), N s, on the patch around the surface point closest to ``point``, m.

        The force is half a wave of ``duration``, s; it takes one time step at least and a thousand at most.

        Raises
        ------
        SceneError
            A body that does not move, or numbers that are not finite.

        """
        self._require_motion("strike")
        self._core.strike(*_strike(point, impulse, duration))

    def set_time_scale(self, time_scale: float) -> None:
        """Seconds that a body in motion advances in a second, in (0, 1]: below one is slow motion.

        Raises
        ------
        SceneError
            A body that does not move, or a scale outside of (0, 1].

        """
        self._require_motion("slow motion")
        if not 0 < time_scale <= 1:
            raise SceneError(f"the time scale must lie in (0, 1], got {time_scale}")
        self._core.set_time_scale(float(time_scale))

    def watch(self, node: int) -> None:
        """Log the displacement of a surface node (mesh index) from now on; at first it is the lowest one's.

        Raises
        ------
        SceneError
            A node that is not on the surface.

        """
        self._core.watch(int(self._ranks_of([node])[0]))

    def reset(self) -> None:
        """Let go of everything and clear a latched fault; forces ramp in anew."""
        self._core.configure(self._contact_radius, self._scale, True)

    def frame(self) -> Frame:
        """Read the latest tick.

        Raises
        ------
        SimulationError
            The loop does not run.

        """
        raw = self._core.frame()
        if raw is None:
            raise SimulationError("the simulation does not run: use it in a with block, or call start()")
        contacts = [self._contact(record) for record in raw["contacts"]]
        statistics = {k: raw[k] for k in ("ticks", "missed_deadlines", "dropped_rows", "fault", "realtime", "refused")}
        for name in ("compute_us", "wakeup_us"):
            statistics[name] = dict(zip(PERCENTILES, raw[name], strict=True))
        displacements = raw["displacements"].reshape(-1, 3)
        forces, positions = np.array(raw["forces"]), np.array(raw["positions"])
        energy = None if raw["energy"] is None else Energy(*raw["energy"])
        return Frame(raw["time"], forces, positions, displacements, contacts, statistics, energy, self)

    def contacts(self) -> list[Contact]:
        """Contacts of the latest tick, without the cost of a whole frame; none while nothing runs."""
        return [self._contact(record) for record in self._core.contacts() or []]

    def contact_response(self, tool: int = 0) -> tuple[Contact, np.ndarray] | None:
        """Contact of a tool, and the surface's displacements (3, s, 3) per unit displacement of the tool along an axis.

        The tool's displacement counts from the anchor; the surface is at `u_free` plus these fields times its
        components, with the stiffness of contacts limited as in the force loop; None for a tool that does not touch.
        """
        answer = self._core.contact_response(self._tool(tool))
        if answer is None:
            return None
        record, fields = answer
        return self._contact(record), np.reshape(fields, (3, -1, 3))

    @property
    def strain_measure(self) -> StrainMeasure:
        """Measure of the largest strain of frames."""
        return self.green.strain_measure

    def stress(self, displacements: np.ndarray) -> SurfaceStress:
        """Stress and strain at the surface nodes, for a frame's or an answer's displacements (s, 3), m; milliseconds.

        Raises
        ------
        SceneError
            A body from a store, which knows only its surface.

        """
        measure = self.strain_measure
        if not isinstance(measure, ElementStrain):
            raise SceneError("a body from a store knows only its surface: stress needs its elements")
        field = measure.recovery.recover(displacements)
        # A stiffness changed while running scales stress, not strain.
        return SurfaceStress(self._scale * field.stress, field.strain)

    def drain_log(self) -> np.ndarray:
        """Rows of the 1 kHz log since the last call.

        ``time``, ``position``, ``force``, ``compute_us``, ``wakeup_us``; ``watched``, the displacement of the node of
        :meth:`watch`, m; and of a body in motion ``body_time``, s, and its energies, J, as in :class:`palpate.Energy`.
        """
        return np.ascontiguousarray(self._core.drain_log()).view(LOG_DTYPE)

    def run(self, positions: np.ndarray) -> np.ndarray:
        """Move the tool through (t, 3) positions, m, one tick each, without a clock; the same path gives the same bits.

        Returns
        -------
        numpy.ndarray
            (t, 3) force on the device after the safety stage, N.

        Raises
        ------
        SceneError
            Positions that are not finite or of another shape.
        SimulationError
            A fault that latched within the run.

        """
        path = _path(positions)
        bad = np.flatnonzero(~np.isfinite(path).all(axis=1))
        if bad.size:
            raise SceneError(f"position {bad[0]} is not finite")
        return self.play(path).forces

    def play(
        self,
        positions: np.ndarray,
        strikes: Sequence[tuple] = (),
        watch: Sequence[int] = (),
    ) -> Recording:
        """Run a script of ticks without a clock; the same script gives the same bits.

        Parameters
        ----------
        positions
            (t, 3) m of the tool; a row of NaN takes it out of the scene.
        strikes
            Strikes ``(tick, point, impulse)`` or ``(tick, point, impulse, duration)``, as of :meth:`strike`.
        watch
            Surface nodes whose displacements are recorded.

        Raises
        ------
        SceneError
            Another shape, strikes on a body that does not move, or nodes that are not on the surface.
        SimulationError
            A fault that latched within the run.

        """
        path = _path(positions)
        if strikes:
            self._require_motion("strike")
        struck = [(int(tick), *_strike(*strike)) for tick, *strike in strikes]
        ranks = self._ranks_of(watch)
        forces, energies, moved, fault = self._core.run(
            path, sorted(struck, key=lambda strike: strike[0]), ranks.tolist()
        )
        if fault is not None:
            raise SimulationError(fault)
        energy = Energy(*energies.reshape(-1, 5).T) if len(energies) else None
        time = np.arange(1, len(path) + 1) / RATE
        return Recording(time, forces.reshape(-1, 3), moved.reshape(len(path), len(ranks), 3), energy)

    def _moving(self, motion: BodyMotion) -> tuple:
        shapes = motion.basis.shapes[self.green.surface_nodes].reshape(-1, len(motion.basis))
        return motion.basis.eigenvalues, np.ascontiguousarray(shapes), motion.scheme, motion.exact, motion.coupling

    def _ranks_of(self, nodes: Sequence[int]) -> np.ndarray:
        watched = np.asarray(nodes, dtype=np.int64)
        absent = np.setdiff1d(watched, self.green.surface_nodes)
        if absent.size:
            raise SceneError(f"node {absent[0]} is not on the surface: it cannot be watched")
        return np.searchsorted(self.green.surface_nodes, watched)

    def _require_motion(self, what: str) -> None:
        if self.motion is None:
            raise SceneError(f"{what}: the body does not move; give the scene a [dynamics] table")

    def _contact(self, record: tuple[Any, ...]) -> Contact:
        tool, mode, vectors, nodes, weights = record
        return Contact(tool, mode, *map(np.array, vectors), self.green.surface_nodes[nodes], np.array(weights))

    def _tool(self, tool: int) -> int:
        if not 0 <= tool < self._tools:
            raise SceneError(f"there is no tool {tool}: the scene has {self._tools}")
        return tool


def _strike(point: Sequence[float], impulse: Sequence[float], duration: float = 0.0) -> tuple:
    if not (np.isfinite(duration) and duration >= 0):
        raise SceneError(f"a strike's duration must be a time of at least 0 s, got {duration}")
    where = three_numbers(point, "a strike's point", SceneError)
    return where, three_numbers(impulse, "a strike's impulse", SceneError), float(duration)


def _path(positions: np.ndarray) -> np.ndarray:
    path = np.ascontiguousarray(positions, dtype=np.float64)
    if path.ndim != 2 or path.shape[1] != 3:
        raise SceneError(f"positions must have shape (ticks, 3), got {path.shape}")
    return path
