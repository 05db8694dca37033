"""The built-in models as scenes."""

from __future__ import annotations

from palpate import models
from palpate.errors import SceneError
from palpate.scene.regions import DEFAULT_LAW
from palpate.scene.scene import Scene

# Size of a fingertip against each model, m; and its stiffness, Pa: organs about as published for fresh tissue
# (liver and kidney some kPa to tens of kPa), the others soft rubber.
TOOLS = {"doll": 10e-3, "kidney": 6e-3, "liver": 10e-3, "beam": 5e-3}
YOUNGS_MODULUS = {"doll": 10e3, "kidney": 15e3, "liver": 8e3, "beam": 20e3}
# Where a model is held to be pressed, if not on its own supports. The liver lies on its back: hung by its ligaments it
# swings as a whole (of a press of 5 mm a fifth arrives 5 cm away, lying it is a twelfth). The doll leans back too.
SUPPORTS = {"doll": "z < 6mm or y > 40mm", "liver": "y > 20mm"}
# Modes of a body in motion, by whether it has the paper's size: all of a small one, the lowest of a fine one.
MODES = {True: {"modes": "all"}, False: {"modes": 200}}
# Parts of critical damping of the first and the tenth mode: a struck body swings for some seconds.
DAMPING_RATIOS = (0.03, 0.03)


def model_scene(name: str, paper: bool = False, motion: bool = False) -> Scene:
    """Scene of a built-in model and two fingers, held so that a finger dents it; with ``motion`` it moves.

    Raises SceneError for no model of that name.
    """
    if name not in models.NAMES:
        raise SceneError(f"there is no model '{name}'; there are {', '.join(models.NAMES)}")
    # What slides has no patch of its own; the radius is that of a grab.
    finger = {"contact": "local", "radius": TOOLS[name], "contact_radius": TOOLS[name]}
    return Scene(
        body={"model": name, "paper": paper},
        supports={"fixed": SUPPORTS.get(name)},
        # The paper's bodies are linear.
        material={"youngs_modulus": YOUNGS_MODULUS[name], "law": "linear" if paper else DEFAULT_LAW},
        tool=[finger, finger],
        dynamics={**MODES[paper], "damping_ratios": DAMPING_RATIOS} if motion else None,
    )
