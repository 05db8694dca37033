"""Arguments of the native module for bodies and tools of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate import _native
from palpate.body import surface_strain_terms
from palpate.errors import BodyError, Error, SceneError
from palpate.scene import BuiltBody
from palpate.scene.mistakes import located
from palpate.scene.tables import SceneTables
from palpate.simulation.connecting import largest_force, largest_stiffness


def core_of(scene: SceneTables, bodies: Sequence[tuple[Any, ...]]) -> _native.SimulationCore:
    """Make the native part of a simulation, from :func:`body_arguments` of its bodies; Error for what it refuses."""
    device = scene.device
    return _native.SimulationCore(
        bodies,
        [tool_arguments(scene, rank) for rank in range(len(scene.tools))],
        (largest_force(scene), device.max_slew, device.ramp),
        scene.view.strain_limit,
        (device.rate, device.cpus, device.priority),
    )


def needs_moduli(scene: SceneTables) -> bool:
    """Whether a tool of a scene follows the local law, which needs the elastic constants at the surfaces."""
    return any(tool.contact == "local" for tool in scene.tools)


def tool_arguments(scene: SceneTables, rank: int) -> tuple[Any, ...]:
    """Shape and numbers of one tool in the order of the native module.

    Raises SceneError for a surface file that is missing, cannot be read or holds no closed surface, with its line.
    """
    tool, most = scene.tools[rank], largest_stiffness(scene.device_of(rank))
    try:
        shape = tool.shape_arguments(scene.folder)
    except Error as error:
        path, text = scene.source
        raise SceneError(f"{located(path, text, ['tool', rank, 'shape'])}: tool.shape: {error}") from None
    # Settings have the names of their keys in the table.
    settings = {name: getattr(tool, name) for name in _native.TOOL_SETTINGS}
    return shape, tool.contact, most, tool.pad_youngs_modulus, settings


def body_arguments(body: BuiltBody, local: bool) -> tuple[Any, ...]:
    """Arrays of one body in the order of the native module.

    Elastic constants at the surface are given wherever they are known, because a tool under the local law may come
    later. Raises BodyError for a store that does not know them, under a ``local`` law.
    """
    motion = body.motion
    moving = None
    if motion is not None:
        shapes = motion.basis.shapes[body.green.surface_nodes].reshape(-1, len(motion.basis))
        moving = (motion.basis.eigenvalues, np.ascontiguousarray(shapes), motion.scheme, motion.exact, motion.coupling)
    return body.green._core, body.position, body.orientation, moving, _moduli(body, local), list(body.series)


def _moduli(body: BuiltBody, needed: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, bool] | None:
    known = body.green._core.surface_moduli()
    if known is None and needed:
        raise BodyError(
            "this store of several materials does not contain those at the surface: compute it again, or give the tool "
            "contact = 'patch'"
        )
    if known is None:
        return None
    young, poisson, is_even = known
    # A store has the constants at small strain only: the law beyond is that of the scene's material.
    terms = None if body.body is None else surface_strain_terms(body.body)
    return young, poisson, terms, is_even
