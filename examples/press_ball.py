"""Mesh a soft ball, solve it once, and press on it: force against depth, and what a wider finger feels."""

import trimesh

import palpate

ball = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
mesh = palpate.tetrahedralize(ball, max_element_size=0.006)
soft = palpate.Material(youngs_modulus=10e3, poissons_ratio=0.45)
body = palpate.Body(mesh, material=soft, fixed=lambda p: p[:, 2] < -0.025)
green = palpate.precompute(body)

print(f"{mesh}, {green.path.stat().st_size / 1e6:.0f} MB in the cache")
print("radius   stiffness")
stiffness = []
for radius in (0.0, 0.004, 0.008, 0.016):
    touch = green.touch(point=(0, 0, 0.04), displacement=(None, None, -0.001), radius=radius)
    stiffness.append(-touch.force[2] / 0.001)
    print(f"{1e3 * radius:4.0f} mm {stiffness[-1]:7.1f} N/m")

# A wider finger meets more material; the body never pushes less.
assert 0 < stiffness[0] < stiffness[1] < stiffness[2] < stiffness[3]
