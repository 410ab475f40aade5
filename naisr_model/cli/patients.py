"""Commands about one patient's shape: ``fit``, ``transfer``, ``evolve`` and ``measure``."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from naisr_model.cli.console import bar, stoppable, told_anyway, write_json
from naisr_model.cli.options import AtlasFile, FolderToWrite, JsonFile
from naisr_model.errors import InputError
from naisr_model.terminal import say

if TYPE_CHECKING:
    from naisr_model.covariates import Covariate, Values  # loads numpy, which '--help' does not need
    from naisr_model.frames import Extent

PatientFile = Annotated[
    Path,
    Parameter(help="a mesh, whole or in part, a label volume or a cloud of points; of a 2D atlas a curve."),
]


@Parameter(name="*")
@dataclasses.dataclass(frozen=True)
class ReadingOptions:
    """How a patient's file is read.

    Attributes:
        label: which label of a volume, its number or its name.
        scale: millimetres per unit of the file; left out, it is guessed where the size is implausible.
        align: none, icp or landmarks; onto the atlas's shape at the known covariates.
        landmarks: CSV name,x,y,z in the coordinates of the file.
    """

    label: str | None = None
    scale: float | None = None
    align: Literal["none", "icp", "landmarks"] = "none"
    landmarks: Path | None = None


@Parameter(name="*")
@dataclasses.dataclass(frozen=True)
class IntakeOptions(ReadingOptions):
    """How a patient's file is read, and what is known of the patient.

    Attributes:
        known: covariates of the scan, as age=84,weight=20.4,sex=M; the others are inferred.
    """

    known: str = ""


_AS_IT_IS = IntakeOptions()
_AS_IT_LIES = ReadingOptions()


def fit(
    patient: PatientFile,
    *,
    atlas: AtlasFile,
    reading: IntakeOptions = _AS_IT_IS,
    out: Annotated[
        FolderToWrite | None, Parameter(help="folder for the fitted surface, a table and a picture.")
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Fit a patient's shape: covariates that are not given are inferred, all with 95 % intervals."""
    from naisr_model.patients.evolution import fit_record
    from naisr_model.patients.series import series_records, write_series

    _require_own(out, patient)
    fitted, intake = _fitted(patient, _loaded(atlas), reading)
    record, people = fit_record(fitted), [fitted.individual]
    with told_anyway(lambda: _tell_fit(fitted, record["alternatives"])):
        if out is not None:
            write_series(out, people, series_records(people), patient)
        write_json(json_file, {"patient": intake.to_json(), **record})


def transfer(
    patient: PatientFile,
    *,
    atlas: AtlasFile,
    to: Annotated[
        str,
        Parameter(
            help="covariates to show the patient at, as age=120,weight=28.5; "
            "the others stay as known or as fitted."
        ),
    ],
    reading: IntakeOptions = _AS_IT_IS,
    out: Annotated[
        FolderToWrite | None, Parameter(help="folder for both surfaces, a table and a picture.")
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Show a patient's shape at other covariates, as it is expected on another day."""
    from naisr_model.covariates import read_values

    _require_own(out, patient)
    loaded = _transferable(atlas)
    wanted = read_values("--to", [to], loaded.covariates)
    loaded.complete(wanted)  # refused before the fit
    fitted, intake = _forecastable(patient, loaded, reading)
    _tell_series(fitted, intake, [fitted.individual, fitted.at(wanted)], patient, out, json_file)


def evolve(
    patient: PatientFile,
    *,
    atlas: AtlasFile,
    reading: IntakeOptions = _AS_IT_IS,
    along: Annotated[str, Parameter(help="the covariate that moves.")] = "age",
    start: Annotated[
        float | None, Parameter(name="--from", help="its first value; left out, the patient's.")
    ] = None,
    stop: Annotated[
        float | None, Parameter(name="--to", help="its last value; left out, the largest observed one.")
    ] = None,
    steps: Annotated[int, Parameter(help="shapes on the way, both ends included.")] = 6,
    path: Annotated[
        str,
        Parameter(
            help="population (the others grow as usual), only (the effect of this covariate by itself), "
            "or a CSV whose header names covariates, a row for each step."
        ),
    ] = "population",
    out: Annotated[
        FolderToWrite | None, Parameter(help="folder for the surfaces, a table and a picture.")
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Follow a patient's shape along one covariate."""
    from naisr_model.patients.evolution import evolution, require_way

    _require_own(out, patient)
    loaded, way = _transferable(atlas), (along, start, stop, steps, path)
    require_way(loaded, *way)  # refused before the fit
    fitted, intake = _forecastable(patient, loaded, reading)
    _tell_series(fitted, intake, evolution(fitted, *way), patient, out, json_file)


def measure(
    atlas: AtlasFile,
    *,
    scan: Annotated[
        Path | None,
        Parameter(help="whom to measure: a file as 'naisr fit' takes it; the average without one."),
    ] = None,
    set: Annotated[
        list[str] | None,
        Parameter(
            name="--set",
            help="a covariate's value in real units, as age=120; left out, it is at the population centre, "
            "or inferred from the scan.",
        ),
    ] = None,
    reading: ReadingOptions = _AS_IT_LIES,
    json_file: JsonFile = None,
) -> None:
    """Measure a shape: volume, area, length and cross-sections, among people of the same covariates."""
    from naisr_model.covariates import read_values
    from naisr_model.measures.norms import norms_of
    from naisr_model.measures.report import measure_record

    if scan is None and reading != _AS_IT_LIES:
        raise InputError("--label, --scale, --align and --landmarks tell how a scan is read; add --scan FILE")
    loaded = _loaded(atlas)
    if not loaded.capabilities.deformable:
        raise InputError(f"{loaded.model_title} deforms no template, which 'naisr measure' needs")
    values = read_values("--set", set or [], loaded.covariates)
    loaded.complete(values)  # refused before the work
    fitted = None
    if scan is not None:
        known = IntakeOptions(known=",".join(set or []), **dataclasses.asdict(reading))
        fitted, _ = _forecastable(scan, loaded, known)
        values = fitted.covariates
    with bar("measuring") as progress:
        norms = norms_of(loaded, progress=progress)
    record = measure_record(norms, values, None if fitted is None else fitted.individual)
    with told_anyway(lambda: _tell_measures(record, loaded.covariates, fitted)):
        write_json(json_file, record)


def _require_own(out: Path | None, patient: Path) -> None:
    """Before the work: a folder of somebody else's is refused."""
    from naisr_model.patients.series import require_own

    if out is not None:
        require_own(out, patient)


def _loaded(atlas: Path) -> Any:
    from naisr_model.atlas import Atlas

    return Atlas.load(atlas)


def _transferable(atlas: Path) -> Any:
    """An atlas that knows a person at other covariates."""
    loaded = _loaded(atlas)
    if not loaded.capabilities.transferable:
        raise InputError(
            f"{loaded.model_title} does not carry shapes to other covariates; "
            "see the shape itself with 'naisr fit'"
        )
    return loaded


def _forecastable(patient: Path, loaded: Any, reading: IntakeOptions) -> tuple[Any, Any]:
    """As :func:`_fitted`, of somebody who may be shown at other covariates."""
    fitted, intake = _fitted(patient, loaded, reading)
    if not fitted.is_valid:
        raise InputError("; ".join(fitted.remarks))
    return fitted, intake


def _fitted(patient: Path, loaded: Any, reading: IntakeOptions) -> tuple[Any, Any]:
    """The fit, and how the file was brought into the frame of the atlas."""
    from naisr_model.covariates import read_values
    from naisr_model.patients.fitting import fitted_in_place
    from naisr_model.patients.intake import take_in

    options = dataclasses.asdict(reading)
    told = options.pop("known")
    known = read_values("--known", [told] if told else [], loaded.covariates)
    loaded.complete(known)  # refused before a scan is read and repaired
    with stoppable() as progress:
        intake = take_in(patient, loaded, known, **options, progress=progress)
    for sentence in intake.sentences:
        say(f"naisr: {sentence}")
    with bar("fitting") as progress:
        fitted, lies = fitted_in_place(intake, loaded, known, progress=progress)
    if lies is not intake:
        say(f"naisr: {lies.alignment}")
    return fitted, lies


def _tell_fit(fitted: Any, alternatives: Sequence[Mapping[str, Any]]) -> None:
    from naisr_model.covariates import interval_in_words

    if not fitted.is_valid:
        print("\n".join(fitted.remarks))
        return
    covariates = fitted.individual.atlas.covariates
    for covariate in covariates:
        ends = fitted.intervals.get(covariate.name)
        interval = "" if ends is None else f" ({interval_in_words(covariate, *ends)})"
        print(f"{covariate.name}: {covariate.format(fitted.covariates[covariate.name])}{interval}")
    for other in alternatives[1:]:
        share, values = 100 * other["probability"], _row(covariates, other["covariates"])
        print(f"or, with a probability of {share:.0f} %: {values}")
    atlas = fitted.individual.atlas
    print(f"{atlas.extent.title}: {_in_interval(atlas.extent, fitted.extent, *fitted.extent_interval)}")
    print(f"residual: {atlas.frame.length(fitted.residual_mm, 2)}, {fitted.seconds:.1f} s")
    for sentence in fitted.remarks:
        print(sentence)


def _in_interval(extent: Extent, value: float, low: float, high: float) -> str:
    """``46.7 cm³ (45.1 to 48.2)``."""
    ends = (extent.told(end).removesuffix(f" {extent.unit}") for end in (low, high))
    return f"{extent.told(value)} ({' to '.join(ends)})"


def _row(covariates: Iterable[Covariate], values: Values) -> str:
    """As people write them: ``73.7 months, 21.1 kg, F``."""
    return ", ".join(covariate.format(values[covariate.name]) for covariate in covariates)


def _tell_series(
    fitted: Any, intake: Any, people: Sequence[Any], patient: Path, out: Path | None, json_file: Path | None
) -> None:
    from naisr_model.patients.series import series_records, write_series

    with bar("measuring") as progress:
        records = series_records(people, progress)
    with told_anyway(lambda: _tell_volumes(people, records, fitted.lasting)):
        if out is not None:
            write_series(out, people, records, patient)
        write_json(json_file, {"patient": intake.to_json(), "lasting": fitted.lasting, "shapes": records})


def _tell_volumes(people: Sequence[Any], records: Sequence[Mapping[str, Any]], lasting: float) -> None:
    for person, record in zip(people, records, strict=True):
        where = _row(person.atlas.covariates, person.covariates)
        extent = person.atlas.extent
        told = _in_interval(extent, *(record[extent.key(*part)] for part in ((), ("low",), ("high",))))
        print(f"{where}: {told}")
    print(f"at other covariates {100 * lasting:.0f} % of what sets the patient apart is kept")


def _tell_measures(record: Mapping[str, Any], covariates: Iterable[Covariate], fitted: Any) -> None:
    """A table, and with whom the shape is compared."""
    from naisr_model.measures.kinds import MEASURES

    whose, beside = ("average", "95 % sure") if fitted is None else ("patient", "percentile")
    print(f"{'':24}{whose:>14}  {'95 % of people have':26}{beside}".rstrip())
    for name, row in record["measures"].items():
        value, low, high = (_three_digits(row[key]) for key in ("value", "low", "high"))
        usual = f"{low} to {high} {row['unit']}"
        found = _sure_in_words(row) if fitted is None else f"{row['percentile']:.0f}"
        print(f"{MEASURES[name].title:24}{f'{value} ' + row['unit']:>14}  {usual:26}{found}".rstrip())
    if "sections" in record:
        print(f"narrowest {record['sections']['narrowest_at_mm']:.0f} mm from the upper end")
    if "outside" in record:
        print(f"{100 * record['outside']:.1f} % of the surface lies outside the band of 95 % of people")
    if fitted is not None:
        away = fitted.individual.atlas.frame.length(fitted.residual_mm, 2)
        print(f"measured on the fit, which is {away} from the scan on average")
    print(f"people: {_row(covariates, record['covariates'])}")
    if fitted is not None and fitted.inferred:
        names = ", ".join(fitted.inferred)
        print(f"inferred from the scan itself: {names}; the people are those that it looks like")


def _sure_in_words(row: Mapping[str, Any]) -> str:
    """Where the average is with a probability of 95 %; nothing where people are too few to say."""
    ends = [_three_digits(row[key]) for key in ("sure_low", "sure_high") if key in row]
    return " to ".join(ends)


def _three_digits(value: float) -> str:
    """A positive number with three digits that count, or all before the point."""
    return f"{value:,.{max(0, 2 - math.floor(math.log10(value)))}f}"
