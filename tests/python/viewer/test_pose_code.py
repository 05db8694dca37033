"""Poses in 16 bits: how far they are off, what is sent of them, and that differences add up to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.viewer import messages
from palpate.viewer.pose_code import PoseCoder, PoseReader

EXTENT, ROWS = 0.2, 500


def sent(coder: PoseCoder, frame: int, displacements: np.ndarray, scalar: np.ndarray):
    """Header and arrays as they come out of a message, and its length in bytes less that of the header."""
    coded = coder.code(frame, [(displacements, scalar, EXTENT)])
    message = messages.encode({"poses": coded.headers}, messages.by_body(coded.arrays))
    header, arrays = messages.decode(message)
    return header, arrays, sum(array.nbytes for array in arrays.values())


def pose(rng: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray]:
    return size * rng.uniform(-1, 1, (ROWS, 3)), rng.integers(0, 256, ROWS).astype(float)


@pytest.mark.parametrize(("size", "bound"), [(1e-3, 3.9e-6), (0.24, 3.9e-6), (1.0, 1.53e-5), (30.0, 1.53e-5 * 32)])
def test_a_displacement_is_off_by_half_a_step(size, bound):
    """``bound`` is over the extent of the body, ``size`` the largest displacement over it."""
    displacements, scalar = pose(np.random.default_rng(1), size * EXTENT)
    header, arrays, _ = sent(PoseCoder(), 1, displacements, scalar)
    read = PoseReader().read(header, arrays)
    off = np.abs(read["0/displacements"] - displacements).max()
    assert off <= bound * EXTENT
    # A step is as large as it is told to be: half of it is met by some of 1500 numbers.
    assert off == pytest.approx(header["poses"][0]["step"] / 2, rel=0.02)
    assert np.array_equal(read["0/scalar"], scalar)


def test_differences_add_up_to_the_bit_and_carry_what_has_moved():
    rng, coder, reader = np.random.default_rng(2), PoseCoder(), PoseReader()
    displacements, scalar = pose(rng, 0.1 * EXTENT)
    lengths = []
    for frame in range(1, 30):
        moved = rng.choice(ROWS, 20, replace=False)
        # Jumps across all of the range, so that differences wrap.
        displacements[moved] = 0.24 * EXTENT * rng.uniform(-1, 1, (20, 3))
        scalar[rng.choice(ROWS, 5, replace=False)] = 7
        header, arrays, length = sent(coder, frame, displacements, scalar)
        read = reader.read(header, arrays)
        alone, theirs, _ = sent(PoseCoder(), frame, displacements, scalar)
        whole = PoseReader().read(alone, theirs)
        assert alone["poses"][0]["base"] is None
        assert header["poses"][0]["base"] == (None if frame == 1 else frame - 1)
        assert all(np.array_equal(read[name], whole[name]) for name in whole)
        lengths.append(length)
    assert lengths[0] == 7 * ROWS
    assert max(lengths[1:]) <= 6 * 20 + 5 + 2 * -(-ROWS // 8)
    # Nothing moves, nothing but the masks is sent; a small motion takes a byte a number.
    assert sent(coder, 30, displacements, scalar)[2] == 2 * -(-ROWS // 8)
    assert sent(coder, 31, displacements + 1e-4 * EXTENT, scalar)[2] == 3 * ROWS + 2 * -(-ROWS // 8)


def test_another_step_another_mesh_and_a_lost_frame_are_whole():
    rng, coder = np.random.default_rng(3), PoseCoder()
    displacements, scalar = pose(rng, 0.1 * EXTENT)
    bases = [sent(coder, frame, displacements, scalar)[0]["poses"][0]["base"] for frame in (1, 2)]
    bases.append(sent(coder, 3, 9 * displacements, scalar)[0]["poses"][0]["base"])
    bases.append(sent(coder, 4, 9 * displacements[:-1], scalar[:-1])[0]["poses"][0]["base"])
    coder.forget()
    bases.append(sent(coder, 5, 9 * displacements[:-1], scalar[:-1])[0]["poses"][0]["base"])
    assert bases == [None, 1, None, None, None]
