"""Label volumes as every tool writes them, and broken ones."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from corpus import damage
from corpus.case import REFUSED, Case, Damage, Expected, Files, Goods, Special
from corpus.fits import case, fitting, special, whole
from corpus.images import (
    SPACING_MM,
    VOLUME,
    analyze,
    labels,
    metaimage,
    nifti,
    nifti_gz,
    nrrd,
    pair,
    placed,
    segment,
    slicer,
    turned,
    two_labels,
)
from numpy.random import Generator
from numpy.typing import NDArray

KIND = "volume"
_volume = partial(case, KIND)
GOOD = whole(VOLUME)
EITHER = whole(VOLUME, "either")
BOX = whole(float(labels().size * np.prod(SPACING_MM)) / 1000, "either")
FORMS = {
    "nii": nifti,
    "nii.gz": nifti_gz,
    "nrrd": nrrd,
    "packed.nrrd": partial(nrrd, encoding="gzip"),
    "mha": metaimage,
    "packed.mha": partial(metaimage, packed=True),
}
_KINDS = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")


def _file(form: str) -> str:
    return f"egg.{form}"


def _nii(
    name: str, expected: Expected = GOOD, *damages: Damage, words: tuple[str, ...] = (), **header: Any
) -> Case:
    return _volume(f"nii: {name}", "egg.nii", partial(nifti, **header), expected, *damages, words=words)


def _nrrd(
    name: str, expected: Expected = GOOD, *damages: Damage, words: tuple[str, ...] = (), **header: Any
) -> Case:
    return _volume(f"nrrd: {name}", "egg.nrrd", partial(nrrd, **header), expected, *damages, words=words)


def _mha(
    name: str, expected: Expected = GOOD, *damages: Damage, words: tuple[str, ...] = (), **header: Any
) -> Case:
    return _volume(f"mha: {name}", "egg.mha", partial(metaimage, **header), expected, *damages, words=words)


def _two(
    name: str,
    files: Callable[[], Files],
    expected: Expected = GOOD,
    opened: str = "egg.hdr",
    damages: Mapping[str, Damage] = MappingProxyType({}),
) -> Case:
    """Two files that belong together, some of them damaged; of which one is opened."""

    def make(_goods: Goods, rng: Generator) -> Files:
        made = dict(files())
        for file, harm in damages.items():
            good = made[file]
            assert isinstance(good, bytes)
            made[file] = harm(good, rng)
        return made

    return Case(KIND, f"two files: {name}", make, fitting(opened), expected)


def _apart(file: str = "egg.raw", **header: Any) -> Files:
    """A header of MetaImage, and its voxels beside it."""
    return {"egg.mhd": metaimage(file=file, **header), "egg.raw": labels().tobytes(order="F")}


def _second_pair() -> Files:
    return pair(version=2, magic=b"ni2\0\r\n\x1a\n")


def _without(files: Callable[[], Files], lost: str) -> Files:
    return {name: content for name, content in files().items() if name != lost}


def _noisy(kind: str, value: float, size: float) -> NDArray:
    voxels = labels(value, kind)
    return (voxels + np.random.default_rng(0).uniform(-size, size, voxels.shape) * (voxels > 0)).astype(kind)


def _scan() -> NDArray:
    """Grey values."""
    return (np.random.default_rng(0).normal(1000, 300, labels().shape)).astype("i2")


def _many(count: int) -> NDArray:
    """The egg is label 4512, and there are some more."""
    voxels = labels(4512, "u2").ravel()
    outside = np.flatnonzero(voxels == 0)[:count]
    voxels[outside] = 1 + np.arange(count)
    return voxels.reshape(labels().shape)


def _minus() -> NDArray:
    voxels = labels(-1, "i2")
    voxels[0, 0, 0] = 5
    return voxels


def _told(name: str, value: object) -> dict[str, Any]:
    """One more line of a header."""
    return {name: value}


_AXES_MM = np.diag([-1.0, 1.0, 1.0])
_SHEAR = np.array([[1.0, np.sin(np.radians(10)), 0], [0, 1, 0], [0, 0, 1]])
_SMALL_SHEAR = np.array([[1.0, np.sin(np.radians(0.05)), 0], [0, 1, 0], [0, 0, 1]])
_WRITTEN = [
    *(_volume(f"{form} as it is", _file(form), good, GOOD) for form, good in FORMS.items()),
    *(_nii(f"of {kind}", voxels=labels(1, kind)) for kind in _KINDS),
    *(_nrrd(f"of {kind}", voxels=labels(1, kind)) for kind in _KINDS),
    *(_nii(f"of {kind}, big endian", voxels=labels(3, kind), order=">") for kind in ("i2", "f4")),
    *(_nrrd(f"of {kind}, big endian", voxels=labels(3, kind), order=">") for kind in ("i2", "f4")),
    *(_nii(f"version 2 of {kind}", version=2, voxels=labels(1, kind)) for kind in ("u1", "i2", "f8")),
    _nii("version 2, big endian", version=2, voxels=labels(1, "i2"), order=">"),
    *(_nrrd(encoding, encoding=encoding) for encoding in ("gzip", "gz", "ascii", "text")),
    *(_nrrd(encoding, EITHER, encoding=encoding) for encoding in ("hex", "bzip2")),
    *(
        _volume(f"{true} named .{name}", _file(name), FORMS[true], GOOD)
        for true, name in (
            *(("nii", "nii.gz"), ("nii.gz", "nii"), ("nrrd", "nii"), ("nrrd", "nii.gz"), ("nii", "nrrd")),
            *(("nii.gz", "nrrd"), ("packed.nrrd", "nii")),
        )
    ),
    *(_volume(f"{form} in capitals", _file(form.upper()), good, GOOD) for form, good in FORMS.items()),
    *(
        _volume(f"{true} named {name}", name, FORMS[true], EITHER)
        for true, name in (
            ("nii", "egg"),
            ("nii", "egg.img"),
            ("nrrd", "egg.stl"),
            ("nrrd", "egg.nhdr"),
            ("nii.gz", "egg.gz"),
        )
    ),
    *(
        _volume(f"{form} and {len(more)} bytes more", _file(form), good, GOOD, damage.ended_with(more))
        for form, good in FORMS.items()
        for more in (bytes(16), b"made by a tool\n")
    ),
    _volume(
        "nii.gz in two parts",
        "egg.nii.gz",
        lambda: gzip.compress(nifti()[:20000], mtime=0) + gzip.compress(nifti()[20000:], mtime=0),
        GOOD,
    ),
    _volume("nii.gz packed twice", "egg.nii.gz", nifti_gz, EITHER, damage.gzipped),
    _volume("nrrd.gz", "egg.nrrd.gz", nrrd, EITHER, damage.gzipped),
]
_VALUES = [
    *(
        _nii(f"slope {slope:g}, inter {inter:g}", voxels=labels(2), slope=slope, inter=inter)
        for slope, inter in ((1.0, 0.0), (0.5, 0.0), (2.0, 0.0), (0.0, 5.0))
    ),
    _nii("inter 1", voxels=labels(1, "i2"), slope=1.0, inter=1.0, words=("--label", "2")),
    _nii("inter -1", voxels=labels(3, "i2", background=1), slope=1.0, inter=-1.0),
    _nii("slope nan", EITHER, voxels=labels(1), slope=np.nan),
    *(
        _nii(f"about {value:g} ± {size:g}", voxels=_noisy(kind, value, size))
        for kind, value, size in (("f4", 2, 1e-4), ("f4", 7, 1e-6), ("f8", 6.9999, 0.0))
    ),
    _nii("3e9 as a float", voxels=labels(3e9, "f8")),
    _nii("a map of probabilities", REFUSED, voxels=_noisy("f4", 0.7, 0.3)),
    _nii("a scan", REFUSED, voxels=_scan()),
    _nii("not a number inside", REFUSED, voxels=labels(np.nan, "f4")),
    _nii("infinite inside", REFUSED, voxels=labels(np.inf, "f4")),
    _nii("not a number outside", EITHER, voxels=labels(1, "f4", background=np.nan)),
    _nii("nothing labelled", REFUSED, voxels=0 * labels()),
    _nii("all labelled", BOX, voxels=0 * labels() + 1),
    _nii("1500 labels and one named", voxels=_many(1500), words=("--label", "4512")),
    _nii("1500 labels", REFUSED, voxels=_many(1500)),
    _nii("300 labels", REFUSED, voxels=_many(300)),
    _nii("a negative label", voxels=_minus(), words=("--label=-1",)),
    _nii("two labels", REFUSED, voxels=two_labels()),
    _nii("two labels and one named", voxels=two_labels(), words=("--label", "2")),
    _nii("two labels and another named", REFUSED, voxels=two_labels(), words=("--label", "7")),
    _nii("two labels and a word", REFUSED, voxels=two_labels(), words=("--label", "egg")),
    _nii("two labels and a fraction", REFUSED, voxels=two_labels(), words=("--label", "1.5")),
    _nii("two labels and nothing", REFUSED, voxels=two_labels(), words=("--label", "")),
    _nii("one label and it named", voxels=labels(5), words=("--label", "5")),
    _nii("32767 and 1", words=("--label", "32767"), voxels=np.where(labels() > 0, 32767, 0).astype("i2")),
]
_NAMED = [
    _volume(
        f"slicer: {name}", "egg.seg.nrrd", partial(slicer, two_labels(), *segments), expected, words=words
    )
    for name, segments, words, expected in (
        ("a number", (segment(0, 1, "block"), segment(1, 2, "egg")), ("--label", "2"), GOOD),
        ("a name", (segment(0, 1, "block"), segment(1, 2, "egg")), ("--label", "egg"), GOOD),
        ("a name in capitals", (segment(0, 1, "block"), segment(1, 2, "egg")), ("--label", "EGG"), GOOD),
        ("names that differ by case", (segment(0, 1, "EGG"), segment(1, 2, "egg")), ("--label", "egg"), GOOD),
        ("neither of them", (segment(0, 1, "EGG"), segment(1, 2, "eGG")), ("--label", "egg"), REFUSED),
        ("one name twice", (segment(0, 1, "egg"), segment(1, 2, "egg")), ("--label", "egg"), REFUSED),
        ("a name that is a number", (segment(0, 1, "2"), segment(1, 2, "1")), ("--label", "2"), GOOD),
        (
            "a name with spaces",
            (segment(0, 1, "block"), segment(1, 2, "the egg")),
            ("--label", "the egg"),
            GOOD,
        ),
        ("no name", (segment(0, 1, "block"), segment(1, 2, "egg")), (), REFUSED),
        ("another name", (segment(0, 1, "block"), segment(1, 2, "egg")), ("--label", "lung"), REFUSED),
    )
]


def _layered(*names: str) -> bytes:
    """The block and the egg in layers of their own, as overlapping segments are kept."""
    block = np.zeros_like(labels())
    block[10:30, 10:30, 10:30] = 1
    both = np.stack([block, labels()])
    axes = "none " + " ".join("(" + ",".join(f"{x:g}" for x in placed()[:3, i]) + ")" for i in range(3))
    segments = [segment(i, 1, name, layer=i) for i, name in enumerate(names)]
    return slicer(both, *segments, space_directions=axes, kinds="list domain domain domain")


_LAYERED = [
    _volume(
        "slicer: layers and a name",
        "egg.seg.nrrd",
        partial(_layered, "block", "egg"),
        GOOD,
        words=("--label", "egg"),
    ),
    _volume("slicer: layers", "egg.seg.nrrd", partial(_layered, "block", "egg"), REFUSED),
    _volume(
        "slicer: layers and another name",
        "egg.seg.nrrd",
        partial(_layered, "block", "egg"),
        REFUSED,
        words=("--label", "lung"),
    ),
    _volume("slicer: layers without names", "egg.seg.nrrd", _layered, REFUSED),
]
_PLACES = [
    _nii("qform alone", sform=None, qform=placed()),
    _nii("both forms", qform=placed()),
    _nii("no form", sform=None),
    _nii("sform alone, pixdim 1", spacing=(1.0, 1.0, 1.0)),
    _nii("sform alone, pixdim 0", EITHER, spacing=(0.0, 0.0, 0.0)),
    _nii("sform alone, pixdim nan", EITHER, spacing=(np.nan, 1.5, 2.5)),
    _nii("forms that differ by a shift", qform=placed() + np.array([[0, 0, 0, 10.0]] + [[0] * 4] * 3)),
    _nii("forms that differ by a scale", qform=placed(), spacing=(3.0, 3.0, 5.0)),
    _nii("forms that differ by a turn", qform=placed(turn=turned(20))),
    _nii("a mirror", sform=placed(turn=_AXES_MM)),
    _nii("a turn by 20°", sform=placed(turn=turned(20))),
    _nii("a turn rounded to 3 decimals", sform=np.round(placed(turn=turned(20)), 3)),
    _nii("a turn rounded to 4 decimals", sform=np.round(placed(turn=turned(20)), 4)),
    _nii("a small shear", sform=placed(turn=_SMALL_SHEAR)),
    _nii("a shear", REFUSED, sform=placed(turn=_SHEAR)),
    _nii("no pixdim", REFUSED, sform=None, spacing=(0.0, 0.0, 0.0)),
    _nii("pixdim nan", REFUSED, sform=None, spacing=(np.nan, 1.5, 2.5)),
    _nii("pixdim inf", REFUSED, sform=None, spacing=(np.inf, 1.5, 2.5)),
    _nii("a negative pixdim", EITHER, sform=None, spacing=(-1.5, 1.5, 2.5)),
    _nii("nan in the sform", EITHER, sform=np.full((4, 4), np.nan)),
    _nii("inf in the sform", EITHER, sform=np.full((4, 4), np.inf)),
    _nii("zeros in the sform", EITHER, sform=np.zeros((4, 4))),
    _nii("two axes alike", EITHER, sform=placed()[[0, 0, 2, 3]]),
    _nii("1e30 in the sform", REFUSED, sform=placed() * 1e30),
    _nii("metres", EITHER, units=1, spacing=tuple(x / 1000 for x in SPACING_MM), sform=placed() / 1000),
    _nii("micrometres", EITHER, units=3, spacing=tuple(x * 1000 for x in SPACING_MM), sform=placed() * 1000),
    _nii("no unit", units=0),
    _nii("an unknown unit", EITHER, units=7),
    _nrrd("left-posterior-superior", space="left-posterior-superior"),
    *(_nrrd(space, space=space) for space in ("RAS", "LPS", "left-anterior-superior", "LAS")),
    _nrrd("the scanner's space", EITHER, space="scanner-xyz"),
    _nrrd("an unknown space", EITHER, space="left-hand-up"),
    _nrrd("a dimension of the space", drop=("space",), space_dimension=3),
    _nrrd("spacings", drop=("space", "space directions", "space origin"), spacings="1.5 1.5 2.5"),
    _nrrd("no spacing", REFUSED, drop=("space", "space directions", "space origin")),
    _nrrd(
        "spacings nan", REFUSED, drop=("space", "space directions", "space origin"), spacings="nan nan nan"
    ),
    _nrrd("spacings 0", REFUSED, drop=("space", "space directions", "space origin"), spacings="0 0 0"),
    _nrrd(
        "spacings with commas",
        EITHER,
        drop=("space", "space directions", "space origin"),
        spacings="1,5 1,5 2,5",
    ),
    _nrrd("nan in the directions", REFUSED, space_directions="(nan,0,0) (0,1.5,0) (0,0,2.5)"),
    _nrrd("words in the directions", REFUSED, space_directions="(a,0,0) (0,1.5,0) (0,0,2.5)"),
    _nrrd("directions of zeros", REFUSED, space_directions="(0,0,0) (0,1.5,0) (0,0,2.5)"),
    _nrrd("two directions", REFUSED, space_directions="(1.5,0,0) (0,1.5,0)"),
    _nrrd("directions of none", REFUSED, space_directions="none none none"),
    _nrrd("a turn by 20°", matrix=placed(turn=turned(20))),
    _nrrd("a turn rounded to 3 decimals", matrix=np.round(placed(turn=turned(20)), 3)),
    _nrrd("a mirror", matrix=placed(turn=_AXES_MM)),
    _nrrd("a shear", REFUSED, matrix=placed(turn=_SHEAR)),
    _nrrd("micrometres", EITHER, matrix=placed() * 1000, space_units='"um" "um" "um"'),
    _nrrd("metres", EITHER, matrix=placed() / 1000, space_units='"m" "m" "m"'),
    _nrrd("millimetres", space_units='"mm" "mm" "mm"'),
    _nrrd("other units an axis", EITHER, space_units='"mm" "m" "mm"'),
    _nrrd("nan in the origin", EITHER, space_origin="(nan,0,0)"),
    _nrrd("no origin", EITHER, drop=("space origin",)),
    _nrrd("lines of Windows", end="\r\n"),
    _nrrd("remarks", GOOD, damage.replaced(b"NRRD0005\n", b"NRRD0005\n# by hand\n")),
    _nrrd("an old version", GOOD, damage.replaced(b"NRRD0005", b"NRRD0004")),
    _nrrd("a newer version", EITHER, damage.replaced(b"NRRD0005", b"NRRD0009")),
    _nrrd("keys and values", GOOD, damage.replaced(b"\n\n", b"\nmade by:=a tool\nnote:=x: y\n\n", 1)),
    _nrrd("a field twice", EITHER, damage.replaced(b"\n\n", b"\ndimension: 3\n\n", 1)),
    _nrrd("spacings beside directions", EITHER, spacings="9 9 9"),
    _nrrd("measures of a frame", measurement_frame="(1,0,0) (0,1,0) (0,0,1)"),
]
_SIZES = [
    _nii("two dimensions", REFUSED, voxels=labels()[:, :, 16]),
    _nii("one layer", REFUSED, voxels=labels()[:, :, 16:17]),
    _nii("a time of one", voxels=labels()[..., None]),
    _nii("a time of two", REFUSED, voxels=np.stack([labels()] * 2, axis=-1)),
    _nii("five dimensions of one", voxels=labels()[..., None, None]),
    _nii("three values a voxel", REFUSED, voxels=np.stack([labels()] * 3, axis=-1)[:, :, :, None, :]),
    *(
        _nii(f"dimensions {dims}", REFUSED, dims=dims)
        for dims in (
            (3, 30000, 30000, 30000),
            (3, 0, 35, 33),
            (3, -37, 35, 33),
            (3, 38, 35, 33),
            (9, 37, 35, 33),
            (0, 37, 35, 33),
        )
    ),
    _nrrd("no colour", REFUSED, voxels=labels()[:, :, 16], kinds="domain domain"),
    *(
        _nrrd(f"{name} {value}", REFUSED, **_told(name, value))
        for name, value in (
            *(
                ("sizes", "30000 30000 30000"),
                ("sizes", "0 35 33"),
                ("sizes", "-37 35 33"),
                ("sizes", "38 35 33"),
            ),
            *(
                ("sizes", "37 35"),
                ("sizes", "a b c"),
                ("dimension", 4),
                ("dimension", "x"),
                ("dimension", 99),
            ),
            *(("type", "block"), ("type", "quaternion"), ("encoding", "zip"), ("data_file", "gone.raw")),
            *(("data_file", "/etc/passwd"), ("byte_skip", 999999), ("line_skip", 999999)),
        )
    ),
    _nrrd("float and double mixed up", REFUSED, type="double"),
    _nrrd("no type", REFUSED, drop=("type",)),
    _nrrd("no sizes", REFUSED, drop=("sizes",)),
    _nrrd("no encoding", REFUSED, drop=("encoding",)),
    _nrrd("no byte order", EITHER, drop=("endian",), voxels=labels(1, "u2")),
    _nrrd("skipped bytes", EITHER, byte_skip=-1),
]
_METAIMAGES = [
    *(_mha(f"of {kind}", voxels=labels(1, kind)) for kind in _KINDS),
    *(_mha(f"of {kind}, big endian", voxels=labels(3, kind), order=">") for kind in ("i2", "f4")),
    _mha("lines of Windows", end="\r\n"),
    _mha("two labels and one named", voxels=two_labels(), words=("--label", "2")),
    _mha("two labels", REFUSED, voxels=two_labels()),
    _mha("a map of probabilities", REFUSED, voxels=_noisy("f4", 0.7, 0.3)),
    _mha("three values a voxel", REFUSED, ElementNumberOfChannels=3),
    _mha("two dimensions", REFUSED, voxels=labels()[:, :, 16]),
    _mha("units of cm", REFUSED, DistanceUnits="cm"),
    _mha("sheared", REFUSED, TransformMatrix="1 0 0 0.17 0.985 0 0 0 1"),
    _mha("rounded", TransformMatrix="-1 0.012 0 -0.013 -1 0 0 0 1"),
    *(_mha(f"no {field}", EITHER, drop=(field,)) for field in ("TransformMatrix", "Offset", "ObjectType")),
    *(
        _mha(f"no {field}", REFUSED, drop=(field,))
        for field in ("NDims", "DimSize", "ElementType", "ElementSpacing", "ElementDataFile")
    ),
    *(
        _mha(f"{field} {value}", REFUSED, **_told(field, value))
        for field, value in (
            *(("NDims", 0), ("NDims", 4), ("NDims", "x"), ("DimSize", "30000 30000 30000")),
            *(
                ("DimSize", "0 35 33"),
                ("DimSize", "-37 35 33"),
                ("DimSize", "38 35 33"),
                ("DimSize", "a b c"),
            ),
            *(("ElementSpacing", "0 1 1"), ("ElementSpacing", "nan 1 1"), ("ElementSpacing", "1,5 1,5 2,5")),
            *(("ElementType", "MET_STRING"), ("BinaryData", False), ("ObjectType", "Tube")),
            *(("TransformMatrix", "0 0 0 0 0 0 0 0 0"), ("TransformMatrix", "1 0 0"), ("Offset", "inf 0 0")),
        )
    ),
    *(
        _mha(f"voxels in {file}", REFUSED, file=file)
        for file in ("gone.raw", "/etc/passwd", "LIST", "a%03d.raw 1 33 1", ".", "egg.mha")
    ),
    _two("mhd and raw", _apart, opened="egg.mhd"),
    _two("mhd and raw after a header", partial(_apart, HeaderSize=-1), opened="egg.mhd"),
    _two("mhd and raw after more than there is", partial(_apart, HeaderSize=99999), REFUSED, "egg.mhd"),
    _two("mhd and half a raw", _apart, REFUSED, "egg.mhd", {"egg.raw": damage.cut(0.5)}),
    _two("the raw of an mhd", _apart, REFUSED, "egg.raw"),
]
_PAIRS = [
    *(
        _two(f"{kind} by its {opened}", files, opened=f"egg.{opened}")
        for kind, files in (("a pair", pair), ("a second pair", _second_pair), ("analyze", analyze))
        for opened in ("hdr", "img")
    ),
    _two("a pair, big endian", partial(pair, labels(3, "i2"), order=">")),
    _two("a pair turned", partial(pair, sform=placed(turn=turned(20)))),
    *(
        _two(f"{kind} without its {lost}", partial(_without, files, lost), REFUSED, opened)
        for kind, files in (("a pair", pair), ("analyze", analyze))
        for lost, opened in (("egg.img", "egg.hdr"), ("egg.hdr", "egg.img"))
    ),
    *(
        _two(f"{kind}, the {file} {what}", files, expected, damages={file: harm})
        for kind, files in (("a pair", pair), ("analyze", analyze))
        for file, what, harm, expected in (
            ("egg.hdr", "cut", damage.cut(0.5), REFUSED),
            ("egg.img", "cut", damage.cut(0.5), REFUSED),
            ("egg.img", "short", damage.short(1), REFUSED),
            ("egg.img", "packed", damage.gzipped, GOOD),
            ("egg.img", "longer", damage.ended_with(bytes(99)), GOOD),
            ("egg.hdr", "random", damage.noise(0, 348), REFUSED),
            ("egg.hdr", "with flips", damage.flip(3, 40, 348), EITHER),
        )
    ),
]
_BROKEN = [
    *(
        _volume(f"{form} cut at {share}", _file(form), good, REFUSED, damage.cut(share))
        for form, good in FORMS.items()
        for share in (0.004, 0.2, 0.55, 0.98)
    ),
    *(
        _volume(f"{form} without its last byte", _file(form), good, REFUSED, damage.short(1))
        for form, good in FORMS.items()
        if form != "packed.nrrd"
    ),
    *(
        _volume(f"{form} with {count} flips {turn}", _file(form), good, EITHER, damage.flip(count))
        for form, good in FORMS.items()
        for count, turn in ((1, "a"), (10, "a"), (300, "a"))
    ),
    *(
        _volume(
            f"{form} with flips in the header {turn}",
            _file(form),
            FORMS[form],
            EITHER,
            damage.flip(2, 0, 340),
        )
        for form in ("nii", "nrrd", "mha")
        for turn in "abcdef"
    ),
    *(
        _volume(f"{form} with a hole", _file(form), good, REFUSED, damage.hole(999))
        for form, good in FORMS.items()
    ),
    *(
        _volume(f"{form} with zeros", _file(form), FORMS[form], REFUSED, damage.zeros(500))
        for form in ("nii.gz", "packed.nrrd")
    ),
    *(
        _volume(f"{form} with random bytes", _file(form), good, REFUSED, damage.noise(0, 400))
        for form, good in FORMS.items()
    ),
    *(
        _volume(f"{what} named .{form}", _file(form), lambda content=content: content, REFUSED)
        for form in FORMS
        for what, content in damage.STRANGERS.items()
        if form == "nii.gz" or what in ("nothing", "a web page", "zeros")
    ),
    *(
        special(KIND, what, f"egg.{form}", REFUSED)
        for what, form in zip(Special, ("nii", "nrrd", "nii.gz"), strict=True)
    ),
    _nii("no magic", EITHER, magic=b"\0\0\0\0"),
    _nii("the header of a pair", REFUSED, magic=b"ni1\0"),
    _volume("a header alone", "egg.nii", lambda: nifti()[:348], REFUSED),
    _volume("a header of 540 bytes alone", "egg.nii", lambda: nifti(version=2)[:540], REFUSED),
    _volume("nii goes on as nrrd", "egg.nii", nifti, EITHER, damage.joined(nrrd())),
]
CASES = (*_WRITTEN, *_VALUES, *_NAMED, *_LAYERED, *_PLACES, *_SIZES, *_METAIMAGES, *_PAIRS, *_BROKEN)
