"""Random closed paths over the flat top of a block: a tool comes, presses, slides, turns, lifts, and is back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

# Waves along a path, and the largest rotation of a tool, rad.
WAVES, ROTATION = 3, 0.5


@dataclass(frozen=True)
class ClosedPaths:
    """Paths that end where they begin, above the surface."""

    # (paths, ticks, tools, 3) m, and (paths, ticks, tools, 4) unit quaternions w x y z.
    positions: np.ndarray
    orientations: np.ndarray

    @classmethod
    def over(
        cls,
        centres: np.ndarray,
        height: float,
        *,
        paths: int,
        ticks: int,
        slide: float,
        depth: tuple[float, float],
        clear: float = 1e-3,
        seed: int = 0,
    ) -> ClosedPaths:
        """Paths around points of a top that faces along z.

        Parameters
        ----------
        centres
            (tools, 3) m, on the top.
        height
            Of a tool's position over its lowest point, m.
        paths, ticks
            How many, and how long each is.
        slide
            Largest distance from the centre along x and y, m.
        depth
            Least and largest depth reached, m.
        clear
            Height over the top at both ends, m.
        seed
            Of the random numbers.

        """
        random = np.random.default_rng(seed)
        tools = len(centres)
        phase = 2 * np.pi * np.linspace(0, 1, ticks)[:, None]

        def closed(components: int) -> np.ndarray:
            """Smooth functions within one in magnitude, (paths, ticks, tools, components), the same at both ends."""
            shape = (paths, 1, tools, components, WAVES)
            size, shift = random.uniform(-1, 1, shape) / WAVES, random.uniform(0, 2 * np.pi, shape)
            angle = (phase * np.arange(1, WAVES + 1))[None, :, None, None, :]
            return (size * np.sin(angle + shift)).sum(axis=-1)

        deepest = random.uniform(*depth, (paths, 1, tools, 1))
        # Down and up once, with presses between that may leave the surface and come back.
        down = np.sin(phase / 2)[None, :, None, :] ** 2
        sunk = down * (clear + deepest) * (1 + 0.4 * closed(1)) - clear
        x = centres + np.concatenate([slide * closed(2), height - sunk], axis=-1)
        return cls(x, _quaternions(ROTATION * closed(3)))

    def holding(self, orientation: tuple[float, float, float, float]) -> ClosedPaths:
        """Return the same paths of tools that have this orientation, w x y z, where these have none."""
        w, v = self.orientations[..., :1], self.orientations[..., 1:]
        first, rest = orientation[0], np.array(orientation[1:])
        scalar = w * first - (v @ rest)[..., None]
        return replace(self, orientations=np.concatenate([scalar, w * rest + first * v + np.cross(v, rest)], axis=-1))

    def script(self) -> tuple[np.ndarray, np.ndarray]:
        """One script of all paths; a tick without tools ends each: (ticks, tools, 3), (ticks, tools, 4)."""
        x = np.full((self.positions.shape[0], self.positions.shape[1] + 1, *self.positions.shape[2:]), np.nan)
        x[:, :-1] = self.positions
        q = np.zeros((*x.shape[:-1], 4))
        q[..., 0] = 1.0
        q[:, :-1] = self.orientations
        return x.reshape(-1, *x.shape[2:]), q.reshape(-1, *q.shape[2:])

    def of_script(self, rows: np.ndarray) -> np.ndarray:
        """Rows (ticks, tools, 3) of what a script returned, by path (paths, ticks, tools, 3)."""
        return rows.reshape(len(self.positions), -1, *rows.shape[1:])[:, :-1]


def _quaternions(rotation: np.ndarray) -> np.ndarray:
    """Return unit quaternions w x y z of rotation vectors (..., 3), rad."""
    angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
    part = np.sinc(angle / (2 * np.pi)) / 2  # sin(angle/2) / angle
    return np.concatenate([np.cos(angle / 2), part * rotation], axis=-1)
