"""The scene and the hand of the tests of sessions."""

from __future__ import annotations

import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import palpate
from palpate.cli import main
from palpate.scene import BuiltScene

TOP = np.array([0.041, 0.026, 0.05])
RADIUS = 0.006
TICKS = 300
STRIKE = (100, [0.04, 0.025, 0.05], [0, 0, -2e-4])


def scene_of(**changes) -> palpate.Scene:
    """The block in motion, with a ball and a capsule."""
    tools = [{"radius": RADIUS, "friction": 0.3}, {"shape": "capsule", "radius": 0.004, "length": 0.012}]
    return palpate.Scene(**({"body": {"store": "block.palpate"}, "tool": tools, "dynamics": {}} | changes))


def built_of(scene: palpate.Scene, block, green) -> BuiltScene:
    motion = scene.dynamics.build(block, scene.device.max_stiffness, progress=False)
    return BuiltScene.of(scene, block, green, motion)


def path() -> tuple[np.ndarray, np.ndarray]:
    """The ball presses and slides; the capsule comes down turned beside it, and is out of the scene at first."""
    t = np.linspace(0, 1, TICKS)
    depth = 3e-3 * np.clip(3 * t, -1, 1) - 5e-4
    ball = TOP + np.stack([0.012 * t, 0 * t, RADIUS - depth], axis=1)
    capsule = TOP + np.stack([-0.02 + 0 * t, 0 * t, 0.004 - 2e-3 * t], axis=1)
    capsule[:60] = np.nan
    half = 0.5 * np.pi / 2 * t
    turned = np.stack([np.cos(half), 0 * t, np.sin(half), 0 * t], axis=1)
    straight = np.tile([1.0, 0, 0, 0], (TICKS, 1))
    return np.stack([ball, capsule], axis=1), np.stack([straight, turned], axis=1)


def called(monkeypatch, capsys, *words) -> SimpleNamespace:
    """The command line within this process: what it returned and said."""
    monkeypatch.setattr(sys, "argv", ["palpate", *map(str, words)])
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    with pytest.raises(SystemExit) as ended:
        main()
    text = capsys.readouterr()
    return SimpleNamespace(returncode=ended.value.code or 0, stdout=text.out, stderr=text.err)
