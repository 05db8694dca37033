"""Units and axes of the wire: millimetres, and the patient's axes RAS or LPS.

Palpate has metres, and bodies of segmentations in RAS: x to the patient's right, y to the front (anterior), z to the
head (superior). Slicer has the same axes in millimetres. LPS, of DICOM and ITK, turns x and y around.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

MILLIMETRES = 1e3


class Axes:
    """Conversion of a scene (m, RAS) to the wire (mm, RAS or LPS), in whose world the scene may stand anywhere."""

    def __init__(self, name: Literal["RAS", "LPS"] = "RAS"):
        self.name = name
        self._signs = np.array([1.0, 1.0, 1.0] if name == "RAS" else [-1.0, -1.0, 1.0])
        self._placement = np.eye(4)

    def place(self, matrix: np.ndarray) -> None:
        """Take the placement of the scene in the world of the wire, (4, 4) in mm."""
        self._placement = np.array(matrix, dtype=float)

    def pose_from_wire(self, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position, m, and unit quaternion w x y z in the scene."""
        from scipy.spatial.transform import Rotation

        own = np.linalg.inv(self._placement) @ matrix
        turned = own[:3, :3] * np.outer(self._signs, self._signs)
        x, y, z, w = Rotation.from_matrix(turned).as_quat(canonical=True)
        return self._signs * own[:3, 3] / MILLIMETRES, np.array([w, x, y, z])

    def pose_to_wire(self, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Matrix (4, 4), mm, of a position, m, and a unit quaternion in the scene."""
        from scipy.spatial.transform import Rotation

        own = np.eye(4)
        w, x, y, z = orientation
        own[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix() * np.outer(self._signs, self._signs)
        own[:3, 3] = self._signs * np.asarray(position) * MILLIMETRES
        return self._placement @ own

    def points_to_wire(self, points: np.ndarray) -> np.ndarray:
        """Points (k, 3), mm, of points in the scene, m."""
        return (self._signs * points * MILLIMETRES) @ self._placement[:3, :3].T + self._placement[:3, 3]

    def vector_to_wire(self, vector: np.ndarray) -> np.ndarray:
        """Vector of the scene in the axes of the wire, in its own unit; torques too, because both are right-handed."""
        return self._placement[:3, :3] @ (self._signs * vector)
