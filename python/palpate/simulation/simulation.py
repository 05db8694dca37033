"""The simulation of a scene: the 1 kHz force loop, and the same ticks offline."""

from __future__ import annotations

import atexit
import os
import threading
import time
import warnings
import weakref
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native, units
from palpate.body import Body
from palpate.devices import Device
from palpate.dynamics import Energy
from palpate.errors import SceneError, SimulationError, TouchWarning
from palpate.fields import StrainMeasure, SurfaceStress
from palpate.green import GreensFunction
from palpate.scene import BodyMotion, BuiltBody, BuiltScene, Scene
from palpate.simulation.about import about
from palpate.simulation.changing import SceneEditing
from palpate.simulation.frame import (
    Contact,
    Frame,
    contact_of,
    error_text,
    frame_of,
    limit_text,
    refused_text,
    thin_places,
)
from palpate.simulation.native import (
    assume_tables,
    body_arguments,
    connect,
    core_of,
    disconnect,
    needs_moduli,
    require_devices,
)
from palpate.simulation.recording import LOG_DTYPE, Recording, RecordingStatus, require_new_recording
from palpate.simulation.scheduling import scheduled, start_loop
from palpate.simulation.script import for_all_tools, grabs_of, orientations_of, positions_of, strike_of
from palpate.units import count_text
from palpate.vectors import three_numbers

# A tool is held at the limit of strain only where the pose has so much of it: one that has just landed is held until
# its limit is known.
AT_LIMIT = 0.95
# Estimated relative error of a force from which a warning is raised.
LARGE_ERROR = 0.03

# A program that ends without a word leaves no device pushing.
RUNNING: weakref.WeakSet[Simulation] = weakref.WeakSet()
# How often, and how long each time, s, a frame waits for another thread that changes the scene.
CHANGE_WAITS, CHANGE_WAIT = 2000, 1e-3


@atexit.register
def _stop_all() -> None:
    for simulation in list(RUNNING):
        simulation.stop()


class Simulation(SceneEditing):
    """Force loop of a scene.

    As a context manager it runs at 1 kHz on a thread of its own; :meth:`run` needs no clock.

    Parameters
    ----------
    scene
        What to touch, and with what.
    cpus, priority
        Processors and priority of the loop's thread, in place of those of ``scene.device``.
    devices
        Devices of the program by tool, in place of those of the scene.

    Attributes
    ----------
    scene
        Its tables.
    bodies
        Its bodies, with their Green's functions.

    Raises
    ------
    Error
        A body that cannot be solved, a contact radius that covers too many nodes, or ``cpus`` that there are not.

    """

    def __init__(
        self,
        scene: Scene | BuiltScene,
        *,
        cpus: Sequence[int] | None = None,
        priority: int | None = None,
        devices: Mapping[int, Device] | None = None,
    ):
        built = scheduled(scene, cpus, priority)
        self.scene, self.bodies = built.scene, built.bodies
        local = needs_moduli(self.scene)
        self._core = core_of(self.scene, [body_arguments(body, local) for body in self.bodies])
        assume_tables(self._core, self.scene)
        self._given = dict(devices or {})
        require_devices(self._given)
        for tool in self._given:
            self._tool(tool)
        self._devices: dict[int, str] = {}
        self._armed, self._running, self._warned, self._warned_of_error = False, False, False, False
        self._number: int | None = 0
        # How often each tool was moved, by whomever.
        self._moves: Counter[int] = Counter()
        self._editing = threading.RLock()
        self._to_record: Path | None = None

    def __repr__(self) -> str:
        tools = count_text(len(self.scene.tools), "tool")
        moves = ", a body in motion" if any(body.motion for body in self.bodies) else ""
        return f"Simulation({self.scene.name}, {tools}{moves}, {'running' if self._running else 'stopped'})"

    def __enter__(self) -> Simulation:
        self.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.stop()

    @property
    def body(self) -> Body | None:
        """The first body; None for one from a store, which knows only its surface."""
        return self.bodies[0].body

    @property
    def green(self) -> GreensFunction:
        """Green's function of the first body."""
        return self.bodies[0].green

    @property
    def motion(self) -> BodyMotion | None:
        """Modes and time integration of the first body; None at rest."""
        return self.bodies[0].motion

    def start(self) -> None:
        """Open the devices, and start the loop; simulated tools are out of the scene until moved.

        A priority that was asked for and is not granted gives a :class:`SchedulingWarning`, a device that renders less
        than the scene asks for a :class:`DeviceWarning`.

        Raises
        ------
        DeviceError
            A device that cannot be opened, and what to do.
        SceneError
            Processors of ``scene.device`` that this process may not run on.

        """
        self._start(lambda: connect(self._core, self.scene, self._given))

    def start_without_devices(self) -> None:
        """Start the loop with simulated tools only, also where the scene names devices: a device may have gone."""
        self._start(dict)

    def _start(self, connected: Callable[[], dict[int, str]]) -> None:
        with self._editing:
            if not self._running:
                self._start_now(connected)

    def _start_now(self, connected: Callable[[], dict[int, str]]) -> None:
        self._arm_strain_limit()
        self._devices = connected()
        RUNNING.add(self)
        try:
            start_loop(self._core, self.scene.device)
            self._running = True
            self._begin_series()
            if self._to_record is not None:
                path, self._to_record = self._to_record, None
                self._begin_recording(path)
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Stop the loop; devices are left at zero force, and closed."""
        RUNNING.discard(self)
        self._end_series()
        self._core.stop()
        self._running = False
        disconnect(self._core, self._given, self._devices)
        self._devices = {}

    @property
    def devices(self) -> dict[int, str]:
        """Names of the devices that move tools of the running loop, by tool; the others are simulated."""
        return dict(self._devices)

    def record(self, path: str | os.PathLike[str]) -> None:
        """Record every tick from now on, or from the start of the loop, in a new file (MCAP).

        The loop begins anew: everything is let go of, bodies come to rest, and forces ramp in. Only from a known state
        can a recording be replayed bit for bit. A tick is safely on the disk after a tenth of a second.

        Raises
        ------
        Error
            A file that exists or cannot be written, or a loop that is being recorded already.

        """
        where = Path(path)
        require_new_recording(where)
        if self._running:
            self._begin_recording(where)
        else:
            self._to_record = where

    @property
    def recording(self) -> RecordingStatus | None:
        """How the recording is doing; None where there is none."""
        status = self._core.recording()
        return None if status is None else RecordingStatus(*status)

    def stop_recording(self) -> RecordingStatus | None:
        """End the recording, if there is one, and return its status."""
        self._to_record = None
        status = self._core.end_recording()
        _native.hold_series(self._core, False)
        return None if status is None else RecordingStatus(*status)

    def _begin_recording(self, path: Path) -> None:
        tools = len(self.scene.tools)
        try:
            self._core.begin_recording(path, self._about((tools, tools == 1), clock=True) | self._hold_series())
        except BaseException:
            _native.hold_series(self._core, False)
            raise

    def _about(self, shown: tuple[int, bool], clock: bool) -> dict[str, str]:
        return about(self.scene, self.bodies, _native.device_limits(self._core), shown, clock)

    def move(
        self,
        position: Sequence[float],
        velocity: Sequence[float] | None = None,
        tool: int = 0,
        orientation: Sequence[float] | None = None,
    ) -> None:
        """Send a simulated tool to a position, m, and an orientation, a unit quaternion w x y z.

        It follows smoothly. With a ``velocity``, m/s, the target moves on at that velocity until the next call, for
        at most a tenth of a second, so that the tool follows a moving pointer without delay.

        Raises
        ------
        SceneError
            No such tool, one that a device moves, or numbers that are not finite.

        """
        if tool in self._devices:
            raise SceneError(f"tool {tool} is moved by {self._devices[tool]}")
        place = three_numbers(position, "a tool's position", SceneError, units.length)
        moving = (0.0, 0.0, 0.0) if velocity is None else three_numbers(velocity, "a tool's velocity", SceneError)
        turned = None
        if orientation is not None:
            turned = orientations_of([orientation], np.array([[place]]))[0, 0].tolist()
        self._core.set_target(self._tool(tool), (place, turned), moving, True, None)
        self._moves[tool] += 1

    def grab(self, on: bool, tool: int = 0) -> None:
        """Grab the surface near the tool, or let go."""
        self._core.set_target(self._tool(tool), (None, None), (0.0, 0.0, 0.0), True, bool(on))

    def remove(self, tool: int = 0) -> None:
        """Take a tool out of the scene until it is moved again."""
        self._core.set_target(self._tool(tool), (None, None), (0.0, 0.0, 0.0), False, False)

    def closest(self, points: np.ndarray, body: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Closest points of a body's surface as tools under the local law meet it: smooth between the nodes.

        Parameters
        ----------
        points
            (n, 3) m, in the scene.

        Returns
        -------
        tuple
            Points (n, 3), m, outward unit normals (n, 3), both in the scene, and signed distances (n,), m, negative
            inside; NaN where a point is not finite, or no tool of the scene has the local law.

        """
        placed = self.bodies[self._body(body)]
        asked = np.ascontiguousarray(placed.points_to_body(np.asarray(points, dtype=float).reshape(-1, 3)))
        feet = self._core.feet(body, asked).reshape(-1, 7)
        return placed.points_to_scene(feet[:, :3]), placed.vectors_to_scene(feet[:, 3:6]), feet[:, 6]

    def reset(self) -> None:
        """Let go of everything and clear a latched fault; forces ramp in anew."""
        self._core.reset()

    def frame(self) -> Frame:
        """Read the latest tick.

        Raises
        ------
        SimulationError
            The loop does not run.

        """
        frame = self._read_frame()
        if not self._warned and np.any(frame.limited) and frame.largest_strain >= AT_LIMIT * self.strain_limit:
            self._warned = True
            warnings.warn(limit_text("a tool", self.bodies, self.strain_limit), TouchWarning, stacklevel=2)
        if not self._warned_of_error and (frame.largest_error or 0.0) >= LARGE_ERROR:
            self._warned_of_error = True
            warnings.warn(error_text(frame.largest_error or 0.0), TouchWarning, stacklevel=2)
        return frame

    def _read_frame(self) -> Frame:
        """Read the latest tick, without a word about the limit of strain."""
        raw, bodies = self._read_consistently(lambda: (raw := self._core.frame()) and (raw["scene"], raw))
        if raw is None:
            raise SimulationError("the simulation does not run: use it in a with block, or call start()")
        failed = self._given.get(raw["failed_program"])
        if failed is not None and failed.failure is not None:
            raw["fault"] = f"tool {raw['failed_program']}: {failed.failure}; forces are off until a reset"
        return self._flagged(frame_of(raw, bodies), bodies)

    def _flagged(self, frame: Frame, bodies: Sequence[BuiltBody]) -> Frame:
        """Add to a frame which tools touch a thin part of these bodies."""
        frame.statistics["thin"] = thin_places(frame.contacts, self.scene.tools, bodies)
        return frame

    def contacts(self) -> list[Contact]:
        """Contacts of the latest tick, without the cost of a whole frame; none while nothing runs."""
        records, bodies = self._read_consistently(self._core.contacts)
        return [contact_of(record, bodies) for record in records or []]

    def _read_consistently(self, read: Callable[[], tuple[int, Any] | None]) -> tuple[Any, tuple[BuiltBody, ...]]:
        """Read from the loop what belongs to the bodies that it comes with; None where it does not run.

        Another thread may be changing the scene: between its change of the loop and that of the bodies are moments.
        """
        for _ in range(CHANGE_WAITS):
            answer, bodies = read(), self.bodies
            number = self._number
            if answer is None or answer[0] == number:
                return answer and answer[1], bodies
            time.sleep(CHANGE_WAIT)
        raise SimulationError("another thread changes the scene all the time: no frame of it can be read")

    @property
    def strain_measure(self) -> StrainMeasure:
        """Measure of the largest strain of the first body."""
        return self.green.strain_measure

    def stress(self, displacements: np.ndarray, body: int = 0) -> SurfaceStress:
        """Stress and strain at the surface nodes, for a frame's or an answer's displacements (s, 3), m; milliseconds.

        Raises
        ------
        SceneError
            A body from a store, which knows only its surface.

        """
        green = self.bodies[self._body(body)].green
        if green.body is None:
            raise SceneError("a body from a store knows only its surface: stress needs its elements")
        field = green.stress_recovery.recover(displacements)
        # A stiffness changed while running scales stress, not strain.
        return replace(field, stress=self.stiffness_scale_of(body) * field.stress)

    def drain_log(self) -> np.ndarray:
        """Rows of the 1 kHz log since the last call.

        ``time``; ``position`` and ``force`` of the first tool, ``compute_us``, ``wakeup_us``; ``watched``, the
        displacement of the node of :meth:`watch`, m. If the body of that node moves, also its ``body_time``, s, and
        its energies, J, as in :class:`palpate.Energy`.
        """
        return np.ascontiguousarray(self._core.drain_log()).view(LOG_DTYPE)

    def run(self, positions: np.ndarray, orientations: np.ndarray | None = None) -> np.ndarray:
        """Move the tools through positions, one tick a row, without a clock; the same path gives the same bits.

        Parameters
        ----------
        positions
            (t, 3) m of the first tool, or (t, tools, 3).
        orientations
            Unit quaternions w x y z (t, 4) or (t, tools, 4); left out, tools do not turn.

        Returns
        -------
        numpy.ndarray
            (t, 3) or (t, tools, 3) force on the devices after the safety stage, N.

        Raises
        ------
        SceneError
            Positions that are not finite or of another shape.
        SimulationError
            A fault that latched within the run.

        """
        path = positions_of(positions, len(self.scene.tools))
        bad = np.argwhere(~np.isfinite(path).all(axis=2))
        if len(bad):
            raise SceneError(f"position {bad[0, 0]} is not finite")
        # Nobody sees a recording of it: none is written.
        return self._warn_of_strain_limit(self._play(positions, orientations, records=False)).forces

    def play(
        self,
        positions: np.ndarray,
        orientations: np.ndarray | None = None,
        strikes: Sequence[tuple] = (),
        watch: Sequence[int | tuple[int, int]] = (),
        grabs: np.ndarray | None = None,
    ) -> Recording:
        """Run a script of ticks without a clock; the same script gives the same bits.

        Parameters
        ----------
        positions
            (t, 3) m of the first tool, or (t, tools, 3) of the first ones; a row of NaN takes a tool out of the scene,
            where those that are left out always are.
        orientations
            Unit quaternions w x y z (t, 4) or (t, tools, 4); left out, tools do not turn.
        strikes
            Strikes ``(tick, point, impulse)`` or ``(tick, point, impulse, duration)``, as of :meth:`strike`.
        watch
            Surface nodes of the first body, or pairs of a body and its node, whose displacements are recorded.
        grabs
            (t,) or (t, tools): whether a tool holds on to what it touches.

        Raises
        ------
        SceneError
            Another shape, strikes on a body that does not move, or nodes that are not on the surface.
        SimulationError
            A fault that latched within the run.

        """
        return self._warn_of_strain_limit(self._play(positions, orientations, strikes, watch, grabs))

    def _warn_of_strain_limit(self, recording: Recording) -> Recording:
        """Warn of ticks in which the limit of strain held a tool."""
        ticks = recording.limited.reshape(len(recording.limited), -1).any(axis=1)
        if ticks.any():
            what = f"in {ticks.sum()} of {len(ticks)} ticks, first in tick {ticks.argmax()}, a tool"
            warnings.warn(limit_text(what, self.bodies, self.strain_limit), TouchWarning, stacklevel=3)
        error = float(recording.contacts["error"].max(initial=0.0)) if recording.source else 0.0
        if error >= LARGE_ERROR:
            warnings.warn(error_text(error), TouchWarning, stacklevel=3)
        return recording

    def _play(
        self,
        positions: np.ndarray,
        orientations: np.ndarray | None,
        strikes: Sequence[tuple] = (),
        watch: Sequence[int | tuple[int, int]] = (),
        grabs: np.ndarray | None = None,
        records: bool = True,
    ) -> Recording:
        path = positions_of(positions, len(self.scene.tools))
        turned, held = orientations_of(orientations, path), grabs_of(grabs, path)
        body = self._moving_body("strike", None) if strikes else 0
        struck = [(int(tick), body, *strike_of(*strike)) for tick, *strike in strikes]
        nodes = [(0, node) if np.ndim(node) == 0 else tuple(node) for node in watch]
        ranks = [(self._body(body), self._rank_of(node, body)) for body, node in nodes]
        self._prepare_script()
        ticks, given, tools = *path.shape[:2], len(self.scene.tools)
        everything = for_all_tools(path, turned, held, tools)
        happens = (sorted(struck, key=lambda strike: strike[0]), ranks)
        about = self._about((given, np.ndim(positions) == 2), clock=False) if records else None
        raw = self._core.run(*everything, happens, about)
        if raw["fault"] is not None:
            raise SimulationError(raw["fault"])
        if raw["refused"] is not None:
            warnings.warn(refused_text(*raw["refused"]), TouchWarning, stacklevel=3)
        shape = (ticks, 3) if np.ndim(positions) == 2 else (ticks, given, 3)
        forces, torques = (
            raw[name].reshape(ticks, tools, 3)[:, :given].reshape(shape) for name in ("forces", "torques")
        )
        limited = raw["limited"].astype(bool).reshape(ticks, tools)[:, :given].reshape(shape[:-1])
        energies = tuple(Energy(*rows.reshape(-1, 5).T) if len(rows) else None for rows in raw["energies"])
        time = np.arange(1, ticks + 1) / self.scene.device.rate
        watched = raw["watched"].reshape(ticks, len(ranks), 3)
        return Recording(time, forces, torques, watched, limited, energies, source=raw["file"] or b"")
