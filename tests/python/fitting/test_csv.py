"""Indentations from the exports of indenters: titles, units, separators, signs; one line for each mistake."""

from __future__ import annotations

import numpy as np
import pytest

import palpate

FORCE = np.array([0.0, 0.1, 0.3, 0.6, 1.0, 1.5])
DEPTH = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]) * 1e-3


def rows(force, depth, sep=",", decimal="."):
    return "\n".join(f"{d:.6g}{sep}{f:.6g}".replace(".", decimal) for f, d in zip(force, depth, strict=True))


@pytest.mark.parametrize(
    "text",
    [
        f"Depth (mm),Force (N)\n{rows(FORCE, 1e3 * DEPTH)}",
        f"Displacement [um]\tLoad [mN]\n{rows(1e3 * FORCE, 1e6 * DEPTH, chr(9))}",
        f"Depth um,Force mN\n{rows(1e3 * FORCE, 1e6 * DEPTH)}",
        f"depth_mm;force_N\n{rows(FORCE, 1e3 * DEPTH, ';', ',')}",
        f"Sample;7\n\nDepth/mm;Load/N\n{rows(FORCE, 1e3 * DEPTH, ';', ',')}\n\n",
        f"Extension,Load\n(mm),(N)\n{rows(FORCE, 1e3 * DEPTH)}",
        f"Depth (mm) Force (N)\n{rows(FORCE, 1e3 * DEPTH, '   ')}",
        f"Extension (mm),Load (N)\n{rows(-FORCE, -1e3 * DEPTH)}",
        f"Depth (µm),Force (N)\n{rows(FORCE, 1e6 * DEPTH)}",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_exports_are_read_by_their_header(tmp_path, text, encoding):
    path = tmp_path / "export.csv"
    path.write_text(text, encoding=encoding)
    read = palpate.Indentations.read(path)
    assert np.allclose(read.force, FORCE) and np.allclose(read.depth, DEPTH)


def test_places_time_and_radius_are_read_and_unloading_is_left_out(tmp_path):
    lines = ["Time (s),Site,x (mm),y (mm),z (mm),Indentation (mm),Force (mN),Diameter (mm)"]
    for site, x in (("left", 10), ("right", 30)):
        for k, depth in enumerate([0, 1, 2, 3, 4, 3, 2, 1, 0]):
            lines.append(f"{k},{site},{x},5,50,{depth},{100 * depth - (5 if k > 4 else 0)},12")
    path = tmp_path / "sites.csv"
    path.write_text("\n".join(lines))
    read = palpate.Indentations.read(path)
    assert read.names == ("left", "right") and read.radius == pytest.approx(0.006)
    assert np.allclose(read.points, [[0.01, 0.005, 0.05], [0.03, 0.005, 0.05]])
    loading = read.loading()
    assert len(loading.force) == 10 and loading.depth.max() == pytest.approx(0.004)
    # 4 x 100 mN over 4 mm is 0.8 mJ of work; 5 mN over the way back are lost.
    assert read.lost_energy()["left"] == pytest.approx((5 * 3 + 2.5) / 800, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Depth,Force\n1,2", r"m\.csv, line 1, column 'Force': no unit: give --force-unit"),
        ("Depth (mm),Force (N)\n1,2\n2,x", r"m\.csv, line 3, column 'Force \(N\)': 'x' is not a number"),
        ("Depth (mm),Force (N)\n1,2\n2", r"line 3, column 'Force \(N\)': nothing"),
        ("Depth (mm),Force (bar)\n1,2", "unknown unit 'bar'"),
        ("Depth (mm),Force (N),Force (N)\n1,2,3", "may both be the force: name one by --force-column"),
        ("a,b\n1,2", "no header with a force"),
        ("Depth (mm),Force (N)\n", "no rows"),
        ("Depth (mm),Force (N)\n1,2\n2,3", r"m\.csv: curve 1 needs 5 rows"),
        ("Depth (mm),Force (N),x (mm)\n1,2,3", "columns x, y and z"),
    ],
)
def test_mistakes_name_file_line_and_column(tmp_path, text, words):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(palpate.FitError, match=words) as caught:
        palpate.Indentations.read(path)
    assert "\n" not in str(caught.value)


def test_units_and_titles_can_be_given(tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("a,b,Force (N)\n" + "\n".join(f"{d},{f},0" for d, f in zip(1e3 * DEPTH, 1e3 * FORCE, strict=True)))
    read = palpate.Indentations.read(path, depth_column="a", force_column="b", force_unit="mN", depth_unit="mm")
    assert np.allclose(read.force, FORCE) and np.allclose(read.depth, DEPTH)
