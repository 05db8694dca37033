"""A searcher by rule, as a baseline: it presses a grid and compares with a slab that has no nodule."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from palpate.environments.find_nodule import LONGEST_STEP

# Distance of the places, m, how deep each is pressed and how high the tool travels between them.
SPACING, DEPTH, TRAVEL = 6e-3, 3e-3, 1e-3
# Places that differ by more than this part of the largest difference count for the nodule's middle.
COUNTED = 0.5
CLOSE = 1e-5


class ScriptedSearcher:
    """Presses a grid, takes the forces of a plain slab from it, and declares the middle of what is stiffer.

    Attributes
    ----------
    steps
        Steps that the last search took.

    """

    def __init__(self, env: gymnasium.Env):
        self._env = env
        self.steps = 0
        space = env.observation_space
        reach = space.high[:2].astype(float)  # type: ignore[attr-defined]
        axes = [np.arange(-np.floor(r / SPACING), np.floor(r / SPACING) + 1) * SPACING for r in reach]
        self._places = [(x, y) for k, x in enumerate(axes[0]) for y in (axes[1] if k % 2 == 0 else axes[1][::-1])]
        observation, _ = env.reset(options={"plain": True})
        self._plain = self._press_all(observation)[0]

    def run(self, observation: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Search from a first observation, declare, and return what the last step of the environment returned."""
        self.steps = 0
        force, observation = self._press_all(observation)
        change = np.clip(force / self._plain - 1.0, 0.0, None)
        weight = np.clip(change - COUNTED * change.max(), 0.0, None)
        middle = (weight[:, None] * np.array(self._places)).sum(axis=0) / weight.sum()
        observation = self._go(observation, (*middle, TRAVEL))
        return self._env.step(np.array([0.0, 0.0, 0.0, 1.0], np.float32))

    def _press_all(self, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        forces = []
        for x, y in self._places:
            observation = self._go(observation, (x, y, TRAVEL))
            observation = self._go(observation, (x, y, -DEPTH))
            forces.append(observation[5])
            observation = self._go(observation, (x, y, TRAVEL))
        return np.array(forces, float), observation

    def _go(self, observation: np.ndarray, target: tuple[float, float, float]) -> np.ndarray:
        while True:
            way = np.array(target) - observation[:3]
            if np.abs(way).max() < CLOSE:
                return observation
            action = np.zeros(4, np.float32)
            action[:3] = np.clip(way / LONGEST_STEP, -1.0, 1.0)
            observation, *_ = self._env.step(action)
            self.steps += 1


def search(episodes: int = 100, seed: int = 0, slabs: int = 25) -> int:
    """Let the searcher look through so many random scenes; the number of nodules that it found."""
    env = gymnasium.make("palpate/FindNodule-v0", slabs=slabs)
    env.reset(seed=seed)
    searcher, found = ScriptedSearcher(env), 0
    for _ in range(episodes):
        observation, _ = env.reset()
        found += bool(searcher.run(observation)[4]["found"])
    env.close()
    return found
