"""The paper's equations 3.2 to 3.10, read literally and corrected, against a direct solve on a small dense problem.

`K`, `Psi`, `A`, `Ab`, `E`, `v` and `vb` are those of docs/theory.md: `D` supported dofs,
`N` free ones, `S` those whose condition changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from conftest import box_mesh, direct_solve, relative, skfem_stiffness

import palpate

EXACT, WRONG = 1e-9, 0.1


@dataclass
class Problem:
    """A supported block, loads, a pressed node; all solved directly."""

    body: palpate.Body
    green: palpate.GreensFunction
    K: np.ndarray
    D: np.ndarray
    S: np.ndarray
    loads: np.ndarray
    prescribed: np.ndarray
    u: np.ndarray
    f: np.ndarray

    @property
    def identity(self) -> np.ndarray:
        return np.eye(len(self.K))

    @property
    def E(self) -> np.ndarray:
        return self.identity[:, self.S]

    @property
    def fixed(self) -> np.ndarray:
        """Dofs with a known displacement in the new problem."""
        return np.union1d(self.D, self.S)

    @property
    def v(self) -> np.ndarray:
        """The answer: forces where displacements are known, displacements elsewhere (3.5 corrected)."""
        return np.where(np.isin(np.arange(len(self.K)), self.fixed), self.f, self.u)

    @property
    def vb(self) -> np.ndarray:
        """The knowns of the new problem (3.5 corrected)."""
        return np.where(np.isin(np.arange(len(self.K)), self.fixed), self.u, self.loads)

    def columns(self) -> tuple[np.ndarray, np.ndarray]:
        """`A` and `Ab` of the reference problem (3.2 corrected): columns on the supports, `A v + Ab vb = 0`."""
        A, Ab = self.K.copy(), -self.identity
        A[:, self.D], Ab[:, self.D] = -self.identity[:, self.D], self.K[:, self.D]
        return A, Ab

    def printed(self) -> np.ndarray:
        """`A0` as printed in 3.2: rows of the identity on the supports."""
        A0 = self.K.copy()
        A0[self.D] = self.identity[self.D]
        return A0

    def psi(self) -> np.ndarray:
        A, Ab = self.columns()
        return -np.linalg.solve(A, Ab)


@pytest.fixture(scope="module")
def problem(tmp_path_factory) -> Problem:
    mesh = box_mesh(cells=(2, 2, 2), seed=5)
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.35), fixed=lambda p: p[:, 0] < 1e-9)
    green = palpate.precompute(body, precision="f64", path=tmp_path_factory.mktemp("errata") / "block.palpate")
    rng = np.random.default_rng(11)
    K = skfem_stiffness(body).toarray()
    loaded, pressed = np.setdiff1d(mesh.surface_nodes, body.fixed_nodes)[[3, 8]]
    S = 3 * pressed + np.arange(3)
    loads, prescribed = np.zeros(len(K)), np.zeros(len(K))
    loads[3 * loaded : 3 * loaded + 3] = 0.05 * rng.normal(size=3)
    prescribed[S] = 2e-3 * rng.normal(size=3)
    u, f = direct_solve(body, {d: prescribed[d] for d in np.union1d(body.fixed_dofs, S)}, loads)
    return Problem(body, green, K, body.fixed_dofs, S, loads, prescribed, u.ravel(), f.ravel())


def test_3_2_rows_of_the_identity_return_the_known_displacement_instead_of_the_reaction(problem):
    rng = np.random.default_rng(1)
    knowns = problem.loads.copy()
    knowns[problem.D] = 1e-3 * rng.normal(size=len(problem.D))
    u, f = direct_solve(problem.body, {d: knowns[d] for d in problem.D}, problem.loads)
    literal = np.linalg.solve(problem.printed(), knowns)
    assert relative(literal[problem.D], knowns[problem.D]) <= EXACT
    assert relative(literal[problem.D], f.ravel()[problem.D]) >= WRONG
    A, Ab = problem.columns()
    corrected = np.linalg.solve(A, -Ab @ knowns)
    assert relative(corrected[problem.D], f.ravel()[problem.D]) <= EXACT
    free = np.setdiff1d(np.arange(len(problem.K)), problem.D)
    assert relative(corrected[free], u.ravel()[free]) <= EXACT


def test_3_3_the_inverse_is_the_greens_function_on_free_rows_only(problem):
    literal, psi = np.linalg.inv(problem.printed()), problem.psi()
    free = np.setdiff1d(np.arange(len(problem.K)), problem.D)
    assert relative(literal[free], psi[free]) <= EXACT
    assert relative(literal[problem.D], psi[problem.D]) >= WRONG
    K, D, N = problem.K, problem.D, free
    blocks = np.empty_like(K)
    inverse = np.linalg.inv(K[np.ix_(N, N)])
    blocks[np.ix_(N, N)] = inverse
    blocks[np.ix_(N, D)] = -inverse @ K[np.ix_(N, D)]
    blocks[np.ix_(D, N)] = K[np.ix_(D, N)] @ inverse
    blocks[np.ix_(D, D)] = K[np.ix_(D, D)] - K[np.ix_(D, N)] @ inverse @ K[np.ix_(N, D)]
    assert relative(psi, blocks) <= EXACT


def test_the_stored_operator_is_the_corrected_one(problem):
    psi, surface = problem.psi(), problem.body.mesh.surface_nodes
    dofs = (3 * surface[:, None] + np.arange(3)).ravel()
    rows, columns = range(0, len(dofs), 5), range(0, len(dofs), 4)
    stored = np.array([[problem.green._core.entry(i, j) for j in columns] for i in rows])
    assert relative(stored, psi[np.ix_(dofs[rows], dofs[columns])]) <= EXACT


def test_3_4_and_3_6_printed_do_not_solve_the_new_problem(problem):
    E, identity = problem.E, problem.identity
    A0 = problem.printed()
    literal = np.linalg.solve(A0 + (identity - A0) @ E @ E.T, problem.vb)
    assert relative(literal, problem.v) >= WRONG
    # 3.4 alone is wrong too: with the right A it still lacks the operator on the knowns.
    A, Ab = problem.columns()
    swapped, swapped_b = A + (Ab - A) @ E @ E.T, Ab + (A - Ab) @ E @ E.T
    assert relative(np.linalg.solve(swapped, problem.vb), problem.v) >= WRONG
    assert relative(np.linalg.solve(swapped, -swapped_b @ problem.vb), problem.v) <= EXACT


def test_3_5_printed_exchanges_knowns_and_unknowns(problem):
    """As printed, `v` would hold the displacements of the supports and `vb` the forces there, which nobody knows."""
    E = problem.E
    A, Ab = problem.columns()
    swapped, swapped_b = A + (Ab - A) @ E @ E.T, Ab + (A - Ab) @ E @ E.T
    fixed = np.isin(np.arange(len(problem.K)), problem.fixed)
    printed_v, printed_vb = np.where(fixed, problem.u, problem.f), np.where(fixed, problem.f, problem.u)
    assert relative(swapped @ problem.v, -swapped_b @ problem.vb) <= EXACT
    scale = np.abs(swapped_b @ printed_vb).max()
    assert np.abs(swapped @ printed_v + swapped_b @ printed_vb).max() >= WRONG * scale


def test_3_6_sign(problem):
    E, identity = problem.E, problem.identity
    A, _ = problem.columns()
    wanted = A.copy()
    wanted[:, problem.S] = -identity[:, problem.S]
    assert np.array_equal(A - (identity + A) @ E @ E.T, wanted)
    printed = A + (identity - A) @ E @ E.T
    assert np.array_equal(printed[:, problem.S], -wanted[:, problem.S])  # its unknown is minus the contact force


def test_3_7_printed_is_not_the_inverse(problem):
    E, identity, psi = problem.E, problem.identity, problem.psi()
    A, _ = problem.columns()
    swapped = A - (identity + A) @ E @ E.T
    C = -E.T @ psi @ E
    with pytest.raises(ValueError, match="mismatch"):
        (identity + psi) @ E @ np.linalg.inv(C) @ E  # the last factor must be E^T to have a shape at all
    bracket = identity + (identity + psi) @ E @ np.linalg.solve(C, E.T)
    assert relative(bracket @ swapped, identity) >= WRONG
    assert relative(bracket @ np.linalg.inv(A) @ swapped, identity) <= EXACT


def formulas_3_8_to_3_10(psi: np.ndarray, E: np.ndarray, vb: np.ndarray) -> np.ndarray:
    C = -E.T @ psi @ E
    EE = E @ E.T
    v0 = (psi @ (np.eye(len(psi)) - EE) - EE) @ vb
    return v0 + (E + psi @ E) @ np.linalg.solve(C, E.T @ v0)


def test_3_8_to_3_10_hold_with_the_corrected_greens_function(problem):
    assert relative(formulas_3_8_to_3_10(problem.psi(), problem.E, problem.vb), problem.v) <= EXACT


def test_3_8_to_3_10_with_the_printed_one_give_no_reactions(problem):
    literal = formulas_3_8_to_3_10(np.linalg.inv(problem.printed()), problem.E, problem.vb)
    others = np.setdiff1d(np.arange(len(problem.K)), problem.D)
    assert relative(literal[others], problem.v[others]) <= EXACT
    assert np.abs(literal[problem.D]).max() <= EXACT * np.abs(problem.v[problem.D]).max()


def test_releasing_a_support_fails_with_the_printed_one(problem):
    released = problem.D[-3:]
    E = problem.identity[:, released]
    literal = np.linalg.inv(problem.printed())
    assert np.allclose(E.T @ literal @ E, np.eye(3))
    kept = np.setdiff1d(problem.D, released)
    u, f = (x.ravel() for x in direct_solve(problem.body, dict.fromkeys(kept.tolist(), 0.0), problem.loads))
    fixed = np.isin(np.arange(len(problem.K)), kept)
    v, vb = np.where(fixed, f, u), np.where(fixed, u, problem.loads)
    assert relative(formulas_3_8_to_3_10(literal, E, vb), v) >= WRONG
    assert relative(formulas_3_8_to_3_10(problem.psi(), E, vb), v) <= EXACT
    answer = problem.green.solve(forces=_by_node(problem.loads), release=np.unique(released // 3))
    surface = problem.body.mesh.surface_nodes
    assert relative(answer.displacements, u.reshape(-1, 3)[surface]) <= EXACT
    assert relative(answer.forces, f.reshape(-1, 3)[surface]) <= EXACT


def test_solve_equals_the_direct_solve(problem):
    answer = problem.green.solve(forces=_by_node(problem.loads), displacements=_by_node(problem.prescribed))
    surface = problem.body.mesh.surface_nodes
    assert relative(answer.displacements, problem.u.reshape(-1, 3)[surface]) <= EXACT
    assert relative(answer.forces, problem.f.reshape(-1, 3)[surface]) <= EXACT
    assert relative(answer.reactions, problem.f.reshape(-1, 3)[problem.body.fixed_nodes]) <= EXACT


def _by_node(values: np.ndarray) -> dict[int, np.ndarray]:
    rows = values.reshape(-1, 3)
    return {int(n): rows[n] for n in np.flatnonzero(rows.any(axis=1))}
