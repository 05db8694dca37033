from __future__ import annotations

import faulthandler
import os
from collections import Counter

import numpy as np
import pytest
import scipy.sparse.linalg

import palpate
from palpate.mesh import TetMesh

# Standard error of the process itself, whatever captures that of a test.
STDERR = pytest.StashKey()
# What tests of the page share.
SHARED_BROWSER = pytest.StashKey()


def pytest_addoption(parser):
    parser.addoption(
        "--no-skips", action="store_true", help="a skipped test is a failure, as on a machine with all tools"
    )
    parser.addoption("--whole", action="store_true", help="campaigns with all of their cases, for about an hour")
    parser.addoption("--part", default="0/1", help="of the files with slow tests, part K of N: K/N, K from 0 on")


def pytest_configure(config):
    """Nothing is captured now; while this file was imported, it was."""
    config.stash[STDERR] = os.dup(2)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    outcome = yield
    report = outcome.get_result()
    if report.skipped and not hasattr(report, "wasxfail") and item.config.getoption("--no-skips"):
        report.outcome = "failed"
        report.longrepr = (
            f"skipped, and --no-skips was given: {call.excinfo.value if call.excinfo else report.longrepr}"
        )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """End the process of a test that outlasts its limit by a minute, with all stacks printed: another takes its place.

    pytest-timeout raises an exception, which Playwright's event loop swallows, and code that holds the interpreter's
    lock never sees.
    """
    marker = item.get_closest_marker("timeout")
    limit = float(marker.args[0] if marker and marker.args else item.config.getini("timeout"))
    faulthandler.dump_traceback_later(limit + 60, exit=True, file=item.config.stash[STDERR])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Close the shared browser before the first test that needs none or starts its own: its event loop is that of the
    thread, and no other can run, and its program computes a thousand ticks a second.
    """
    shared = item.config.stash.get(SHARED_BROWSER, None)
    marker = item.get_closest_marker("browser")
    if shared is not None and (marker is None or marker.kwargs.get("own", False)):
        shared.close()


def beyond_share(items, name: str, slow: bool) -> list:
    """Slow cases, or the others, of tests with the marker ``name(every)``, but for one in ``every``, evenly spread."""
    seen, found = Counter(), []
    for item in items:
        marker = item.get_closest_marker(name)
        if marker is not None and (item.get_closest_marker("slow") is not None) == slow:
            if seen[item.function] % marker.args[0]:
                found.append(item)
            seen[item.function] += 1
    return found


def of_other_parts(config, items) -> list:
    """Slow tests of files that are not of the wanted part."""
    part, parts = map(int, config.getoption("--part").split("/"))
    slow = [item for item in items if item.get_closest_marker("slow")]
    # Browsers share one process, so each part gets as many of their files as the others.
    browsers = {item.path for item in items if item.get_closest_marker("browser")}
    files = sorted({item.path for item in slow}, key=lambda path: (path not in browsers, path.name, path))
    wanted = set(files[part::parts])
    return [item for item in slow if item.path not in wanted]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """What a worker takes on is a file, but for browsers: all in one, for two that draw in software starve each other.

    The browsers come first and then files with slow tests, so that no worker is left with a long one at the end.
    """
    for item in beyond_share(items, "quick", slow=False):
        item.add_marker("slow")
    left_out = set(of_other_parts(config, items))
    if not config.getoption("--whole"):
        left_out.update(beyond_share(items, "campaign", slow=True))
    config.hook.pytest_deselected(items=[item for item in items if item in left_out])
    items[:] = [item for item in items if item not in left_out]
    slow = {item.path for item in items if item.get_closest_marker("slow")}

    def rank(item) -> int:
        return 0 if item.get_closest_marker("browser") else 1 if item.path in slow else 2

    items.sort(key=rank)
    for item in items:
        item.add_marker(pytest.mark.xdist_group("browser" if rank(item) == 0 else str(item.path)))


def pytest_collection_finish(session):
    """Refuse versions of pytest and xdist between which groups are lost: xdist appends them to the names of tests."""
    lost = [item.nodeid for item in session.items if "@" not in item.nodeid]
    if getattr(session.config.option, "loadgroup", False) and lost:
        raise pytest.UsageError(f"xdist does not group the tests: {lost[0]}; 'pip install \"pytest<9.2\"'")


def box_mesh(cells=(4, 3, 3), size=(0.08, 0.05, 0.05), jitter=0.15, seed=1) -> TetMesh:
    """Box of tetrahedra (scikit-fem's), interior nodes moved at random: independent of our own mesher."""
    import skfem

    axes = [np.linspace(0, s, c + 1) for s, c in zip(size, cells, strict=True)]
    mesh = skfem.MeshTet.init_tensor(*axes)
    nodes, tets = mesh.p.T.copy(), mesh.t.T.copy()
    inside = np.ones(len(nodes), dtype=bool)
    for k in range(3):
        inside &= (nodes[:, k] > 1e-9) & (nodes[:, k] < size[k] - 1e-9)
    step = np.array(size) / np.array(cells)
    nodes[inside] += jitter * step * np.random.default_rng(seed).uniform(-1, 1, (inside.sum(), 3))
    return TetMesh(nodes, tets)


def bent(mesh: TetMesh) -> TetMesh:
    """The mesh with all nodes moved by a smooth map: the edges of 10-node tetrahedra become curved."""
    x, y, z = mesh.nodes.T / 0.08
    moved = np.stack([x + 0.2 * y * z, y + 0.3 * x**2, z + 0.25 * np.sin(2 * x) * (1 + y)], axis=1)
    return TetMesh(0.08 * moved, mesh.tets, mesh.regions)


def tet_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Product of Gauss-Jacobi rules on the reference tetrahedron, exact to degree ``2 count - 1``: points, weights.

    scikit-fem's own tables miss their degree by one from 5 on.
    """
    from scipy.special import roots_jacobi

    (u, wu), (v, wv), (w, ww) = (roots_jacobi(count, power, 0) for power in (2, 1, 0))
    u, v, w = np.meshgrid((1 + u) / 2, (1 + v) / 2, (1 + w) / 2, indexing="ij")
    weights = np.einsum("i,j,k->ijk", wu / 8, wv / 4, ww / 2)
    return np.stack([u, (1 - u) * v, (1 - u) * (1 - v) * w]).reshape(3, -1), weights.ravel()


def skfem_basis(mesh: TetMesh, points: int = 3):
    """scikit-fem's basis of vector fields, and its dof for each of ours."""
    import skfem

    nodes, tets, rule = mesh.nodes.T.copy(), mesh.tets.T.copy(), tet_rule(points)
    if mesh.is_quadratic:
        basis = skfem.Basis(skfem.MeshTet2(nodes, tets), skfem.ElementVector(skfem.ElementTetP2()), quadrature=rule)
    else:
        basis = skfem.Basis(skfem.MeshTet(nodes, tets), skfem.ElementVector(skfem.ElementTetP1()), quadrature=rule)
    order = np.empty(basis.N, dtype=int)
    order[(3 * tets[:, None, :] + np.arange(3)[:, None]).reshape(-1, tets.shape[1])] = basis.element_dofs
    return basis, order


def skfem_stiffness(body: palpate.Body, points: int = 3):
    """Stiffness by scikit-fem, node-major dofs."""
    import skfem
    from skfem.helpers import ddot, eye, sym_grad, trace

    e, nu = body.element_materials[:, 0], body.element_materials[:, 1]
    lam, mu = nu * e / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    basis, order = skfem_basis(body.mesh, points)

    @skfem.BilinearForm
    def form(u, v, w):
        strain = sym_grad(u)
        stress = lam[:, None] * eye(trace(strain), 3) + 2 * mu[:, None] * strain
        return ddot(stress, sym_grad(v))

    return form.assemble(basis).tocsc()[order][:, order]


def skfem_mass(body: palpate.Body, points: int = 3):
    """Consistent mass by scikit-fem, node-major dofs."""
    import skfem
    from skfem.helpers import dot

    density = body.element_materials[:, 2]
    basis, order = skfem_basis(body.mesh, points)
    form = skfem.BilinearForm(lambda u, v, w: density[:, None] * dot(u, v))
    return form.assemble(basis).tocsc()[order][:, order]


def direct_solve(body, prescribed: dict[int, float], loads: np.ndarray):
    """Displacements and K u of all dofs, by SciPy on scikit-fem's matrix."""
    K = skfem_stiffness(body)
    dofs = np.array(sorted(prescribed))
    free = np.setdiff1d(np.arange(K.shape[0]), dofs)
    u = np.zeros(K.shape[0])
    u[dofs] = [prescribed[d] for d in dofs]
    u[free] = scipy.sparse.linalg.spsolve(K[free][:, free], loads[free] - K[free][:, dofs] @ u[dofs])
    return u.reshape(-1, 3), (K @ u).reshape(-1, 3)


def relative(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


@pytest.fixture(autouse=True)
def private_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def rounds(request):
    """How many rounds a campaign takes: ``rounds(12)`` are 12 with ``--whole``, else an eighth of them."""
    return lambda count: count if request.config.getoption("--whole") else -(-count // 8)


@pytest.fixture(scope="session")
def block() -> palpate.Body:
    mesh = box_mesh()
    return palpate.Body(mesh, material=palpate.Material(10e3, 0.4, 1000.0), fixed=lambda p: p[:, 0] < 1e-9)


@pytest.fixture(scope="session")
def block_green(block, tmp_path_factory) -> palpate.GreensFunction:
    return palpate.precompute(block, precision="f64", path=tmp_path_factory.mktemp("green") / "block.palpate")


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    """A cache for all tests of a run, whichever worker they are in: stores come by rename, so that two may make one."""
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    shared.mkdir(exist_ok=True)
    return shared


@pytest.fixture
def shared_cache(cache, monkeypatch, private_cache):
    """The cache of all tests in place of one of this test's."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))


@pytest.fixture(scope="session")
def shared_browser(cache, request):
    """A browser and a program for all tests of the page, which come first."""
    from browser import SharedBrowser

    request.config.stash[SHARED_BROWSER] = shared = SharedBrowser(cache)
    yield shared
    shared.close()


@pytest.fixture(scope="module")
def chromium(shared_browser):
    return shared_browser.chromium()


@pytest.fixture(scope="module")
def program(shared_browser):
    """The demo of the paper's liver, with a page; it ends cleanly by Ctrl-C."""
    return shared_browser.program()


@pytest.fixture
def page(chromium, program, request):
    """A page of the module's ``program``, as sharp as its ``SHARPNESS``."""
    from browser import opened

    with opened(chromium, program, sharpness=getattr(request.module, "SHARPNESS", 0.25)) as page:
        yield page
