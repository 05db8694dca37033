"""NRRD files, those of 3D Slicer (``.seg.nrrd``) among them: header by pynrrd, voxels with a bound on their size.

Format: https://teem.sourceforge.net/nrrd/format.html. Keys of segments: 3D Slicer's documentation, "Segmentations",
file format.
"""

from __future__ import annotations

import bz2
import re
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import nrrd
import numpy as np
from nrrd.reader import _TYPEMAP_NRRD2NUMPY as NAMES

from palpate.errors import MeshError
from palpate.input_file import reason_text
from palpate.segmentation.label_map import RawImage, Segment, require_size

# Bytes of a header; those of 3D Slicer have some tens of thousands.
MOST_HEADER = 4 << 20
CHUNK = 1 << 22

# Signs that turn the axes of a space into right, anterior, superior. Spaces without a patient are taken as they are.
SPACES = {
    "right-anterior-superior": (1, 1, 1),
    "left-anterior-superior": (-1, 1, 1),
    "left-posterior-superior": (-1, -1, 1),
    "scanner-xyz": (1, 1, 1),
    "3d-right-handed": (1, 1, 1),
}
SHORT = {"ras": "right-anterior-superior", "las": "left-anterior-superior", "lps": "left-posterior-superior"}


def read_nrrd(path: Path) -> RawImage:
    """Read a label map.

    Raises MeshError for a file that is damaged or cut short, one without a space, or of another number of dimensions.
    """
    with path.open("rb") as file:
        header = _header(path, file)
        sizes, layered = _sizes(path, header)
        dtype = _dtype(path, header)
        require_size(path, sizes, dtype)
        if "data file" in header or "datafile" in header:
            raise MeshError(f"{path}: its voxels are in another file; save it as one file (.nrrd)")
        content = _content(path, file, header, int(np.prod(sizes)) * dtype.itemsize)
    voxels = np.frombuffer(content, dtype).reshape(sizes, order="F")
    layers = voxels if layered else voxels[None]
    directions, origin = _placement(path, header, layered)
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = directions, origin
    return RawImage(layers, affine, _unit(path, header), _segments(header, layered))


def _header(path: Path, file: BinaryIO) -> dict[str, Any]:
    """Parse the lines up to the first empty one, where the file then stands."""
    lines: list[str] = []
    size = 0
    while size < MOST_HEADER:
        line = file.readline(MOST_HEADER)
        size += len(line)
        if not line:
            raise MeshError(f"{path}: the file is cut short in its header, or no NRRD file")
        # 3D Slicer writes names in UTF-8; pynrrd by itself would drop letters beyond ASCII.
        lines.append(line.decode("utf-8", "replace"))
        if not lines[-1].strip():
            break
        if len(lines) == 1 and not line.startswith(b"NRRD"):
            raise MeshError(f"{path}: is no NRRD file")
    try:
        return dict(nrrd.read_header(lines))
    except Exception as error:
        raise MeshError(f"{path}: the header is damaged ({reason_text(error)})") from None


def _sizes(path: Path, header: dict[str, Any]) -> tuple[tuple[int, ...], bool]:
    """Sizes of the array, and whether its first axis counts the layers of 3D Slicer."""
    missing = next((key for key in ("dimension", "sizes", "type", "encoding") if key not in header), None)
    if missing is not None:
        raise MeshError(f"{path}: the header is damaged: '{missing}' is missing")
    sizes = tuple(int(n) for n in np.ravel(header["sizes"]))
    if len(sizes) != header["dimension"] or min(sizes, default=0) < 1:
        raise MeshError(f"{path}: the header is damaged: sizes {list(sizes)} of {header['dimension']} dimensions")
    if len(sizes) == 3:
        return sizes, False
    kinds = list(header.get("kinds", []))
    named = any(re.fullmatch(r"Segment\d+_.+", key) for key in header)
    if len(sizes) == 4 and kinds[:1] == ["list"] and (named or sizes[0] == 1):
        return sizes, True
    raise MeshError(
        f"{path}: is an image of {len(sizes)} dimensions ({' x '.join(map(str, sizes))}); a label map has 3"
    )


def _dtype(path: Path, header: dict[str, Any]) -> np.dtype:
    name = NAMES.get(header["type"])
    if name is None or name.startswith("V"):
        raise MeshError(f"{path}: voxels of type '{header['type']}' are not read; labels are whole numbers")
    dtype = np.dtype(name)
    return dtype.newbyteorder(">" if header.get("endian") == "big" else "<")


def _content(path: Path, file: BinaryIO, header: dict[str, Any], size: int) -> bytes:
    """Read exactly so many bytes, whatever a compressed stream holds."""
    encoding = header["encoding"].lower()
    for key in ("byte skip", "byteskip", "line skip", "lineskip"):
        if header.get(key):
            raise MeshError(f"{path}: the key '{key}' is not read")
    if encoding == "raw":
        content = file.read(size)
    elif encoding in ("gzip", "gz"):
        content = _inflated(path, file, zlib.decompressobj(zlib.MAX_WBITS | 32), size)
    elif encoding in ("bzip2", "bz2"):
        content = _inflated(path, file, bz2.BZ2Decompressor(), size)
    else:
        raise MeshError(f"{path}: encoding '{encoding}' is not read; save it as gzip or raw")
    if len(content) < size:
        raise MeshError(f"{path}: the file is cut short: {len(content)} of {size} bytes of voxels are there")
    return content


def _inflated(path: Path, file: BinaryIO, stream: Any, size: int) -> bytes:
    parts, count = [], 0
    waiting = b""
    try:
        while count < size and not stream.eof:
            # zlib hands back what it has not taken; bz2 keeps it and is asked again with nothing.
            given = waiting or (b"" if getattr(stream, "needs_input", True) is False else file.read(CHUNK))
            part = stream.decompress(given, min(size - count, CHUNK))
            waiting = getattr(stream, "unconsumed_tail", b"")
            if not part and not given and not waiting:
                break
            parts.append(part)
            count += len(part)
    except (zlib.error, OSError) as error:
        raise MeshError(f"{path}: the compressed voxels are damaged ({error})") from None
    return b"".join(parts)


def _placement(path: Path, header: dict[str, Any], layered: bool) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the affine map and its origin, in right, anterior, superior and the file's unit."""
    space = str(header.get("space", "")).lower()
    space = SHORT.get(space, space)
    hint = "save it from 3D Slicer as .seg.nrrd, or with its space"
    if not space or "space directions" not in header:
        missing = "space directions" if space else "space"
        raise MeshError(f"{path}: has no '{missing}', so voxels have no place in the patient; {hint}")
    if space not in SPACES:
        raise MeshError(f"{path}: the space '{header['space']}' is not read; known are {', '.join(SPACES)}")
    rows = [np.full(3, np.nan) if row is None else np.asarray(row, float) for row in header["space directions"]]
    rows = rows[1:] if layered else rows
    origin = np.asarray(header.get("space origin", np.zeros(3)), float).ravel()
    wrong = len(rows) != 3 or any(row.shape != (3,) for row in rows) or origin.shape != (3,)
    if wrong or not (np.isfinite(rows).all() and np.isfinite(origin).all()):
        raise MeshError(f"{path}: its space directions or its space origin are no vectors of three numbers; {hint}")
    signs = np.array(SPACES[space], float)
    return signs[:, None] * np.array(rows).T, signs * origin


def _unit(path: Path, header: dict[str, Any]) -> str | None:
    """Find the unit of length that the header names; None where it names none."""
    units = header.get("space units")
    if units is None:
        return None
    names = {str(unit).strip("'\" ") for unit in np.ravel(units)} - {"", "???"}
    if len(names) > 1:
        raise MeshError(f"{path}: its axes have different units ({', '.join(sorted(names))})")
    return next(iter(names), None)


def _segments(header: dict[str, Any], layered: bool) -> tuple[Segment, ...] | None:
    """Segments by the keys of 3D Slicer; None where there are none.

    Files of Slicer before 4.11 have a layer for each segment and neither label nor layer.
    """
    ranks = sorted({int(match[1]) for key in header if (match := re.fullmatch(r"Segment(\d{1,6})_.+", key))})
    found = []
    for position, rank in enumerate(ranks):

        def whole(key: str, default: int, rank: int = rank) -> int:
            text = str(header.get(f"Segment{rank}_{key}", default))
            return int(text) if re.fullmatch(r"-?\d{1,9}", text) else default

        name = str(header.get(f"Segment{rank}_Name") or header.get(f"Segment{rank}_ID") or f"segment {rank}")
        found.append(Segment(name, whole("LabelValue", 1), whole("Layer", position if layered else 0)))
    return tuple(found) or None
