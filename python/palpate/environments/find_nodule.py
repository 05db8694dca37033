"""The environment "find the nodule": a ball palpates a slab, and says where something hard is hidden."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from palpate.environments.slab import SIDES, TOOL_RADIUS, Slab, plain_slab, random_slab
from palpate.errors import SceneError
from palpate.simulation import Sensor

# Motion of a step in each direction, m; the tool goes there in ticks of so many.
LONGEST_STEP, TICKS = 2e-3, 4
# Region that the tool's lowest point stays in, m: above the slab, and as deep as the tissue may be pressed.
HIGHEST, DEEPEST = 0.010, 0.004
EDGE = 0.006
# A declared place counts as found within this of the nodule's middle, seen from above, m.
FOUND_WITHIN = 0.006
# Reward of a step, and of a declared place that is right.
STEP_COST, PRIZE = 1e-3, 1.0
# A force, N, beyond what any press here reaches.
LARGEST_FORCE = 20.0


class FindNodule(gymnasium.Env):
    """Find a nodule in soft tissue by touch. Its id is ``palpate/FindNodule-v0``.

    A slab of 60 x 60 x 30 mm has a nodule of 12 mm, twelve times stiffer, its middle 9 to 13 mm deep, anywhere but near
    the sides. A ball of 5 mm palpates it.

    An observation has six numbers: the position of the ball's lowest point, m, and the force on the ball, N. The
    middle of the upper surface is the origin. An action has four numbers from -1 to 1. Three are a motion in units of
    2 mm. The fourth, above 0.5, declares that the nodule lies below the ball, and ends the episode. A right declaration
    pays 1, a step costs 0.001. Right is within 6 mm, seen from above.

    Parameters
    ----------
    slabs
        Number of different slabs; each is solved when it first comes up, and kept. Each appears turned and mirrored in
        eight ways, as chance has it.
    noise
        Standard deviation of each observed force, N.

    """

    metadata = {"render_modes": []}  # noqa: RUF012  the name and type are Gymnasium's

    def __init__(self, slabs: int = 16, noise: float = 1e-3):
        if not 1 <= slabs <= 10_000 or not noise >= 0:
            raise SceneError(f"slabs must be from 1 to 10000 and noise not negative, got {slabs} and {noise}")
        self._slabs, self._noise = int(slabs), float(noise)
        half = SIDES[:2] / 2 - EDGE
        low = np.array([*-half, -DEEPEST, *[-LARGEST_FORCE] * 3], np.float32)
        high = np.array([*half, HIGHEST, *[LARGEST_FORCE] * 3], np.float32)
        self.observation_space = spaces.Box(low, high, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (4,), np.float32)
        self._solved: dict[int, tuple[Slab, Sensor]] = {}
        self._turn = np.eye(2)
        self._place = np.array([0.0, 0.0, HIGHEST])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Take another slab, the tool above its middle; ``options={"plain": True}`` one without a nodule."""
        super().reset(seed=seed)
        number = -1 if (options or {}).get("plain") else int(self.np_random.integers(self._slabs))
        if number not in self._solved:
            slab = plain_slab() if number < 0 else random_slab(number)
            self._solved[number] = (slab, Sensor(slab.scene, device_limits=False))
        self._slab, self._sensor = self._solved[number]
        self._sensor.reset()
        turns, mirrored = self.np_random.integers(4), self.np_random.integers(2)
        turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), int(turns))
        self._turn = turn @ np.diag([1.0, -1.0 if mirrored else 1.0])
        self._place = np.array([0.0, 0.0, HIGHEST])
        return self._observe(self._touch(self._place)), self._info()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the tool, or declare where the nodule is."""
        given = np.clip(np.asarray(action, float), -1.0, 1.0)
        space = self.observation_space
        target = np.clip(self._place + LONGEST_STEP * given[:3], space.low[:3], space.high[:3])
        for part in np.linspace(0.0, 1.0, TICKS + 1)[1:]:
            force = self._touch(self._place + part * (target - self._place))
        self._place = target
        declared = bool(given[3] > 0.5)
        found = declared and self._distance() < FOUND_WITHIN
        reward = (PRIZE if found else 0.0) - STEP_COST
        return self._observe(force), reward, declared, False, self._info() | {"found": found}

    def _touch(self, place: np.ndarray) -> np.ndarray:
        """Force on the tool, as the turned slab is seen."""
        flat = self._turn.T @ place[:2] + SIDES[:2] / 2
        force = self._sensor.step([*flat, SIDES[2] + TOOL_RADIUS + place[2], 1.0, 0.0, 0.0, 0.0])[0, 0, :3]
        return np.array([*(self._turn @ force[:2]), force[2]])

    def _observe(self, force: np.ndarray) -> np.ndarray:
        force = force + self._noise * self.np_random.standard_normal(3)
        seen = np.concatenate([self._place, force]).astype(np.float32)
        return np.clip(seen, self.observation_space.low, self.observation_space.high)

    def _nodule(self) -> np.ndarray | None:
        """Middle of the nodule (3,), m, in the frame of the observations."""
        if self._slab.nodule is None:
            return None
        flat = self._turn @ (self._slab.nodule[:2] - SIDES[:2] / 2)
        return np.array([*flat, self._slab.nodule[2] - SIDES[2]])

    def _distance(self) -> float:
        nodule = self._nodule()
        return np.inf if nodule is None else float(np.linalg.norm(nodule[:2] - self._place[:2]))

    def _info(self) -> dict[str, Any]:
        return {"nodule": self._nodule(), "distance": self._distance()}
