"""What a client of the viewer is told of presses: fields, the limit of strain, two fingers on one body."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
import scipy.sparse.linalg
from conftest import skfem_stiffness
from viewer_client import page, serving, settled

import palpate
from palpate.scene import BuiltScene

TOP = [0.04, 0.025, 0.05]


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"contact": "patch"}, view={"strain_limit": 0.1})
    return BuiltScene.of(scene, block, block_green)


def test_a_sliding_contact_is_told(block, block_green):
    """Depth by the distance to the flat top, stiffness by the slope of the force, Coulomb's bound while it slides."""
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"friction": 0.2}, view={"strain_limit": 0})
    built = BuiltScene.of(scene, block, block_green)

    async def session():
        async with serving(built) as server, page(server) as client:
            message, _ = await client.receive("scene")
            (tool,) = message["tools"]
            assert (tool["contact"], tool["friction"], tool["shape"]) == ("local", 0.2, "sphere")
            assert {"name": "sphere", "title": "Sphere"} in tool["shapes"]

            async def pressed(x, depth):
                centre = [x, TOP[1], TOP[2] + tool["radius"] - depth]
                await client.say(type="press", tool=0, position=centre, grab=False)
                arrived = lambda h: h["time"] > 0.6 and np.allclose(h["tools"][0]["position"], centre, atol=1e-8)  # noqa: E731
                header, _ = await settled(client, arrived)
                return header["contacts"][0]

            await pressed(TOP[0], 1e-3)
            depths = (1.4e-3, 1.5e-3, 1.6e-3)
            contacts = [await pressed(TOP[0], depth) for depth in depths]
            assert [contact["depth"] for contact in contacts] == pytest.approx(depths, rel=1e-6)
            pushes = [-contact["force"][2] for contact in contacts]
            assert contacts[1]["stiffness"] == pytest.approx((pushes[2] - pushes[0]) / 0.2e-3, rel=0.02)
            assert 0 < contacts[0]["radius"] < contacts[1]["radius"] < tool["radius"]
            dragged = await pressed(TOP[0] - 6e-3, 1.6e-3)
            along = np.hypot(dragged["force"][0], dragged["force"][1])
            assert along == pytest.approx(-0.2 * dragged["force"][2], rel=0.05)
            await client.say(type="set", friction=0)
            free = await pressed(TOP[0] + 1e-3, 1.6e-3)
            assert abs(free["force"][0]) < 0.1 * abs(free["force"][2])

    asyncio.run(session())


def test_what_holds_on_tells_no_depth(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            await client.say(type="press", tool=0, position=TOP, grab=False)
            header, _ = await client.frame_where(lambda h: len(h["contacts"]) == 1)
            (contact,) = header["contacts"]
            assert contact["depth"] is None and contact["stiffness"] is None
            assert contact["radius"] == scene["tools"][0]["contact_radius"]

    asyncio.run(session())


def test_fields_are_those_of_the_recovery(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            names = [field["name"] for field in scene["bodies"][0]["fields"]]
            assert names == ["displacement", "strain", "von_mises", "principal_stress"]
            place = [TOP[0], TOP[1], TOP[2] + scene["tools"][0]["radius"] - 1e-3]
            await client.say(type="press", tool=0, position=place, grab=False)
            await client.say(type="set", body=0, youngs_modulus=20e3)
            # Until the limit of strain is known the tool may be held above its place.
            arrived = lambda h: h["time"] > 0.5 and np.allclose(h["tools"][0]["position"], place, atol=1e-8)  # noqa: E731
            header, arrays = await settled(client, arrived)
            pose = arrays["0/displacements"].astype(float)
            recovered = palpate.StressRecovery(built.bodies[0].body).recover(pose)
            strain = np.abs(recovered.principal_strains).max(axis=1)
            assert header["strain"] == pytest.approx(strain.max(), rel=1e-4)
            # Stress scales with the stiffness, which was doubled; strain does not.
            expected = {
                "displacement": 1e3 * np.linalg.norm(pose, axis=1),
                "strain": 100 * strain,
                "von_mises": 2 * recovered.von_mises,
                "principal_stress": 2 * recovered.principal_stresses[:, 0],
            }
            for name, values in expected.items():
                await client.say(type="field", name=name)
                header, arrays = await client.frame_where(lambda h, name=name: h["fields"][0]["name"] == name)
                field = header["fields"][0]
                zero, steps = (127.5, 127.5) if field["signed"] else (0.0, 255.0)
                assert field["max"] == pytest.approx(np.abs(values).max(), rel=1e-3)
                # Half a step of colour, and what displacements told in steps do to a strain.
                assert np.abs(zero + steps * values / field["max"] - arrays["0/scalar"]).max() < 1.3
            await client.say(type="cutaway", on=True)
            header, arrays = await client.frame_where(lambda h: h["interior"][0])
            assert len(arrays["0/scalar"]) == scene["bodies"][0]["nodes"]
            on_surface = arrays["0/scalar"][built.bodies[0].green.surface_nodes].astype(float)
            assert np.abs(127.5 + 127.5 * values / header["fields"][0]["max"] - on_surface).max() < 1.3
            await client.say(type="field", name=5)
            assert "name" in (await client.receive("error"))[0]["text"]

    asyncio.run(session())


def test_a_bare_store_offers_what_its_surface_knows(built, tmp_path):
    built.bodies[0].green.save(tmp_path / "block.palpate")
    store = {"store": str(tmp_path / "block.palpate")}
    bare = palpate.Scene(body=store, tool={"contact": "patch"}, view={"strain_limit": 0.1}).build()

    async def session():
        async with serving(bare) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert [field["name"] for field in scene["bodies"][0]["fields"]] == ["displacement", "strain"]
            await client.say(type="field", name="strain")
            await client.say(type="cutaway", on=True)  # there is no inside: the surface goes on
            await client.say(type="press", tool=0, position=[TOP[0], TOP[1], TOP[2] - 0.01], grab=False)
            held = lambda h: h["tools"][0]["wanted"] is not None and h["time"] > 0.5 and h["strain"] > 0.099  # noqa: E731
            header, arrays = await settled(client, held)
            assert header["strain"] == pytest.approx(0.1, rel=0.01)
            assert header["fields"][0]["name"] == "strain" and not header["interior"][0]
            # Means over the faces around a node do not go beyond the largest of them.
            assert len(arrays["0/scalar"]) == scene["bodies"][0]["surface_nodes"]
            assert 5.0 < header["fields"][0]["max"] * arrays["0/scalar"].max() / 255 < 10.1

    asyncio.run(session())


def test_the_tool_is_limited(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert scene["strain_limit"] == 0.1
            over = np.array([TOP[0], TOP[1], TOP[2] + scene["tools"][0]["radius"]])
            readings = []
            for depth in (0.002, 0.012, 0.024):
                await client.say(type="press", tool=0, position=(over - [0, 0, depth]).tolist(), grab=False)
                deep, goal = depth > 0.01, (over - [0, 0, depth])[2]

                def arrived(header, deep=deep, goal=goal):
                    tool = header["tools"][0]
                    height = (tool["wanted"] or tool["position"])[2]
                    found = tool["limited"] == deep and (header["strain"] > 0.0995) == deep
                    return header["time"] > 0.5 and found and height < goal + 1e-6

                header, _ = await settled(client, arrived)
                readings.append(header)
            shallow, deep, deeper = readings
            assert shallow["strain"] < 0.1 and 0.0995 < deep["strain"] <= 0.103
            # The force is that of the closest admissible displacement: it hardly grows with the depth any more.
            size = [np.linalg.norm(header["tools"][0]["force"]) for header in (deep, deeper)]
            assert size[0] <= size[1] < 1.15 * size[0]
            assert deeper["tools"][0]["wanted"] == pytest.approx((over - [0, 0, 0.024]).tolist(), abs=1e-6)
            assert deeper["tools"][0]["position"][2] > over[2] - 0.01
            await client.say(type="release")
            header, _ = await client.frame_where(lambda h: h["contacts"] == [])
            assert header["tools"][0]["wanted"] is None

    asyncio.run(session())


def test_two_fingers_on_one_body_are_one_solve(block, block_green):
    """Both presses feel each other: `K u = sum w_i f_i` with `w_i . u = d_i`, by scikit-fem's matrix and SciPy."""
    finger = {"contact": "patch", "radius": 5e-3, "contact_radius": 12e-3}
    built = BuiltScene.of(palpate.Scene(body={"store": "block.palpate"}, tool=[finger, finger]), block, block_green)
    places = np.array([[0.03, 0.015, 0.05], [0.07, 0.035, 0.05]])
    depths = np.array([[0, 0, -1e-3], [0, 0, -2e-3]])

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            alone = []
            for tools in ([0], [1], [0, 1]):
                for tool in tools:
                    for depth in (-depths[tool], depths[tool]):
                        target = places[tool] + [0, 0, 5e-3] + depth
                        await client.say(type="press", tool=tool, position=target.tolist(), grab=False)
                        await client.receive("frame")
                count = len(tools)
                header, _ = await settled(client, lambda h, n=count: h["time"] > 0.6 and len(h["contacts"]) == n)
                forces = np.array([header["tools"][tool]["force"] for tool in tools])
                alone.append(forces)
                contacts = server._session.simulation.contacts()
                if count == 1:
                    await client.say(type="release", tool=tools[0])
                    await client.frame_where(lambda h: h["contacts"] == [])
            return alone, contacts

    (first, second, both), contacts = asyncio.run(session())
    contacts.sort(key=lambda contact: contact.tool)
    assert np.abs(both[0] - first[0]).max() > 0.02 * np.linalg.norm(first)
    assert np.abs(both[1] - second[0]).max() > 0.02 * np.linalg.norm(second)
    assert -both == pytest.approx(forces_of(block, contacts), rel=1e-3, abs=1e-4)


def forces_of(body, contacts) -> np.ndarray:
    """Forces (c, 3) on a body that give its patches the displacements of their tools."""
    dofs, axes = 3 * len(body.mesh.nodes), np.arange(3)
    weights = np.zeros((dofs, 3 * len(contacts)))
    for rank, contact in enumerate(contacts):
        for axis in axes:
            weights[3 * contact.nodes + axis, 3 * rank + axis] = contact.weights
    free = np.setdiff1d(np.arange(dofs), (3 * body.fixed_nodes[:, None] + axes).ravel())
    moved = scipy.sparse.linalg.spsolve(skfem_stiffness(body)[free][:, free].tocsc(), weights[free])
    given = np.concatenate([contact.displacement for contact in contacts])
    return np.linalg.solve(weights[free].T @ moved, given).reshape(-1, 3)
