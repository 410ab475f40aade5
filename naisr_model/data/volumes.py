"""Reading label volumes (NIfTI, NRRD) and turning one label into a surface.

The world frame of every result is LPS: x to the patient's left, y to the back, z to the head, in
millimetres. NIfTI files, which say RAS, and NRRD files of any anatomical space are turned into it.
"""

from __future__ import annotations

import gzip
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.errors import InputError

ENDINGS = (".nii", ".nii.gz", ".nrrd")
"""The file endings that :func:`read_labels` knows."""

MOST_LABELS = 1000
"""An image with more distinct values is a scan and not a segmentation."""

SMOOTHING_ROUNDS = 40
PASS_BAND = 0.05
"""Of Taubin's filter; a lower band or more rounds thin tubes that are four voxels wide."""

_SHEAR = 1e-3
_HEADER_BYTES = 1 << 20
_NIFTI_HEADER_BYTES = 352


@dataclass(frozen=True, eq=False)
class LabelVolume:
    """A segmentation: one whole number a voxel, 0 where there is nothing.

    Attributes:
        labels: whole numbers of any integer type, ``[i, j, k]``.
        to_lps_mm: 4x4, voxel indices ``(i, j, k, 1)`` of voxel centres to LPS millimetres. The
            axes are orthogonal; the determinant is negative where the index axes are left-handed.
        names: what the file calls its labels, by label; empty for most files.
        remarks: what is odd about the file, a sentence each.
    """

    labels: NDArray[np.integer]
    to_lps_mm: NDArray[np.float64]
    names: Mapping[int, str]
    remarks: tuple[str, ...]

    @property
    def spacing_mm(self) -> NDArray[np.float64]:
        """Distance between neighbouring voxels along each index axis, ``[3]``."""
        return np.linalg.norm(self.to_lps_mm[:3, :3], axis=0)


def read_labels(path: str | Path) -> LabelVolume:
    """Read a label volume with its orientation.

    Args:
        path: a NIfTI (``.nii``, ``.nii.gz``) or NRRD (``.nrrd``) file.

    Raises:
        InputError: when the file is missing, damaged or cut off, when it is not a single
            three-dimensional image of whole numbers, or when its axes are not at right angles.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist; correct the path")
    if not path.name.lower().endswith(ENDINGS):
        raise InputError(f"{path.name} is not one of {', '.join(ENDINGS)}; convert it first")
    _refuse_sheared_nrrd(path)
    reader, image = _read_image(path)
    labels = _whole_numbers(path, _voxels(image))
    metadata = {key: reader.GetMetaData(key) for key in reader.GetMetaDataKeys()}
    return LabelVolume(labels, _index_to_lps(image), _names(metadata), _remarks(metadata))


def _read_image(path: Path) -> tuple[Any, Any]:
    """The reader, which knows the file's header, and the three-dimensional image."""
    import SimpleITK as sitk  # noqa: N813 (the name that its own documentation uses)

    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    quiet = not sitk.ProcessObject.GetGlobalWarningDisplay()
    sitk.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        reader.ReadImageInformation()
        _check_header(path, reader)
        return reader, reader.Execute()
    except RuntimeError as error:
        _explain(path, error)
    finally:
        sitk.ProcessObject.SetGlobalWarningDisplay(not quiet)


def _explain(path: Path, error: Exception) -> NoReturn:
    if "orthonormal" in str(error):
        _refuse_shear(path)
    reason = str(error).strip().splitlines()[-1]
    raise InputError(f"{path.name} cannot be read ({reason}); it is damaged, export it again") from error


def _refuse_shear(path: Path) -> NoReturn:
    raise InputError(f"the axes of {path.name} are not at right angles; resample it onto a rectangular grid")


def _check_header(path: Path, reader: Any) -> None:
    size = reader.GetSize()
    if reader.GetNumberOfComponents() != 1 or len(size) > 3:
        count = reader.GetNumberOfComponents() * math.prod(size[3:])
        raise InputError(f"{path.name} holds {count} values a voxel; save one label volume alone")
    if len(size) < 3 or min(size) < 2:
        shape = " x ".join(map(str, size))
        raise InputError(f"{path.name} is a two-dimensional image ({shape}); give the whole volume")
    if path.suffix.lower() != ".nrrd" and _content_bytes(path) < (
        _NIFTI_HEADER_BYTES + math.prod(size) * _voxel_bytes(reader)
    ):
        raise InputError(f"{path.name} is cut off; copy or export it again")


def _voxel_bytes(reader: Any) -> int:
    import SimpleITK as sitk  # noqa: N813

    return int(sitk.Image([1, 1, 1], reader.GetPixelID()).GetSizeOfPixelComponent())


def _content_bytes(path: Path) -> int:
    """Bytes of a NIfTI file, unpacked; the library would fill in what a short file lacks."""
    if path.suffix.lower() != ".gz":
        return path.stat().st_size
    try:
        with gzip.open(path) as file:
            return sum(len(block) for block in iter(lambda: file.read(1 << 22), b""))
    except (EOFError, OSError) as error:
        raise InputError(f"{path.name} is cut off or damaged ({error}); copy or export it again") from error


def _refuse_sheared_nrrd(path: Path) -> None:
    """The library would straighten the axes of such a file without a word."""
    if path.suffix.lower() != ".nrrd":
        return
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES).split(b"\n\n")[0].split(b"\r\n\r\n")[0].decode("latin-1")
    line = re.search(r"^space directions:(.*)$", header, re.MULTILINE)
    axes = re.findall(r"\(([^)]*)\)", line[1]) if line else []
    try:
        directions = np.array([[float(part) for part in axis.split(",")] for axis in axes])
    except ValueError as error:
        raise InputError(f"{path.name} has space directions that are no numbers; export it again") from error
    if directions.shape == (3, 3) and _is_sheared(directions):
        _refuse_shear(path)


def _is_sheared(directions: NDArray[np.float64]) -> bool:
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    cosines = (directions / np.maximum(lengths, np.finfo(float).tiny)) @ directions.T / lengths.T
    return bool(np.abs(cosines - np.eye(3)).max() > _SHEAR)


def _voxels(image: Any) -> NDArray[Any]:
    import SimpleITK as sitk  # noqa: N813

    return np.asarray(sitk.GetArrayFromImage(image)).transpose(2, 1, 0)


def _index_to_lps(image: Any) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * image.GetSpacing()
    matrix[:3, 3] = image.GetOrigin()
    return matrix


def _whole_numbers(path: Path, voxels: NDArray[Any]) -> NDArray[np.integer]:
    """Take an image for labels where that is what its values look like."""
    if not np.isfinite(voxels).all():
        raise InputError(f"{path.name} has voxels that are not finite numbers; export the segmentation again")
    if np.issubdtype(voxels.dtype, np.floating):
        whole = voxels.astype(np.int32)
        if (whole != voxels).any():
            raise InputError(
                f"{path.name} holds fractions ({voxels.min():g} to {voxels.max():g}), so it is a scan or a "
                "probability map; threshold or segment it and save whole-number labels"
            )
        voxels = whole
    if voxels.min() < 0 or _count_of_values(voxels) > MOST_LABELS:
        raise InputError(
            f"{path.name} holds values from {voxels.min()} to {voxels.max()}, so it is a scan and no labels; "
            "segment it and give the label volume"
        )
    return voxels


def _count_of_values(voxels: NDArray[np.integer]) -> int:
    return len(np.unique(np.concatenate([np.unique(layer) for layer in voxels.transpose(2, 0, 1)])))


def _names(metadata: Mapping[str, str]) -> dict[int, str]:
    """What 3D Slicer writes into the header of a segmentation."""
    names = {}
    for key, name in metadata.items():
        segment = re.fullmatch(r"(Segment\d+)_Name", key)
        value = metadata.get(f"{segment[1]}_LabelValue", "") if segment else ""
        if value.isdigit():
            names[int(value)] = name
    return names


def _remarks(metadata: Mapping[str, str]) -> tuple[str, ...]:
    nifti = "sform_code" in metadata
    unknown = (
        metadata.get("sform_code") == metadata.get("qform_code") == "0"
        if nifti
        else metadata.get("NRRD_space") != "left-posterior-superior"
    )
    return ("the file does not say how the patient lies; do not rely on left and right",) if unknown else ()


def volumes_cm3(volume: LabelVolume) -> dict[int, float]:
    """Volume of every label but 0 by label, counted in voxels, in cm³."""
    voxel_cm3 = float(np.prod(volume.spacing_mm)) / 1000
    counts: dict[int, int] = {}
    for layer in volume.labels.transpose(2, 0, 1):
        for label, count in zip(*np.unique(layer, return_counts=True), strict=True):
            counts[int(label)] = counts.get(int(label), 0) + int(count)
    return {label: count * voxel_cm3 for label, count in sorted(counts.items()) if label}


def titled(volume: LabelVolume, label: int) -> str:
    """The label's number, with its name where the file gives one, as ``2 'airway'``."""
    name = volume.names.get(label, "")
    return f"{label} '{name}'" if name else str(label)


def titles(volume: LabelVolume) -> dict[int, str]:
    """The labels to choose from, each with its name and size: ``{2: "2 'airway': 41.9 cm³"}``."""
    sizes_cm3 = volumes_cm3(volume)
    return {label: f"{titled(volume, label)}: {size:.3g} cm³" for label, size in sizes_cm3.items()}


def label_surface(volume: LabelVolume, label: int) -> trimesh.Trimesh:
    """The boundary of one label as a closed, smoothed surface with outward faces.

    Surface nets (Gibson 1998: a vertex in each cell that the boundary passes through) and then
    Taubin's smoothing (1995), which takes the steps away and, unlike relaxation, does not shrink:
    within 0.5 % of the true volume of a tube of 2 voxels' radius where relaxed nets lose half.
    Where the label touches the edge of the image the surface is closed there.

    Returns:
        LPS millimetres; without faces where no voxel has the label.
    """
    where = volume.labels == label
    if not where.any():
        return trimesh.Trimesh()
    spans = [np.flatnonzero(where.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    box = tuple(slice(span[0], span[-1] + 1) for span in spans)
    vertices, faces = _surface_nets(np.pad(where[box], 1), volume.spacing_mm)
    index = vertices / volume.spacing_mm - 1 + [part.start for part in box]
    points = index @ volume.to_lps_mm[:3, :3].T + volume.to_lps_mm[:3, 3]
    # The triangles look outward along the index axes.
    turned = faces[:, ::-1] if np.linalg.det(volume.to_lps_mm[:3, :3]) < 0 else faces
    return trimesh.Trimesh(points, turned, process=False)


def touches_edge(volume: LabelVolume, label: int) -> bool:
    """Whether the label reaches the outermost voxels, so that the anatomy may go on outside."""
    sides = [volume.labels.take(end, axis) for axis in range(3) for end in (0, -1)]
    return any((side == label).any() for side in sides)


def _surface_nets(
    where: NDArray[np.bool_], spacing_mm: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices in millimetres along the index axes, from the first voxel's centre, and triangles."""
    import pyvista
    from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D

    image = pyvista.ImageData(dimensions=where.shape, spacing=tuple(spacing_mm))
    image.point_data["labels"] = where.astype(np.uint8).ravel(order="F")
    nets = vtkSurfaceNets3D()
    nets.SetInputData(image)
    nets.SetLabel(0, 1)
    nets.SetOutputMeshTypeToTriangles()
    nets.SmoothingOff()
    nets.Update()
    stepped = pyvista.wrap(nets.GetOutput())
    surface = stepped.smooth_taubin(n_iter=SMOOTHING_ROUNDS, pass_band=PASS_BAND)
    return np.asarray(surface.points, np.float64), np.asarray(surface.regular_faces, np.int64)
