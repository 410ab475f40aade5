"""The record of a reconstruction and the tables made of it."""

from __future__ import annotations

import json

import pytest
from rich.console import Console
from rich.markdown import Markdown

from naisr_model import cli
from naisr_model.errors import InputError
from naisr_model.evaluation.metrics import Distances
from naisr_model.evaluation.studies.reconstruction import Reconstruction
from naisr_model.evaluation.study import run
from naisr_model.evaluation.truth import TruthPoint
from naisr_model.shipped import shipped_atlas


def distances(cd_x100: float, hd_x100: float) -> Distances:
    others = {"hd95_x100": 1.0, "emd_x100": 3.0, "mean_mm": 0.5, "vd_cm3": 0.1}
    return Distances({"cd_x100": cd_x100, "hd_x100": hd_x100, **others}, samples=30_000, emd_samples=2048)


FIRST, *OTHERS = (distances(cd, hd) for cd, hd in [(0.01, 2.0), (0.02, 3.0), (0.06, 10.0)])
GROWTH = [
    TruthPoint("age", 6, "girls", volume_cm3=2.1, truth_cm3=2.0, hd_x100=1.5),
    TruthPoint("age", 6, "boys", volume_cm3=1.8, truth_cm3=2.0, hd_x100=1.6),
    TruthPoint("age", 220, "boys", volume_cm3=62.0, truth_cm3=60.0, hd_x100=2.5),
]
EFFECTS = [
    TruthPoint("age", 60, "", volume_cm3=33.0, truth_cm3=30.0, hd_x100=2.0),
    TruthPoint("age", 117, "", volume_cm3=39.0, truth_cm3=40.0, hd_x100=2.0),
    TruthPoint("weight", 40, "", volume_cm3=38.0, truth_cm3=40.0, hd_x100=2.0),
]
AIRWAY = Reconstruction(shipped_atlas())


def refits(part: str, found: list[Distances | None]) -> list[dict]:
    measured = [one and one.to_json() for one in found]
    return [{"part": part, "distances": one, "components": 1 if one else 0, "fit_s": 1.0} for one in measured]


def report(**changes: list) -> dict:
    """That of the records of some parts, which may be changed."""
    parts = {
        "given": refits("given", [FIRST, *OTHERS]),
        "growth": [{"place": point.to_json()} for point in GROWTH],
        "effects": [{"place": point.to_json()} for point in EFFECTS],
        "plausible": [{"components": 1}, {"components": 2}],
        "folding": [{"share": 0.0025}],
        "displacement": [{"lengths_mm": {"age": 0.5}}],
        **changes,
    }
    return AIRWAY.summarise([{"part": part, **one} for part, records in parts.items() for one in records])


def test_refits_with_everything_known_are_the_main_figures() -> None:
    found = report()
    assert found["n"] == 3 and found["inferred"] is None
    assert found["cd_x100"] == pytest.approx({"mean": 0.03, "median": 0.02})


def test_fits_with_nothing_known_stand_beside_the_others() -> None:
    found = report(inferred=refits("inferred", [*OTHERS, None]))
    assert found["inferred"]["n"] == 2 and found["without_surface"] == 1
    assert found["inferred"]["cd_x100"] == pytest.approx({"mean": 0.04, "median": 0.04})
    text = AIRWAY.markdown(found)
    assert "3 held-out shapes, covariates given | 0.03 / 0.02" in text
    assert "2 held-out shapes, covariates inferred | 0.04 / 0.04" in text
    assert "Fits without any surface: 1" in text


def test_the_worst_volume_error_is_kept_with_its_sign() -> None:
    found = report()
    assert found["truth_volume_error"] == pytest.approx({"6": -0.1, "220": 2 / 60})
    assert found["effect_volume_error"] == pytest.approx({"age": 0.1, "weight": -0.05})


def test_components_and_folds() -> None:
    found = report(corners=[{"components": 3}])
    assert found["components"] == [1, 2] and found["corner_components"] == [3, 3]
    assert found["folded_share"] == 0.0025


def test_the_record_survives_json() -> None:
    found = report()
    assert json.loads(json.dumps(found)) == found


def test_an_atlas_without_a_known_truth_has_no_truth_tables() -> None:
    found = report(growth=[], effects=[])
    assert found["truth_volume_error"] == {} and found["template"] is None
    assert "growth path" not in AIRWAY.markdown(found)


def test_a_model_that_deforms_nothing_is_not_asked_for_folds() -> None:
    found = report(folding=[], displacement=[])
    assert found["folded_share"] is None and "Folded" not in AIRWAY.markdown(found)


def test_no_surface_at_all_is_said_in_words() -> None:
    with pytest.raises(InputError, match="no fit of a held-out shape has a surface"):
        report(given=refits("given", [None]))


def test_the_table_shows_values_units_definitions_and_the_published_rows() -> None:
    text = AIRWAY.markdown(report())
    assert "0.03 / 0.02" in text and "VD, cm³" in text and "-10.0 %" in text
    assert "mean squared nearest-neighbour" in text
    published = [line for line in text.splitlines() if line.startswith("| published")]
    assert len(published) == 2 and "0.084 / 0.044" in published[0]
    for block in text.split("\n\n"):
        rows = [line for line in block.splitlines() if line.startswith("|")]
        assert len({row.count("|") for row in rows}) <= 1


def test_a_terminal_shows_the_same_table() -> None:
    console = Console(width=160)
    with console.capture() as shown:
        console.print(Markdown(AIRWAY.markdown(report())))
    assert "0.03 / 0.02" in shown.get()


@pytest.mark.usefixtures("coarse")
def test_shapes_of_one_s_own(egg_atlas, egg_store, tmp_path, capsys):
    target = tmp_path / "figures.json"
    words = ["evaluate", "reconstruction", str(egg_atlas)]
    given = ["--store", str(egg_store.path), "--json", str(target), "--limit", "2"]
    assert cli.main([*words, *given]) == 0
    figures = json.loads(target.read_text())
    assert "cm³" in capsys.readouterr().out and figures["n"] == 2
    assert 0 < figures["cd_x100"]["mean"] < 5 and 0 < figures["hd_x100"]["median"] < 30
    assert figures["components"] == [1, 1] and figures["folded_share"] < 0.05
    assert figures["truth_volume_error"] == {}
    assert cli.main(words) == 2
    assert "--store" in capsys.readouterr().err


@pytest.mark.usefixtures("coarse")
def test_a_known_truth_is_held_against_the_atlas(egg_people):
    found = run(Reconstruction(egg_people.atlas, limit=1))
    assert found["truth_volume_error"].keys() == {"3", "7"}
    assert all(abs(error) < 0.15 for error in found["truth_volume_error"].values())
    assert found["effect_volume_error"].keys() == {"age", "sex"}
    assert found["template"]["condition"] == "template"


@pytest.mark.usefixtures("coarse")
def test_a_model_without_covariates_is_asked_for_what_it_can_do(egg_deepsdf, egg_store):
    study = Reconstruction(egg_deepsdf, store=egg_store.path, limit=1)
    found = run(study)
    assert found["n"] == 1 and found["inferred"] is None and found["folded_share"] is None
    assert found["mean_displacement_mm"] == {} and found["corner_components"] == []
    assert "1 held-out shapes, no covariates |" in study.markdown(found)
