"""Frames, covariates and settings."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from naisr_model.config import read_toml, require_ranges, to_json
from naisr_model.covariates import Covariate, Population, complete, read_values
from naisr_model.errors import InputError
from naisr_model.files import replacing
from naisr_model.frames import Frame, enclosing_frame
from naisr_model.models.factory import preset, presets, read_preset
from naisr_model.models.naisr.network import NaisrConfig

AGE = Covariate("age", "months", "continuous", centre=100.0, scale=50.0, range=(1.0, 233.0))
SEX = Covariate("sex", "", "binary", 0.0, 1.0, (-1.0, 1.0), ("F", "M"))


def test_frames_go_there_and_back():
    frame = enclosing_frame([-10, 0, -100], [30, 50, 100])
    points = np.random.default_rng(0).normal(size=(20, 3)) * 50
    assert frame.to_mm(frame.to_model(points)) == pytest.approx(points)
    assert np.abs(frame.to_model([[-10, 0, -100], [30, 50, 100]])).max() < 1
    assert frame.to_model([10, 25, 0]) == pytest.approx(0)
    assert Frame.from_json(frame.to_json()) == frame


def test_a_covariate_reads_what_people_write():
    assert AGE.parse(" 120 ") == 120 and SEX.parse("M") == 1 and SEX.parse("-0.5") == -0.5
    assert AGE.normalise(200.0) == 2 and AGE.restore(2.0) == 200
    assert AGE.format(120) == "120 months" and SEX.format(-1) == "F"
    assert "between F and M" in SEX.format(0.2)
    for bad in ("old", "nan", ""):
        with pytest.raises(InputError, match="age"):
            AGE.parse(bad)
    with pytest.raises(InputError, match="F or M"):
        SEX.parse("X")


def test_missing_covariates_are_at_the_centre_and_others_are_checked():
    assert complete((AGE, SEX), {"age": 12}) == {"age": 12.0, "sex": 0.0}
    with pytest.raises(InputError, match=r"412 months.*1 to 233 months; give a value within that"):
        complete((AGE, SEX), {"age": 412})
    assert complete((AGE, SEX), {"age": 412}, extrapolate=True)["age"] == 412
    with pytest.raises(InputError, match="unknown covariate 'height'"):
        complete((AGE, SEX), {"height": 1})
    with pytest.raises(InputError, match="finite"):
        complete((AGE, SEX), {"age": float("nan")}, extrapolate=True)


def test_in_range_is_said_once():
    assert AGE.contains(1.0) and AGE.contains(233.0 + 1e-12) and not AGE.contains(234.0)
    assert not AGE.contains(float("nan"))


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (2.5837, 91.4656),
        (1.0, 232.693),
        (0.3243984, 99.931519),
        (-0.004444, 0.0123456),
        (0.0, 1e-3),
        (1012.6, 98765.4),
    ],
)
def test_every_end_of_the_range_that_is_told_is_accepted(low, high):
    covariate = Covariate("weight", "kg", "continuous", (low + high) / 2, 1.0, (low, high))
    for end in (low, high):
        for told in (covariate.format(end).split()[0], f"{end:g}", f"{end:.{covariate.decimals}f}"):
            assert complete((covariate,), {"weight": covariate.parse(told)})["weight"] == float(told)
    extent = high - low
    for beyond in (low - 0.01 * extent, high + 0.01 * extent):
        with pytest.raises(InputError, match="the atlas was trained on"):
            complete((covariate,), {"weight": beyond})


COMMA = Covariate("BMI, percentile = low", "%", "continuous", 50.0, 20.0, (1.0, 99.0))


@pytest.mark.parametrize(
    ("texts", "values"),
    [
        (["age=120", " sex = M"], {"age": 120.0, "sex": 1.0}),
        (["age=120, sex=F,"], {"age": 120.0, "sex": -1.0}),
        (["age=12,BMI, percentile = low=50,sex=M"], {"age": 12.0, COMMA.name: 50.0, "sex": 1.0}),
    ],
)
def test_settings_are_read_in_real_units(texts, values):
    assert read_values("--set", texts, (AGE, SEX, COMMA)) == values


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["age=1", "age=2"], "'age' is given twice after --known; give it once"),
        (["age=1,sex=M,age=1"], "'age' is given twice"),
        (["age"], "'age' after --known is not understood; write NAME=VALUE"),
        (["age=12,5"], "'5' after --known is not understood"),
        (["tall,age=12"], "'tall' after --known is not understood"),
        ([""], "'' after --known is not understood"),
        (["=3"], "unknown covariate ''"),
        (["height=3"], "unknown covariate 'height' after --known; write NAME=VALUE with one of age, sex"),
        (["age=1_0"], "'age' is '1_0'; expected a number in months"),
        (["age=1e40"], "expected a number in months"),
        (["age=nan"], "expected a number in months"),
        (["sex=x"], "expected F or M"),
    ],
)
def test_what_is_no_setting_is_told(texts, message):
    with pytest.raises(InputError, match=message):
        read_values("--known", texts, (AGE, SEX))


def test_settings_where_there_is_nothing_to_set():
    with pytest.raises(InputError, match="'age'; its shapes depend on no covariates"):
        read_values("--known", ["age=3"], ())


def numbers_of(config: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    """Every number among some settings, with its name."""
    for item in dataclasses.fields(config):
        value = getattr(config, item.name)
        if dataclasses.is_dataclass(value):
            yield from numbers_of(value, f"{where}{item.name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{where}{item.name}", value


def changed(config: Any, where: str, value: Any) -> Any:
    first, _, rest = where.partition(".")
    inner = changed(getattr(config, first), rest, value) if rest else value
    return dataclasses.replace(config, **{first: inner})


@pytest.mark.parametrize("name", ["demo", "deepsdf-demo"])
def test_every_number_among_the_settings_has_a_range(name):
    chosen = preset(name)
    require_ranges(chosen)
    for where, value in numbers_of(chosen):
        for wrong in (-1, float("nan"), float("inf"), 10**400):
            with pytest.raises(InputError, match=rf"the setting '{where}' is .*; give .* to"):
                require_ranges(changed(chosen, where, wrong))
        assert value >= 0


def test_ranges_hold_in_lists_and_say_what_they_take():
    with pytest.raises(InputError, match=r"'training.epochs' is 2.5; give a whole number from 1 to 1000000"):
        require_ranges(changed(preset("demo"), "training.epochs", 2.5))
    wrong = changed(preset("demo"), "training.template_epochs", (5, 0))
    with pytest.raises(InputError, match=r"'training.template_epochs' is 0; give 1 to 1000000"):
        require_ranges(wrong)
    with pytest.raises(InputError, match=r"'training.seed' is 4294967296; give 0 to 4294967295"):
        require_ranges(changed(preset("demo"), "training.seed", 2**32))


@pytest.fixture
def children() -> Population:
    """Thirty of them, twice as heavy in hundred months; the last is held out."""
    ages = np.linspace(1, 200, 30)
    weight = Covariate("weight", "kg", "continuous", 30.0, 15.0, (5.0, 60.0))
    values = np.stack([ages, 5 + ages / 4, np.resize([-1.0, 1.0], 30)], axis=1)
    names = tuple(f"S{number}" for number in range(30))
    return Population((AGE, weight, SEX), names, names, values, np.arange(30) == 29)


def test_where_there_are_data_and_what_is_in_range_are_two_questions(children):
    assert children.has_data_at({"age": 100, "weight": 30}) and children.has_data_at({})
    assert children.has_data_at({"age": 100, "weight": 30, "sex": 0})  # between levels is a mixture, no gap
    stranger = {"age": 12.0, "weight": 45.0}
    assert children.contains(stranger) and not children.has_data_at(stranger)
    assert not children.contains({"age": 12.0, "weight": 75.0})


@pytest.fixture
def loose() -> Population:
    """Two hundred people over three continuous covariates and sex, with gaps between them."""
    rng = np.random.default_rng(3)
    names = tuple(f"S{number}" for number in range(200))
    covariates = [
        Covariate(name, "", "continuous", 0.0, 1.0, (-4.0, 4.0)) for name in ("one", "two", "three")
    ]
    middles = rng.choice([-2.0, 2.0], (200, 3))
    values = np.hstack(
        [(middles + rng.normal(0, 0.8, (200, 3))).clip(-4, 4), rng.choice([-1.0, 1.0], (200, 1))]
    )
    return Population((*covariates, SEX), names, names, values, np.arange(200) % 7 == 0)


def test_how_far_people_are_is_the_distance_to_the_third_of_them(loose):
    rng = np.random.default_rng(5)
    places = rng.uniform(-4, 4, (600, 4)) * [1, 1, 1, 0.25]
    tree = KDTree(loose.values[~loose.held_out][:, :3])
    usual = np.quantile(tree.query(tree.data, 4)[0][:, 3], 0.98)
    expected = tree.query(places[:, :3], 3)[0][:, 2] / usual
    assert loose.remoteness(places) == pytest.approx(expected, rel=1e-9)
    told = [loose.has_data_at(dict(zip(loose.names, place, strict=True))) for place in places]
    assert told == (expected <= 1).tolist() and 0.1 < np.mean(told) < 0.9


@pytest.mark.parametrize("name", ["one", "three"])
def test_stretches_with_data_are_where_there_are_data(loose, name):
    rng = np.random.default_rng(7)
    counts = []
    for place in rng.normal(0, 2.8, (40, 4)).clip(-4, 4):
        values = dict(zip(loose.names, place, strict=True))
        stretches = loose.stretches_with_data(name, values)
        counts.append(len(stretches))
        for value in np.linspace(-4, 4, 101):
            is_inside = any(low <= value <= high for low, high in stretches)
            assert is_inside == loose.has_data_at({**values, name: value})
    assert min(counts) == 0 and max(counts) >= 2


def test_a_level_has_data_wherever_its_people_may_be(loose):
    assert loose.stretches_with_data("sex", {"one": 2.0, "two": 2.0, "three": 2.0}) == ((-1.0, 1.0),)
    assert loose.stretches_with_data("sex", {"one": -4.0, "two": 4.0, "three": -4.0}) == ()
    alone = loose.keeping({"sex"})
    assert alone.stretches_with_data("sex", {}) == ((-1.0, 1.0),)


def test_a_population_with_fewer_covariates_is_the_same_people(children):
    some = children.keeping({"sex", "age"})
    assert some.names == ("age", "sex") and some.subjects == children.subjects
    assert some.values.tolist() == children.values[:, [0, 2]].tolist()
    none = children.keeping(())
    assert none.normalised().shape == (30, 0) and none.centre == {} and none.row(3) == {}
    assert none.contains({}) and none.has_data_at({})
    assert Population.from_json(none.to_json()).values.shape == (30, 0)
    with pytest.raises(InputError, match="'age'; its shapes depend on no covariates"):
        complete(none.covariates, {"age": 3})


def test_a_population_survives_json():
    population = Population(
        (AGE, SEX), ("a", "b"), ("1", "1"), np.array([[12.0, -1], [120, 1]]), np.array([False, True])
    )
    again = Population.from_json(population.to_json())
    assert again.covariates == population.covariates and (again.values == population.values).all()
    assert again.observed("age").tolist() == [12.0]
    assert again.row(1) == {"age": 120.0, "sex": 1.0}
    assert again.normalised()[0] == pytest.approx([(12 - 100) / 50, -1])


@pytest.mark.parametrize("name", presets())
def test_presets_survive_json(name):
    assert read_preset(to_json(preset(name))) == preset(name)


def test_settings_from_a_file_change_only_what_they_name(tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("[training]\nepochs = 7\n[training.loss]\nfolding = 1\n[network.template]\nwidth = 64\n")
    read = read_toml(path, preset("demo"))
    assert isinstance(read.network, NaisrConfig)
    assert (read.training.epochs, read.training.loss.folding, read.network.template.width) == (7, 1.0, 64)
    changed_back = dataclasses.replace(
        read.training, epochs=preset("demo").training.epochs, loss=preset("demo").training.loss
    )
    assert changed_back == preset("demo").training


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[training]\nepoch = 7\n", "unknown setting 'training.epoch'"),
        ("[training]\nepochs = 'many'\n", "'training.epochs' is 'many'; expected int"),
        ("training = 3\n", "'training' is 3; expected a table"),
        ("[training]\nlatent_rate = nan\n", "'training.latent_rate' is nan; give 1e-09 to 1000"),
        ("[training]\ntemplate_rate = 1" + 400 * "0" + "\n", "'training.template_rate' is inf"),
        ("[network]\nlatent = 0\n", "'network.latent' is 0; give 1 to 4096"),
        ("[network.template]\nwidth = -3\n", "'network.template.width' is -3; give 1 to 4096"),
        ("training = " + 3000 * "[", "cannot read the settings"),
        ("[training]\ntemplate_epochs = 5\n", "'training.template_epochs' is 5; expected a list of int"),
        ("[training]\ntemplate_epochs = '12'\n", "'training.template_epochs' is '12'; expected a list"),
        ("[training]\ntemplate_epochs = ['a']\n", "'training.template_epochs' is 'a'; expected int"),
        ("[training\n", "cannot read"),
        ('model = "deepsdf"', "'deepsdf' and the preset is for 'naisr'"),
    ],
)
def test_wrong_settings_are_named(tmp_path, text, message):
    path = tmp_path / "settings.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_toml(path, preset("demo"))
    with pytest.raises(InputError, match="choose one of"):
        preset("huge")


def test_a_failed_write_leaves_what_was_there(tmp_path):
    path = tmp_path / "kept.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    with replacing(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new"
