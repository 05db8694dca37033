"""NIfTI-1 and NIfTI-2 files, by nibabel."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import numpy as np

from palpate.errors import MeshError
from palpate.input_file import quiet, reason_text
from palpate.segmentation.label_map import RawImage, require_size

# Names of `xyzt_units` (nifti1.h) and those of this package.
UNITS = {"meter": "m", "mm": "mm", "micron": "um"}


def read_nifti(path: Path) -> RawImage:
    """Read a label map.

    Raises MeshError for a file that is damaged or cut short, one without an affine map, or of another number of
    dimensions.
    """
    import nibabel

    try:
        with quiet("nibabel"):
            # Before it is opened: nibabel reads the header of what is no NIfTI file as another format's.
            image = nibabel.Nifti1Image.from_filename(path) if _version(path) == 1 else nibabel.Nifti2Image.load(path)
            _require_three_axes(path, image.shape)
            require_size(path, image.shape, image.get_data_dtype())
            affine = _affine(path, image)
            # The scale of a label map is 1; another one makes an intensity image of it, which is refused later.
            voxels = np.asarray(image.dataobj).reshape(image.shape[:3])
            unit = UNITS.get(image.header.get_xyzt_units()[0])
    except MeshError:
        raise
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise MeshError(f"{path}: the file is cut short or damaged ({reason_text(error)})") from None
    except Exception as error:
        raise MeshError(f"{path}: cannot be read as a NIfTI file ({reason_text(error)})") from None
    return RawImage(voxels[None], affine, unit, None)


def _version(path: Path) -> int:
    """Version by the size of the header, the first number of the file, in either order of bytes."""
    opened = gzip.open(path) if path.suffix.lower() == ".gz" else path.open("rb")
    with opened as file:
        start = file.read(4)
    if len(start) < 4:
        raise MeshError(f"{path}: the file is cut short in its header")
    version = {348: 1, 540: 2}
    found = version.get(int.from_bytes(start, "little")) or version.get(int.from_bytes(start, "big"))
    if found is None:
        raise MeshError(f"{path}: is no NIfTI file")
    return found


def _require_three_axes(path: Path, shape: tuple[int, ...]) -> None:
    if len(shape) < 3 or any(count != 1 for count in shape[3:]) or min(shape) < 1:
        sizes = " x ".join(map(str, shape))
        raise MeshError(f"{path}: is an image of {len(shape)} dimensions ({sizes}); a label map has 3")


def _affine(path: Path, image) -> np.ndarray:
    """Map to right, anterior, superior: the sform if it is set, else the qform (nifti1.h, methods 3 and 2)."""
    if image.header["sform_code"] == 0 and image.header["qform_code"] == 0:
        raise MeshError(
            f"{path}: has neither sform nor qform, so voxels have no place in the patient; save it with its affine"
        )
    affine = np.asarray(image.affine, float)
    if not np.isfinite(affine).all():
        raise MeshError(f"{path}: its affine map has numbers that are not finite")
    return affine
