"""The same sphere pressed into the same 4-node tetrahedra by programs for robots, where they are installed.

Both bodies are glued at their bottom, without gravity and friction, and stepped until nothing moves any more.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from palpate.body import Material
from palpate.mesh import TetMesh

# By name: the module that must be there, and what to install.
PACKAGES = {"MuJoCo": ("mujoco", "mujoco"), "Drake": ("pydrake", "drake")}

# MuJoCo: thickness of the skin that its collisions add, m; steps, and steps at each depth.
SKIN, TIME_STEP, SETTLING = 1e-5, 1e-3, 150
# Drake: step, time until rest, and the last part of it over which a depth is averaged, s.
DRAKE_STEP, REST, AVERAGED = 5e-3, 0.35, 0.1


def installed() -> list[str]:
    """Names of the programs that can take part."""
    return [name for name, (module, _) in PACKAGES.items() if importlib.util.find_spec(module)]


def missing() -> dict[str, str]:
    """Names of those that cannot, and what to install."""
    return {name: package for name, (_, package) in PACKAGES.items() if name not in installed()}


def mujoco_forces(
    mesh: TetMesh, material: Material, radius: float, places: np.ndarray, depths: Sequence[float]
) -> tuple[np.ndarray, float]:
    """Return forces (places, depths), N, on the block, and the seconds of one step in contact.

    A flex of linear elements ("flexcomp" of dimension 3) under a sphere of a mocap body; the contact is as hard as the
    time step allows.

    Parameters
    ----------
    mesh
        4-node tetrahedra, resting on z = 0.
    material
        Density does not matter at rest.
    radius
        Of the sphere, m.
    places
        (n, 2) m, of its centre.
    depths
        m, ascending.

    """
    import time

    import mujoco

    model = mujoco.MjModel.from_xml_string(_mujoco_xml(mesh, material, radius))
    top = mesh.nodes[:, 2].max() + radius + SKIN
    forces, started, steps = np.zeros((len(places), len(depths))), time.process_time(), 0
    for row, place in zip(forces, places, strict=True):
        data = mujoco.MjData(model)
        for k, depth in enumerate(depths):
            data.mocap_pos[0] = (*place, top - depth)
            for _ in range(SETTLING):
                mujoco.mj_step(model, data)
            steps += SETTLING
            row[k] = -data.qfrc_constraint.reshape(-1, 3)[:, 2].sum()
    return forces, (time.process_time() - started) / steps


def drake_depths(
    mesh: TetMesh, material: Material, radius: float, places: np.ndarray, forces: Sequence[float], law: str = "linear"
) -> tuple[np.ndarray, float]:
    """Return depths (places, forces), m, and the seconds of one step; arguments as of :func:`mujoco_forces`.

    A deformable body, "linear" or "neo-hookean", under a sphere on a vertical slider that is pushed down by a constant
    force; hydroelastic contact, which cannot be given a depth.
    """
    import time

    import meshio

    depths, started, steps = np.zeros((len(places), len(forces))), time.process_time(), 0
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        file = Path(folder) / "block.vtk"
        meshio.Mesh(mesh.nodes, [("tetra", mesh.tets)]).write(file, file_format="vtk42")
        for row, place in zip(depths, places, strict=True):
            for k, force in enumerate(forces):
                row[k] = _drake_depth(file, material, radius, (*place, mesh.nodes[:, 2].max()), force, law)
                steps += round(REST / DRAKE_STEP)
    return depths, (time.process_time() - started) / steps


def _mujoco_xml(mesh: TetMesh, material: Material, radius: float) -> str:
    def numbers(values: np.ndarray) -> str:
        return " ".join(f"{value:.9g}" for value in values.ravel())

    pins = np.flatnonzero(mesh.nodes[:, 2] < 1e-9)
    return f"""
    <mujoco>
      <option timestep="{TIME_STEP}" gravity="0 0 0" integrator="discrete" solver="Newton" tolerance="1e-10"
        iterations="200"/>
      <size memory="1G"/>
      <worldbody>
        <body mocap="true" pos="0 0 1"><geom type="sphere" size="{radius}" condim="1"/></body>
        <flexcomp name="block" type="direct" dim="3" mass="0.5" radius="{SKIN}" point="{numbers(mesh.nodes)}"
          element="{numbers(mesh.tets)}">
          <pin id="{numbers(pins)}"/>
          <contact selfcollide="none" condim="1" solref="0.004 1" solimp="0.999 0.9999 1e-4"/>
          <elasticity young="{material.youngs_modulus}" poisson="{material.poissons_ratio}" damping="0.02"/>
          <edge equality="false"/>
        </flexcomp>
      </worldbody>
    </mujoco>"""


def _drake_depth(
    file: Path, material: Material, radius: float, top: tuple[float, ...], force: float, law: str
) -> float:
    """Mean depth over the last part of the time."""
    from pydrake import all as drake

    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlant(drake.MultibodyPlantConfig(time_step=DRAKE_STEP), builder)
    slider = _drake_bodies(drake, plant, file, material, radius, top, law)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.get_actuation_input_port().FixValue(context, [-force])
    depths = []
    for tick in range(1, round(REST / DRAKE_STEP) + 1):
        simulator.AdvanceTo(tick * DRAKE_STEP)
        depths.append(-slider.get_translation(context))
    return float(np.mean(depths[-round(AVERAGED / DRAKE_STEP) :]))


def _drake_bodies(drake, plant, file: Path, material: Material, radius: float, top: tuple[float, ...], law: str):
    """Add the block, and the sphere that touches it; return the joint on which the sphere slides."""
    config = drake.DeformableBodyConfig()
    config.set_youngs_modulus(material.youngs_modulus)
    config.set_poissons_ratio(material.poissons_ratio)
    config.set_mass_density(material.density)
    config.set_stiffness_damping_coefficient(0.02)
    models = {"linear": drake.MaterialModel.kLinear, "neo-hookean": drake.MaterialModel.kNeoHookean}
    config.set_material_model(models[law])
    block = drake.GeometryInstance(drake.RigidTransform(), drake.Mesh(str(file), 1.0), "block")
    smooth = drake.CoulombFriction(0.0, 0.0)
    properties = drake.ProximityProperties()
    drake.AddContactMaterial(None, None, smooth, properties)
    block.set_proximity_properties(properties)
    model = plant.mutable_deformable_model()
    model.SetWallBoundaryCondition(model.RegisterDeformableBody(block, config, 1.0), [0, 0, 1e-6], [0, 0, 1])

    sphere = plant.AddRigidBody("sphere", drake.SpatialInertia.SolidSphereWithMass(0.05, radius))
    properties = drake.ProximityProperties()
    drake.AddContactMaterial(None, None, smooth, properties)
    drake.AddRigidHydroelasticProperties(radius / 10, properties)
    plant.RegisterCollisionGeometry(sphere, drake.RigidTransform(), drake.Sphere(radius), "sphere", properties)
    touching = drake.RigidTransform(np.array(top) + (0, 0, radius))
    frame = plant.AddFrame(drake.FixedOffsetFrame("touching", plant.world_frame(), touching))
    slider = plant.AddJoint(drake.PrismaticJoint("slider", frame, sphere.body_frame(), [0, 0, 1], damping=5.0))
    plant.AddJointActuator("push", slider)
    return slider
