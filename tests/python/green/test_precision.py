"""Stated errors of answers against direct solves to more digits, over random bodies and those known to be hard."""

from __future__ import annotations

import contextlib
import json
import warnings

import numpy as np
import pytest
from command_line import run
from conftest import box_mesh
from random_bodies import DirectSolver, glued_mesh, random_body, random_change

import palpate
from palpate.green.bounds import CHOSEN, REFUSED, WARNED, check_error

FORMATS = ("f16", "f32", "f64")
# Random bodies; the hundred are a campaign.
BODIES = [30, pytest.param(100, marks=pytest.mark.slow)]


@contextlib.contextmanager
def without_refusals():
    """Give answers whatever their error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("palpate.green.function.check_error", lambda *_, **__: None)
        yield


def compliance(body: palpate.Body, precision: str | None, folder) -> palpate.GreensFunction:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", palpate.PrecisionWarning)
        return palpate.precompute(body, precision=precision, path=folder / f"{precision}.palpate", progress=False)


def relative(value: np.ndarray, right: np.ndarray) -> float:
    largest = np.abs(right).max(initial=0.0)
    difference = np.abs(value - right).max(initial=0.0)
    return difference / largest if largest > 0 else difference


def error_of_change(green, change: dict, right: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
    """Stated and true error of a solve; infinite where no number is right."""
    try:
        answer, (u, f) = green.solve(**change), right
    except palpate.PrecisionError:
        return np.inf, np.inf
    surface, fixed = green.surface_nodes, green.fixed_nodes
    forces = np.concatenate([answer.forces, answer.reactions])
    true = max(relative(answer.displacements, u[surface]), relative(forces, np.concatenate([f[surface], f[fixed]])))
    return answer.error, true


def error_of_touch(green, touch: tuple, right: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
    """Stated and true error of a touch."""
    answer, (force, u) = green.touch(*touch), right
    return answer.error, max(relative(answer.force, force), relative(answer.displacements, u[green.surface_nodes]))


def random_touch(rng: np.random.Generator, body: palpate.Body) -> tuple:
    free = np.setdiff1d(body.mesh.surface_nodes, body.fixed_nodes)
    displacement = [float(d) if rng.random() < 0.8 else None for d in 1e-3 * rng.normal(size=3)]
    displacement[0] = 1e-3 if displacement == [None] * 3 else displacement[0]
    radius = float(rng.choice([0.0, 0.05, 0.2, 0.4])) * np.ptp(body.mesh.nodes, axis=0).max()
    return body.mesh.nodes[rng.choice(free)], displacement, radius


@pytest.fixture(scope="module", params=BODIES)
def random_errors(request, tmp_path_factory) -> dict[str, np.ndarray]:
    """Stated and true errors (answers, 2) of each format, over all random bodies."""
    with without_refusals():
        errors = measured_errors(request.param, tmp_path_factory.mktemp("random"))
    assert all(len(found) > 4.5 * request.param for found in errors.values())
    return errors


def measured_errors(bodies: int, folder) -> dict[str, np.ndarray]:
    errors: dict[str, list] = {name: [] for name in FORMATS}
    for seed in range(bodies):
        rng = np.random.default_rng([20, seed])
        body = random_body(rng)
        solver = DirectSolver(body)
        greens = [compliance(body, name, folder) for name in FORMATS]
        changes = [(change, solver.change(change)) for change in (random_change(rng, body) for _ in range(3))]
        touches = [random_touch(rng, body) for _ in range(2)]
        touched = [(touch, solver.touch(greens[-1], *touch)) for touch in touches]
        for green in greens:
            found = errors[green.precision]
            for change, right in changes:
                try:
                    found.append(error_of_change(green, change, right))
                except palpate.BodyError as refusal:
                    assert change.get("release") and "free to move" in str(refusal)
            found += [error_of_touch(green, touch, right) for touch, right in touched]
    return {name: np.array(found) for name, found in errors.items()}


@pytest.mark.parametrize("precision", FORMATS)
def test_every_answer_of_random_bodies_is_within_its_stated_error(random_errors, precision):
    stated, true = random_errors[precision].T
    # Beyond all of it an error has no size: it is not small beside what it is estimated from.
    assert ((true <= stated) | (stated > 1)).all()
    # A bound that everything is within says nothing: a hundred times too high for half of the answers at most.
    meant = (true > 0) & np.isfinite(true)
    assert np.median(stated[meant] / true[meant]) < 100


def test_few_answers_in_double_precision_are_refused(random_errors):
    assert (random_errors["f64"][:, 0] > WARNED).mean() < 0.01
    assert (random_errors["f32"][:, 0] > WARNED).mean() < 0.1


@pytest.mark.parametrize("precision", FORMATS)
def test_a_stated_error_that_is_too_small_would_be_found(random_errors, precision):
    stated, true = random_errors[precision].T
    assert (true > stated / 30).any()


def half_stiff(contrast: float) -> palpate.Body:
    """A block, its far half stiffer, held at its near face."""
    mesh = box_mesh(cells=(6, 3, 3), size=(0.08, 0.04, 0.04))
    stiff = (mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.04).astype(int)
    materials = {0: palpate.Material(1e4, 0.4), 1: palpate.Material(1e4 * contrast, 0.4)}
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, stiff)
    return palpate.Body(mesh, material=materials, fixed=lambda p: p[:, 0] < 1e-9)


def slender(length: int = 30) -> palpate.Body:
    """A uniform rod, ``length`` times as long as thick, along no axis."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    mesh, points = glued_mesh(np.array([[i, 0, 0] for i in range(length)]), 1, lambda p: 0.01 * p @ turn.T)
    return palpate.Body(mesh, material=palpate.Material(1e4, 0.3), fixed=points[:, 0] == 0)


def hard_changes(body: palpate.Body) -> list[dict]:
    """Stamps and single nodes at the far end, pushed as one and by chance."""
    rng = np.random.default_rng(1)
    free = np.setdiff1d(body.mesh.surface_nodes, body.fixed_nodes)
    held = body.mesh.nodes[body.fixed_nodes].mean(axis=0)
    far = free[np.argsort(-np.linalg.norm(body.mesh.nodes[free] - held, axis=1))]
    along = body.mesh.nodes[far[0]] - held
    changes = []
    for count in (1, 2, 4, 12):
        push = 1e-3 * along / np.linalg.norm(along)
        changes.append({"displacements": {int(n): push for n in far[:count]}, "forces": {}})
        changes.append({"displacements": {int(n): 1e-3 * rng.normal(size=3) for n in far[:count]}, "forces": {}})
    return changes


@pytest.mark.parametrize("precision", FORMATS)
@pytest.mark.parametrize(
    "make",
    [
        lambda: half_stiff(1.0),
        lambda: half_stiff(1e2),
        lambda: half_stiff(1e4),
        lambda: half_stiff(1e5),
        lambda: half_stiff(1e6),
        slender,
    ],
)
def test_hard_bodies_are_answered_within_their_stated_error(make, precision, tmp_path):
    body = make()
    solver, green = DirectSolver(body), compliance(body, precision, tmp_path)
    for change in hard_changes(body):
        with without_refusals():
            stated, true = error_of_change(green, change, solver.change(change))
        # Beyond all of it an error has no size: the entries' own errors are no longer small.
        assert true <= stated or stated > 1


@pytest.mark.parametrize("precision", ["f16", "f32"])
def test_no_answer_of_a_singular_capacitance_matrix_counts_as_exact(precision, tmp_path):
    """Nodes of a part a hundred million times stiffer move as one: in few bits their compliances are the same."""
    body = half_stiff(1e8)
    solver, green = DirectSolver(body), compliance(body, precision, tmp_path)
    free = np.setdiff1d(body.mesh.surface_nodes, body.fixed_nodes)
    stiff = free[body.mesh.nodes[free][:, 0] > 0.04]
    rng = np.random.default_rng(0)
    beyond = 0
    for _ in range(100):
        pushed = rng.choice(stiff, rng.integers(1, 6), replace=False)
        change = {"displacements": {int(n): 1e-3 * rng.normal(size=3) for n in pushed}, "forces": {}}
        with without_refusals():
            stated, true = error_of_change(green, change, solver.change(change))
        beyond += stated > 1
        assert true <= stated or stated > 1
    assert beyond > 50


@pytest.mark.parametrize(
    ("make", "precision", "wrong_by"),
    [
        (lambda: half_stiff(1e4), "f16", 0.5),
        (lambda: half_stiff(1e5), "f16", 1.0),
        (lambda: half_stiff(1e6), "f32", 0.03),
        (slender, "f16", 0.05),
    ],
)
def test_answers_that_were_wrong_without_a_word_are_warned_of_or_refused(make, precision, wrong_by, tmp_path):
    body = make()
    solver = DirectSolver(body)
    green, chosen = compliance(body, precision, tmp_path), compliance(body, None, tmp_path)
    worst = 0.0
    for change in hard_changes(body):
        right = solver.change(change)
        with without_refusals():
            _, true = error_of_change(green, change, right)
            in_chosen = error_of_change(chosen, change, right)
        worst = max(worst, true)
        if true > REFUSED:
            with pytest.raises(palpate.PrecisionError, match=r"compute the store with --precision f(32|64)"):
                green.solve(**change)
        elif true > WARNED:
            with pytest.raises((palpate.PrecisionError, palpate.PrecisionWarning), match="--precision f"):
                green.solve(**change)  # warnings are errors here
        # In the format that the body chooses all of them are right.
        assert in_chosen[1] < 1e-6 if chosen.precision == "f64" else in_chosen[1] < CHOSEN
    assert worst > wrong_by


def test_the_body_chooses_its_precision_and_says_so(tmp_path, capfd):
    uniform, contrast = compliance(half_stiff(1.0), None, tmp_path), compliance(half_stiff(1e4), None, tmp_path)
    assert (uniform.precision, contrast.precision) == ("f32", "f64")
    assert max(uniform.touch_error, uniform.stamp_error, contrast.touch_error, contrast.stamp_error) <= CHOSEN
    named = compliance(half_stiff(1.0), "f16", tmp_path)
    assert named.precision == "f16"
    assert max(named.touch_error, named.stamp_error) > CHOSEN
    # A store is that of its body whether its format was named or chosen.
    for green in (contrast, palpate.precompute(half_stiff(1e4), precision="f64", path=tmp_path / "same.palpate")):
        assert palpate.GreensFunction.load(green.path, body=half_stiff(1e4)).precision == "f64"
    half_stiff(1e4).mesh.write(tmp_path / "body.vtu")
    result = run("precompute", "body.vtu", "--fix", "x < 1mm", "-o", "body.palpate", cwd=tmp_path)
    assert "the precision is chosen by the body" in result.stdout
    line = next(line for line in result.stdout.splitlines() if line.startswith("precision f32: touches right to "))
    assert line in run("info", "body.palpate", cwd=tmp_path).stdout
    touched = run("touch", "body.palpate", "--point=8cm,2cm,2cm", "--press=-1mm,-,-", "--radius=1cm", cwd=tmp_path)
    assert "estimated error: " in touched.stdout


def test_where_only_supports_may_be_touched_single_precision_is_taken(block, tmp_path):
    held = np.intersect1d(block.mesh.surface_nodes, block.fixed_nodes)
    green = palpate.precompute(block, touch=held, path=tmp_path / "held.palpate", progress=False)
    assert green.precision == "f32"
    moved = green.solve(displacements={int(n): (1e-3, 0, 0) for n in held})
    assert np.abs(moved.displacements - [1e-3, 0, 0]).max() <= 1e-3 * moved.error < 1e-6


@pytest.mark.parametrize("length", [30, 100])
def test_a_named_precision_that_is_too_low_is_told_when_it_is_computed_and_when_a_loop_is_built(length, tmp_path):
    with pytest.warns(palpate.PrecisionWarning, match="touches of this body may be wrong by .*--precision f"):
        palpate.precompute(slender(length), precision="f16", path=tmp_path / "rod.palpate", progress=False)
    (tmp_path / "scene.toml").write_text('[body]\nstore = "rod.palpate"\n[tool]\nradius = "3mm"\n')
    scene = palpate.Scene.read(tmp_path / "scene.toml")
    expected = pytest.warns(palpate.PrecisionWarning) if length == 30 else pytest.raises(palpate.PrecisionError)
    with expected as caught:
        scene.build()
    message = str(caught[0].message if length == 30 else caught.value)
    assert message.startswith("forces on rod") and "--precision f" in message


def test_a_touch_of_a_slender_body_in_sixteen_bits_is_refused_in_one_line(tmp_path):
    green = compliance(slender(), "f16", tmp_path)
    tip = green.surface_positions[np.argmax(np.linalg.norm(green.surface_positions, axis=1))]
    with pytest.raises(palpate.PrecisionError, match=r"^the touch may be wrong by [^\n]*$"):
        green.touch(tip, (1e-3, 0, 0), 0.005)


def test_bounds_of_words():
    check_error(WARNED, "f32", "it", 1)
    with pytest.warns(palpate.PrecisionWarning, match=r"^it may be wrong by 1\.1 %: .*--precision f64"):
        check_error(1.1 * WARNED, "f32", "it", 1)
    with pytest.warns(palpate.PrecisionWarning, match="--precision f32"):
        check_error(1.1 * WARNED, "f16", "it", 1)
    for error in (1.1 * REFUSED, np.inf, np.nan):
        with pytest.raises(palpate.PrecisionError, match="double precision; bring materials closer"):
            check_error(error, "f64", "it", 1)


def test_a_store_of_the_format_before_is_refused_with_what_to_do(block_green, tmp_path):
    store = tmp_path / "old.palpate"
    block_green.save(store)
    content = store.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    header["__metadata__"]["version"] = "3"
    old = json.dumps(header).encode()
    store.write_bytes(len(old).to_bytes(8, "little") + old + content[8 + length :])
    with pytest.raises(palpate.StoreError, match="has format version 3, this program reads 5; compute it again"):
        palpate.GreensFunction.load(store)


def moved_supports(rng: np.random.Generator, body: palpate.Body) -> dict:
    """Some or all supports moved, each for itself, as one, or turned."""
    fixed = np.intersect1d(body.mesh.surface_nodes, body.fixed_nodes)
    count = int(rng.choice([1, 2, 3, max(1, len(fixed) // 2), len(fixed)]))
    moved = rng.permutation(fixed)[:count]
    shift, turn = 1e-3 * rng.normal(size=(2, 3))
    arms = (body.mesh.nodes[moved] - body.mesh.nodes[moved].mean(axis=0)) / 0.02
    ways = {
        "each": 1e-3 * rng.normal(size=(len(moved), 3)),
        "shifted": np.tile(shift, (len(moved), 1)),
        "turned": shift + np.cross(turn, arms),
    }
    way = ways[str(rng.choice(["each", "each", "shifted", "turned"]))]
    change = random_change(rng, body) if rng.random() < 0.2 else {"displacements": {}, "forces": {}}
    released = change.get("release", ())
    change["displacements"] |= {int(n): tuple(u) for n, u in zip(moved, way, strict=True) if n not in released}
    return change


def body_with_few_supports(rng: np.random.Generator) -> palpate.Body:
    """Up to three blocks of some cells, whose elements are of mixed materials, held at nodes anywhere."""
    blocks = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]])[: rng.integers(1, 4)]
    cells = 1 if len(blocks) > 1 else int(rng.integers(1, 4))
    mesh, _ = glued_mesh(blocks, cells, lambda p: 0.02 * (p + rng.uniform(-0.1, 0.1, p.shape) / cells))
    mixed = palpate.TetMesh(mesh.nodes, mesh.tets, rng.integers(0, 3, len(mesh.tets)))
    contrast = 10.0 ** rng.choice([0, 2, 4, 6])
    materials = {region: palpate.Material(1e4 * contrast ** rng.uniform(), 0.4) for region in range(3)}
    few = rng.permutation(len(mesh.nodes))[: int(rng.choice([3, 4, max(3, len(mesh.nodes) // 3)]))]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", palpate.LockingWarning)
        return palpate.Body(mixed, material=materials, fixed=few)


def errors_of_moved_supports(bodies: int, each: int, folder) -> dict[str, np.ndarray]:
    """Stated and true errors (answers, 2) of each format, those of forces that are rounding alone left out."""
    errors: dict[str, list] = {name: [] for name in FORMATS}
    for seed in range(bodies):
        rng = np.random.default_rng([21, seed])
        body = body_with_few_supports(rng) if rng.random() < 0.6 else random_body(rng)
        solver = DirectSolver(body)
        try:
            greens = [compliance(body, name, folder) for name in FORMATS]
        except palpate.BodyError:
            continue
        changes = [(change, solver.change(change)) for change in (moved_supports(rng, body) for _ in range(each))]
        largest = float(solver.K.diagonal().max())
        for change, (u, f) in changes:
            # Supports that move as one take no force: what the reference has is the rounding of its matrix.
            as_one = np.abs(f).max() < 1e-13 * largest * np.abs(u).max()
            right = (u, np.zeros_like(f) if as_one else f)
            for green in greens:
                with contextlib.suppress(palpate.BodyError):
                    stated, true = error_of_change(green, change, right)
                    if as_one:
                        true = relative(green.solve(**change).displacements, u[green.surface_nodes])
                    errors[green.precision].append((stated, true))
    return {name: np.array(found) for name, found in errors.items()}


@pytest.mark.parametrize(
    "bodies", [60, pytest.param(1000, marks=[pytest.mark.slow, pytest.mark.timeout(900)])], ids=["some", "5000"]
)
def test_answers_with_moved_supports_are_within_their_stated_error(bodies, tmp_path, rounds):
    bodies = rounds(bodies)
    with without_refusals():
        errors = errors_of_moved_supports(bodies, 5, tmp_path)
    for precision, (stated, true) in ((name, found.T) for name, found in errors.items()):
        assert len(stated) > 4.5 * bodies
        # The reference's own rounding: entries of its matrix, summed in another order, are other ones by 1e-16.
        worse = (true > np.maximum(stated, 1e-9)) & (stated <= 1)
        assert not worse.any(), (precision, stated[worse], true[worse])
        if precision != "f16":
            assert (stated > REFUSED).mean() < 0.05


def test_supports_that_move_as_one_take_no_force(tmp_path):
    """In any precision: the columns of the supports cancel each other, and rounding must not be left."""
    body = half_stiff(1e6)
    held = body.fixed_nodes
    turn = np.cross([3e-3, -2e-3, 1e-3], body.mesh.nodes[held]) + [1e-3, 2e-3, -1e-3]
    for precision in FORMATS:
        answer = compliance(body, precision, tmp_path).solve(
            displacements={int(n): u for n, u in zip(held, turn, strict=True)}
        )
        stiffest = body.stiffness().diagonal().max()
        assert np.abs(answer.forces).max() < 1e-11 * stiffest * np.abs(turn).max()
        expected = np.cross([3e-3, -2e-3, 1e-3], body.mesh.nodes[body.mesh.surface_nodes]) + [1e-3, 2e-3, -1e-3]
        assert np.abs(answer.displacements - expected).max() < 1e-12
        assert answer.error < 1e-3
