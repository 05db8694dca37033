"""Every public name is documented: what it is, what its attributes are."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import types

import pytest

import palpate
from palpate.scene import BuiltScene

NAMES = [*palpate.__all__, *(f"shapes.{n}" for n in ("Sphere", "Box", "Cylinder", "HalfSpace"))]
NAMES += [f"models.{name}" for name in palpate.models.__all__ if callable(getattr(palpate.models, name))]
NAMES += [f"palpation.{name}" for name in palpate.palpation.__all__]


def find(name: str):
    found = palpate
    for part in name.split("."):
        found = getattr(found, part)
    return found


def public_members(cls: type):
    """Methods and properties that the package itself gives a class, by name."""
    for base in cls.__mro__:
        if base.__module__.startswith("palpate"):
            for name, member in vars(base).items():
                callable_ = isinstance(member, (types.FunctionType, classmethod, staticmethod))
                if not name.startswith("_") and (callable_ or isinstance(inspect.unwrap(member), types.FunctionType)):
                    yield name, member
                elif not name.startswith("_") and (hasattr(member, "fget") or hasattr(member, "func")):
                    yield name, member


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_documented(name):
    found = find(name)
    assert inspect.getdoc(found), f"palpate.{name} has no docstring"
    if isinstance(found, type):
        assert found.__doc__ and not found.__doc__.startswith(f"{found.__name__}("), (
            f"palpate.{name} has none of its own"
        )
        for member, value in public_members(found):
            assert inspect.getdoc(getattr(value, "__func__", value)), f"palpate.{name}.{member} has no docstring"


@pytest.mark.parametrize("name", [n for n in NAMES if dataclasses.is_dataclass(find(n))])
def test_fields_of_a_record_are_named_in_its_docstring(name):
    record = find(name)
    for field in dataclasses.fields(record):
        if not field.name.startswith("_"):
            assert field.name in record.__doc__, f"the docstring of palpate.{name} does not tell of {field.name}"


def test_every_module_of_the_package_tells_what_it_is():
    for module in pkgutil.walk_packages(palpate.__path__, "palpate."):
        if module.name != "palpate._native":
            source = module.module_finder.find_spec(module.name).loader.get_source(module.name)
            assert source.lstrip().startswith('"""'), module.name


def test_every_module_of_the_package_can_be_imported():
    for module in pkgutil.walk_packages(palpate.__path__, "palpate."):
        if not module.name.endswith(("__main__", "_child")):  # programs
            importlib.import_module(module.name)


def test_attributes_of_objects_are_named_in_the_docstrings_of_their_classes(block, block_green):
    scene = palpate.Scene(body={"store": "block.palpate"})
    basis = palpate.modes(block, 3)
    objects = [block, block_green, block.mesh, basis, palpate.Simulation(BuiltScene.of(scene, block, block_green))]
    objects += [
        palpate.Newmark(block, modes=basis),
        palpate.StressRecovery(block),
        palpate.shapes.Sphere((0, 0, 0), 1),
        palpate.shapes.Box((0, 0, 0), (1, 1, 1)),
        palpate.shapes.Cylinder((0, 0, 0), (0, 0, 1), 1),
        palpate.shapes.HalfSpace((0, 0, 0), (0, 0, 1)),
    ]
    for thing in objects:
        kind = type(thing)
        words = set(re.findall(r"\w+", kind.__doc__ or ""))
        # A public cached property keeps its value among the attributes, and has a docstring of its own.
        missing = {name for name in vars(thing) if not name.startswith("_") and not hasattr(kind, name)} - words
        assert not missing, f"the docstring of palpate.{kind.__name__} does not tell of {sorted(missing)}"


def test_the_import_takes_no_library_that_a_press_can_do_without():
    """Each of these takes longer to import than the rest of the package together."""
    heavy = ("dask", "gymnasium", "matplotlib", "netgen", "pyvista", "scipy.optimize", "scipy.stats", "trimesh")
    code = f"import sys, palpate; print(*[name for name in {heavy} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
