"""What the number of modes changes: a sustained press, and the peak of an impact; and what a time step changes.

Usage: impact.py [plot.png]
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import palpate

COUNTS = (1, 2, 5, 10, 20, 50, 100, 200, 400)
TOP = np.array([0.04, 0.025, 0.05])
# The tool comes down from 1 mm above at this speed, and stops dead at this depth.
SPEED, DEPTH = 0.2, 0.004
# Newmark's weights whose errors are listed: average acceleration, the scenes' own, more damping, linear acceleration,
# central differences.
WEIGHTS = ((1 / 4, 0.5), (0.3025, 0.6), (0.36, 0.7), (1 / 6, 0.5), (0.0, 0.5))
FREQUENCIES = (5.0, 20.0, 50.0, 100.0)
DT = 1e-3

scene = palpate.Scene.read(Path(__file__).with_name("impact.toml"))
built = scene.build()


def with_modes(count):
    """Return the simulation with the lowest of its modes."""
    (body,) = built.bodies
    motion = replace(body.motion, basis=body.motion.basis.first(count))
    return palpate.Simulation(replace(built, bodies=(replace(body, motion=motion),)))


def fall(ticks):
    """Positions of the tool: down at a constant speed, then at rest."""
    depth = np.minimum(SPEED * DT * np.arange(ticks) - 1e-3, DEPTH)
    return TOP + np.outer(scene.tools[0].radius - depth, [0, 0, 1])


# Tool and patch are kept DEPTH apart by the coupling and the body in series: f = (C + I/k_c)^-1 d.
reference = palpate.Simulation(built)
basis, coupling = reference.motion.basis, reference.motion.coupling
unit_presses = [reference.green.touch(TOP, axis, scene.tools[0].contact_radius).force for axis in np.eye(3)]
compliance = np.linalg.inv(np.column_stack(unit_presses))


def sustained(compliance):
    """Force on the device, N, of a body at rest with this compliance under the tool."""
    return np.linalg.solve(compliance + np.eye(3) / coupling, [0, 0, DEPTH])[2]


# What some modes alone would have for a compliance: W^T Phi diag(1/omega^2) Phi^T W.
with reference:
    reference.move(fall(100)[-1])
    time.sleep(0.5)
    contact = reference.frame().contacts[0]
patch = np.einsum("p,pam->am", contact.weights, basis.shapes[contact.nodes])
modes_alone = np.array([sustained((patch[:, :m] / basis.eigenvalues[:m]) @ patch[:, :m].T) for m in COUNTS])

static, (peak, settled) = sustained(compliance), (np.zeros(len(COUNTS)) for _ in range(2))
everything = reference.run(fall(4000))[:, 2]
for i, count in enumerate(COUNTS):
    forces = with_modes(count).run(fall(4000))[:, 2]
    peak[i], settled[i] = forces.max(), forces[-1]

sustained_error = np.abs(settled / static - 1)
alone_error = np.abs(modes_alone / static - 1)
peak_error = np.abs(peak / everything.max() - 1)
print(f"{reference.body.mesh}: {len(basis)} modes, {basis.frequencies[0]:.1f} to {basis.frequencies[-1]:.0f} Hz")
print(f"sustained: {static:.3f} N; peak of the impact with all modes: {everything.max():.3f} N")
print("modes  to [Hz]  sustained, modes alone  sustained, corrected  peak, corrected")
for i, count in enumerate(COUNTS):
    errors = f"{100 * alone_error[i]:20.1f} %  {100 * sustained_error[i]:18.5f} %  {100 * peak_error[i]:13.2f} %"
    print(f"{count:5}  {basis.frequencies[count - 1]:7.0f}  {errors}")


def newmark_errors(alpha, delta, frequency):
    """Relative growth of the period, and damping ratio, of an undamped oscillator stepped by DT.

    From the eigenvalues exp((-xi + i) w dt) of the matrix that takes (q, dt v) over one step.
    """
    omega = (2 * np.pi * frequency * DT) ** 2
    s = 1 / (1 + alpha * omega)
    after = s * np.array([1 - (0.5 - alpha) * omega, 1.0])  # the new displacement
    velocity = np.array([0.0, 1.0]) - omega * ((1 - delta) * np.array([1.0, 0.0]) + delta * after)
    root = np.linalg.eigvals(np.array([after, velocity]))[0]
    angle = abs(np.angle(root))
    return np.sqrt(omega) / angle - 1, -np.log(abs(root)) / angle


print("\nNewmark's scheme at 1 ms: growth of the period, damping ratio added, in per cent")
print("alpha   delta  " + "  ".join(f"{f:10.0f} Hz" for f in FREQUENCIES))
for alpha, delta in WEIGHTS:
    cells = [
        "{:6.2f} {:6.2f}".format(*(round(100 * x, 4) + 0.0 for x in newmark_errors(alpha, delta, f)))
        for f in FREQUENCIES
    ]
    print(f"{alpha:.4f}  {delta:.1f}    " + "  ".join(cells))

figure = Figure(figsize=(9, 3.8), dpi=120, layout="constrained")
FigureCanvasAgg(figure)
left, right = figure.subplots(1, 2)
left.loglog(COUNTS, 100 * alone_error, "o-", color="0.45", label="modes alone")
left.loglog(COUNTS, 100 * np.maximum(sustained_error, 1e-15), "o-", color="tab:red", label="with the static correction")
left.set_title("a sustained press: error of the force")
right.loglog(COUNTS, 100 * peak_error, "o-", color="tab:red", label="with the static correction")
right.set_title(f"an impact at {SPEED:g} m/s: error of the peak")
for axes in (left, right):
    axes.set_xlabel(f"modes, of {len(basis)}")
    axes.set_ylabel("error [%]")
    axes.grid(alpha=0.25, which="both")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "truncation.png")

# The correction makes rest exact for any number of modes, which alone miss much of a fingertip's compliance.
assert sustained_error.max() < 1e-4
assert alone_error[COUNTS.index(20)] > 0.1
assert peak_error[COUNTS.index(200)] < 0.05
# The usual estimates of Newmark's errors, for small steps.
omega = 2 * np.pi * 20.0 * DT
assert np.allclose(
    newmark_errors(0.3025, 0.6, 20.0), (omega**2 / 2 * (0.3025 - 1 / 12 - 0.05 + 0.0025), 0.05 * omega), rtol=0.03
)
