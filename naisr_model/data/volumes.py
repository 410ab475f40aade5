"""Label volumes: reading them, choosing one label and turning it into a surface.

The world frame of every result is LPS: x to the patient's left, y to the back, z to the head, in
millimetres, as MetaImage has it. NIfTI files, which say RAS, and NRRD files of any anatomical space are
turned into it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from naisr_model.data.images.base import Image
from naisr_model.data.images.reading import is_image, read_image
from naisr_model.data.remarks import Remark
from naisr_model.errors import InputError

ENDINGS = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".hdr", ".hdr.gz", ".img", ".img.gz")
"""What label volumes are usually called."""

MOST_LABELS = 1000
"""An image with more distinct values is a scan and not a segmentation, unless somebody names the label."""

MOST_LISTED = 8
"""Labels in a message."""

WHOLE = 1e-3
"""Labels that went through floating point may be off a whole number by so much."""

SMOOTHING_ROUNDS = 40
PASS_BAND = 0.05
"""Of Taubin's filter; a lower band or more rounds thin tubes that are four voxels wide."""

FEW_VOXELS = 3.5
"""A label that is narrower on average has a surface that the voxels do not settle."""

_CORRECTIONS = 8
_NEAR = 1e-4


@dataclass(frozen=True, eq=False)
class LabelVolume:
    """A segmentation: one whole number a voxel, 0 where there is nothing.

    Attributes:
        labels: whole numbers of any integer type, ``[i, j, k]``.
        to_lps_mm: 4x4, voxel indices ``(i, j, k, 1)`` of voxel centres to LPS millimetres. The
            axes are orthogonal; the determinant is negative where the index axes are left-handed.
        names: what the file calls its labels, by label; empty for most files.
        remarks: what is odd about the file.
        unit_mm: millimetres in the unit of length that the file states; None where it states none.
        overlapping: further layers of the same file, whose labels may lie over these.
    """

    labels: NDArray[np.integer]
    to_lps_mm: NDArray[np.float64]
    names: Mapping[int, str]
    remarks: tuple[Remark, ...]
    unit_mm: float | None = None
    overlapping: tuple[LabelVolume, ...] = ()

    @property
    def spacing_mm(self) -> NDArray[np.float64]:
        """Distance between neighbouring voxels along each index axis, ``[3]``."""
        return np.linalg.norm(self.to_lps_mm[:3, :3], axis=0)


# --- reading ------------------------------------------------------------------------------------


def is_label_volume(path: str | Path) -> bool:
    """Whether :func:`read_labels` is the one to read a file, or to say why it cannot be read.

    By what the file holds; its name counts only where that tells nothing.
    """
    return is_image(path) or Path(path).name.lower().endswith(ENDINGS)


def read_labels(path: str | Path) -> LabelVolume:
    """Read a label volume with its orientation.

    Args:
        path: NIfTI (``.nii``, ``.nii.gz``), NRRD (``.nrrd``, ``.nhdr``), MetaImage (``.mha``, ``.mhd``) or
            the pair of NIfTI or Analyze (``.hdr``, ``.img``), under any name.

    Raises:
        InputError: when the file is missing, damaged or cut off, when it is not a single
            three-dimensional image of whole numbers, or when its axes are not at right angles.
    """
    path = Path(path)
    image = read_image(path)
    layers = [
        LabelVolume(
            _whole_numbers(path.name, voxels, image),
            image.to_lps_mm,
            _names(image.metadata, layer, len(image.voxels)),
            image.remarks,
            image.unit_mm,
        )
        for layer, voxels in enumerate(image.voxels)
    ]
    first, *others = layers
    return replace(first, overlapping=tuple(others))


def _whole_numbers(name: str, voxels: NDArray[Any], image: Image) -> NDArray[np.integer]:
    """Take an image for labels where that is what its values look like."""
    if voxels.dtype.kind in "iu" and (image.slope, image.intercept) == (1, 0):
        return voxels
    labels: NDArray[np.integer] = np.empty(voxels.shape, np.int32, order="F")
    for k in range(voxels.shape[2]):
        values = voxels[:, :, k] * np.float64(image.slope) + image.intercept
        whole = np.rint(values)
        _require_finite(name, values)
        if (np.abs(values - whole) > WHOLE).any():
            raise _fractions(name, voxels, image)
        if np.abs(whole).max() >= 2**31:
            labels = labels.astype(np.int64)
        labels[:, :, k] = whole
    if not labels.any() and voxels.any():
        raise _fractions(name, voxels, image)
    return labels


def _require_finite(name: str, values: NDArray[np.float64]) -> None:
    if not np.isfinite(values).all():
        raise InputError(f"{name} has voxels that are not finite numbers; set them to 0 and export it again")
    if (most := np.abs(values).max()) > 2**53:
        raise InputError(f"{name} holds values up to {most:g}, so it is no label volume; segment the scan")


def _fractions(name: str, voxels: NDArray[Any], image: Image) -> InputError:
    ends = np.array([voxels.min(), voxels.max()], np.float64) * image.slope + image.intercept
    low, high = sorted(ends)
    values = f"{name} holds fractions ({low:g} to {high:g})"
    if low >= 0 and high <= 1:
        remedy = "threshold or segment it (0.5 is the usual threshold)"
        return InputError(f"{values}, so it is a probability map; {remedy} and save whole-number labels")
    kinds = "a scan, a probability map or a segmentation that was resampled with interpolation"
    return InputError(f"{values}, so it is {kinds}; threshold or segment it and save whole-number labels")


def _names(metadata: Mapping[str, str], layer: int, layers: int) -> dict[int, str]:
    """What 3D Slicer writes into the header of a segmentation; once it gave every segment a layer of ones."""
    names = {}
    for key, name in metadata.items():
        if segment := re.fullmatch(r"Segment([0-9]+)_Name", key):
            number = segment[1]
            value = metadata.get(f"Segment{number}_LabelValue", "1" if layers > 1 else "")
            where = metadata.get(f"Segment{number}_Layer", number if layers > 1 else "0")
            if _is_whole(value) and where == str(layer):
                names[int(value)] = name
    return names


def _is_whole(text: str) -> bool:
    return re.fullmatch(r"[+-]?[0-9]+", text) is not None


# --- choosing -----------------------------------------------------------------------------------


class _Entry(NamedTuple):
    """A label that is there."""

    volume: LabelVolume
    layer: int
    label: int
    size_cm3: float

    @property
    def name(self) -> str:
        return self.volume.names.get(self.label, "")

    @property
    def call(self) -> str:
        return f"{self.label} in layer {self.layer}"

    @property
    def title(self) -> str:
        size = f"{self.size_cm3:,.0f}" if self.size_cm3 >= 100 else f"{self.size_cm3:.3g}"
        return f"{titled(self.volume, self.label)}: {size} cm³"


def volumes_cm3(volume: LabelVolume) -> dict[int, float]:
    """Volume of every label but 0 by label, counted in voxels, in cm³; of overlapping layers the first."""
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


def titles(name: str, volume: LabelVolume) -> dict[int | str, str]:
    """The labels to choose from, each with its name and size: ``{2: "2 'airway': 41.9 cm³"}``.

    Args:
        name: of the file, for messages.
        volume: may have overlapping layers.

    Returns:
        Titles by what :func:`choose` takes: the label's number, or its name where layers share the number.

    Raises:
        InputError: when there are so many that it is a scan.
    """
    entries = _entries(volume)
    if len(entries) > MOST_LABELS:
        raise _scan(name, entries)
    shared = Counter(entry.label for entry in entries)
    return {
        _key(entry, entries) if shared[entry.label] > 1 else entry.label: entry.title for entry in entries
    }


def choose(name: str, volume: LabelVolume, label: int | str | None) -> tuple[LabelVolume, int]:
    """The label that is meant, and the layer that it is in.

    A number means the label before it means a name, and a name as it is written comes before one that
    differs by case.

    Args:
        name: of the file, for messages.
        volume: may have overlapping layers.
        label: its number or its name; may be left out where there is only one.

    Raises:
        InputError: when there is no such label or several, or none is named where there are several.
    """
    entries = _entries(volume)
    if not entries:
        raise InputError(f"{name} has no label; every voxel is 0, segment the scan first")
    if label is None:
        return _only(name, entries)
    meant = _meant(entries, label)
    if not meant:
        raise InputError(f"{name} has no label {label}; it has {_listed(entries)}")
    if len(meant) > 1:
        calls = ", ".join(f"'{_key(entry, entries)}'" for entry in meant[:MOST_LISTED])
        raise InputError(f"{name} has {len(meant)} labels that '{label}' may mean; choose one of {calls}")
    return meant[0].volume, meant[0].label


def _entries(volume: LabelVolume) -> list[_Entry]:
    layers = enumerate((volume, *volume.overlapping), start=1)
    return [_Entry(each, layer, *size) for layer, each in layers for size in volumes_cm3(each).items()]


def _only(name: str, entries: Sequence[_Entry]) -> tuple[LabelVolume, int]:
    if len(entries) > MOST_LABELS:
        raise _scan(name, entries)
    first = entries[0]
    if len(entries) > 1 or first.label < 0:
        count = f"{len(entries)} labels" if len(entries) > 1 else "a negative label alone"
        raise InputError(f"{name} has {count} ({_listed(entries)}); choose one with --label")
    return first.volume, first.label


def _scan(name: str, entries: Sequence[_Entry]) -> InputError:
    low, high = min(entry.label for entry in entries), max(entry.label for entry in entries)
    return InputError(
        f"{name} holds {len(entries):,} values from {low} to {high}, so it is a scan and no labels; "
        "segment it, or name the label that is meant with --label"
    )


def _listed(entries: Sequence[_Entry]) -> str:
    listed = ", ".join(entry.title for entry in entries[:MOST_LISTED])
    more = len(entries) - MOST_LISTED
    return f"{listed} and {more:,} more" if more > 0 else listed


def _meant(entries: Sequence[_Entry], label: int | str) -> list[_Entry]:
    """All that a number or a name may mean, by the first way of reading it that finds any."""
    text = str(label).strip()
    ways: Iterable[Callable[[_Entry], bool]] = (
        lambda entry: _is_whole(text) and entry.label == int(text),
        lambda entry: entry.name == text,
        lambda entry: entry.name.casefold() == text.casefold(),
        lambda entry: entry.call == text,
    )
    return next((found for way in ways if (found := list(filter(way, entries)))), [])


def _key(entry: _Entry, entries: Sequence[_Entry]) -> int | str:
    """What means this one and no other."""
    calls = (entry.label, entry.name, entry.call)
    return next((call for call in calls if call and _meant(entries, call) == [entry]), entry.call)


# --- surfaces -----------------------------------------------------------------------------------


def label_surface(volume: LabelVolume, label: int) -> trimesh.Trimesh:
    """The boundary of one label as a closed, smoothed surface with outward faces.

    Flying edges halfway between voxels, which give a closed manifold also where voxels meet along an edge
    or at a corner, and Taubin's smoothing (1995), which takes the steps away. What both shrink is given back
    along the normals, so that the surface encloses the volume of its voxels, a tube's of 1.5 voxels' radius
    too. Where the label touches the edge of the image the surface is closed there.

    Returns:
        LPS millimetres; without faces where no voxel has the label.
    """
    where = volume.labels == label
    if not where.any():
        return trimesh.Trimesh()
    spans = [np.flatnonzero(where.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    box = tuple(slice(span[0], span[-1] + 1) for span in spans)
    vertices, faces = _boundary(np.pad(where[box], 1), volume.spacing_mm)
    index = vertices / volume.spacing_mm - 1 + [part.start for part in box]
    points = index @ volume.to_lps_mm[:3, :3].T + volume.to_lps_mm[:3, 3]
    # The triangles look outward along the index axes.
    turned = faces[:, ::-1] if np.linalg.det(volume.to_lps_mm[:3, :3]) < 0 else faces
    return trimesh.Trimesh(points, turned, process=False)


def label_remarks(volume: LabelVolume, label: int, surface: trimesh.Trimesh) -> tuple[Remark, ...]:
    """What is odd about one label, of which the surface is known."""
    found = []
    if touches_edge(volume, label):
        sentence = "the label reaches the edge of the image and is cut off there"
        found.append(Remark("look", "edge", sentence, "what lies beyond is not seen"))
    width = 4 * abs(surface.volume) / surface.area / np.prod(volume.spacing_mm) ** (1 / 3)
    if width < FEW_VOXELS:
        sentence = f"the label is only about {width:.1f} voxels wide, so its surface is rough"
        found.append(Remark("look", "thin", sentence, "segment it in a finer image if there is one"))
    return tuple(found)


def touches_edge(volume: LabelVolume, label: int) -> bool:
    """Whether the label reaches the outermost voxels, so that the anatomy may go on outside."""
    sides = [volume.labels.take(end, axis) for axis in range(3) for end in (0, -1)]
    return any((side == label).any() for side in sides)


def _boundary(
    where: NDArray[np.bool_], spacing_mm: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices in millimetres along the index axes, from the first voxel's centre, and triangles."""
    import pyvista

    image = pyvista.ImageData(dimensions=where.shape, spacing=tuple(spacing_mm))
    image.point_data["labels"] = where.astype(np.uint8).ravel(order="F")
    stepped = image.contour([0.5], scalars="labels", method="flying_edges", compute_normals=False)
    smooth = stepped.smooth_taubin(n_iter=SMOOTHING_ROUNDS, pass_band=PASS_BAND)
    faces = np.asarray(smooth.regular_faces, np.int64)
    vertices = _uncollapsed(
        np.asarray(stepped.points, np.float64), np.asarray(smooth.points, np.float64), faces
    )
    return _filled(vertices, faces, where.sum() * np.prod(spacing_mm), spacing_mm.min() / 2), faces


def _uncollapsed(
    stepped: NDArray[np.float64], smooth: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Components of a few voxels as they were: smoothing leaves nothing of them."""
    component = np.asarray(igl.facet_components(faces)[1])
    before, after = (
        np.abs(np.bincount(component, weights=_cones(points, faces))) for points in (stepped, smooth)
    )
    kept = faces[(after < before / 2)[component]]
    smooth[kept] = stepped[kept]
    return smooth


def _cones(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Signed volume of the cone over each triangle from the origin."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6


def _filled(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], volume_mm3: float, most_mm: float
) -> NDArray[np.float64]:
    """Vertices moved alike along their normals until the surface encloses a volume (Newton's method)."""
    for _ in range(_CORRECTIONS):
        missing = volume_mm3 - _cones(vertices, faces).sum()
        if abs(missing) <= _NEAR * volume_mm3:
            break
        a, b, c = vertices[faces].transpose(1, 0, 2)
        vectors = np.repeat(np.cross(b - a, c - a) / 6, 3, axis=0)  # the volume's derivative by a corner
        slopes = np.stack([np.bincount(faces.ravel(), column, len(vertices)) for column in vectors.T], axis=1)
        lengths = np.linalg.norm(slopes, axis=1, keepdims=True)
        step_mm = np.clip(missing / lengths.sum(), -most_mm, most_mm)
        vertices = vertices + step_mm * slopes / np.maximum(lengths, np.finfo(float).tiny)
    return vertices
