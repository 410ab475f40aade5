"""Cohorts with a row that does not belong: what ``naisr prepare`` says of it, and that it spoils nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from naisr_model import cli
from naisr_model.data.store import SampleStore

PEOPLE = 12
SCANNER_MM = np.array([30.0, -40.0, 100.0])
MARKS_MM = np.array([[0, 0, 0], [20, 0, 0], [0, 14, 0], [3, 0, 30], [0, 5, -30], [9, 4, 12]], float)


class Person:
    """Who is written as a row; a test changes what it likes."""

    def __init__(self, number: int, rng: np.random.Generator) -> None:
        size = 0.6 + 0.8 * number / (PEOPLE - 1) + 0.02 * rng.normal()
        shift = SCANNER_MM + rng.normal(size=3)
        self.mesh = bent_pear(size).apply_translation(shift)
        marks = MARKS_MM * size + shift + 0.3 * rng.normal(size=MARKS_MM.shape)
        self.landmarks = dict(zip("oabcde", marks, strict=True))
        self.file, self.subject, self.age = f"{number}.stl", f"s{number}", 20 + 10 * number


def bent_pear(size: float) -> trimesh.Trimesh:
    """A body that no half turn and no mirror lays on itself."""
    mesh = trimesh.creation.icosphere(2)
    x, y, z = mesh.vertices.T
    x = x * (1 + 0.4 * z) + 0.3 * np.cos(2.5 * z)
    mesh.vertices = np.stack([20 * x, 14 * y * (1 + 0.3 * x), 30 * z + 4 * y], axis=1) * size
    return mesh


@pytest.fixture
def prepared(tmp_path, capsys):
    """``prepared(method, changes)`` prepares a cohort and gives what was said, the report and the store."""

    def run(method="none", accept=(), **changes):
        rng = np.random.default_rng(1)
        people = [Person(number, rng) for number in range(PEOPLE)]
        for name, change in changes.items():
            change(people[int(name.removeprefix("p"))], people)
        table = write(tmp_path, people, method)
        samples = [f"--{kind}-samples=50" for kind in ("surface", "near", "uniform")]
        accepted = [word for row in accept for word in ("--accept", str(row))]
        code = cli.main(
            ["prepare", str(table), "--out", str(tmp_path / "store"), *samples, "--workers=1", *accepted]
        )
        said = capsys.readouterr()
        assert code == 0, said.err
        report = json.loads((tmp_path / "store" / "report.json").read_text())
        return said.out, report, SampleStore.open(tmp_path / "store")

    return run


def write(folder: Path, people: list[Person], method: str) -> Path:
    lines = ["mesh,subject,landmarks,age [months],sex"]
    for number, person in enumerate(people):
        person.mesh.export(folder / person.file)
        rows = "".join(f"{name},{x},{y},{z}\n" for name, (x, y, z) in person.landmarks.items())
        (folder / f"{number}.csv").write_text("name,x,y,z\n" + rows)
        lines.append(f"{person.file},{person.subject},{number}.csv,{person.age},{'FM'[number // 2 % 2]}")
    (folder / "data.csv").write_text("\n".join(lines) + "\n")
    (folder / "data.toml").write_text(f'[alignment]\nmethod = "{method}"\n')
    return folder / "data.csv"


def times(factors):
    def change(person: Person, _people) -> None:
        faces = person.mesh.faces if np.prod(factors) > 0 else person.mesh.faces[:, ::-1]
        person.mesh = trimesh.Trimesh(person.mesh.vertices * factors, faces, process=False)

    return change


def with_debris(person: Person, _people) -> None:
    speck = trimesh.creation.icosphere(1, radius=1.5).apply_translation([900, 0, 0])
    person.mesh = trimesh.util.concatenate([person.mesh, speck])


def elsewhere(person: Person, _people) -> None:
    person.mesh.apply_translation([0, 400, 0])


def thinner(person: Person, _people) -> None:
    centre = person.mesh.centroid
    person.mesh.vertices = centre + (person.mesh.vertices - centre) * [0.4, 0.4, 1]


def of_the_third(person: Person, people, file: str | None = None) -> None:
    person.mesh, person.file = people[2].mesh.copy(), file or person.file


def of_the_third_moved(person: Person, people) -> None:
    of_the_third(person, people, "moved.ply")
    person.mesh.apply_transform(trimesh.transformations.rotation_matrix(0.4, [0, 1, 1], SCANNER_MM))


@pytest.mark.parametrize("method", ["none", "icp", "landmarks"])
def test_of_a_good_cohort_nothing_is_said(prepared, method):
    said, report, store = prepared(method)
    assert (report["rejected"], report["warnings"], report["table"]) == ([], [], [])
    assert len(store) == PEOPLE
    assert "age [months]: a number from 20 to 130" in said


WRONG = {
    "metres": ("none", times([1e-3] * 3), "1,0", "looks like metres, so scale it by 1000"),
    "centimetres": ("icp", times([0.1] * 3), "times smaller than usual", "centimetres, so scale it by 10"),
    "inches": ("landmarks", times([1 / 25.4] * 3), "times smaller", "inches, so scale it by 25.4"),
    "RAS": ("none", times([-1, -1, 1]), "turned by half about z, as RAS is to LPS", "space of the others"),
    "RAS, to be moved": ("icp", times([-1, -1, 1]), "turned by half about z", "space of the others"),
    "RAS, not its landmarks": ("landmarks", times([-1, -1, 1]), "landmarks lie", "one frame, LPS or RAS"),
    "mirrored": ("none", times([-1, 1, 1]), "mirrored left to right", "space of the others"),
    "debris": ("none", with_debris, "pieces lie far from the rest", "remove them"),
    "elsewhere": ("none", elsewhere, "mm from the middle of the others", 'method = "icp"'),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mesh_that_does_not_belong_is_left_out_and_told(prepared, name):
    method, change, *words = WRONG[name]
    said, report, store = prepared(method, p5=change)
    assert [remark["row"] for remark in report["rejected"]] == [7]
    assert all(word in report["rejected"][0]["reason"] for word in words)
    assert f"rejected {report['rejected'][0]['path']} (row 7): " in said
    assert (len(store), report["warnings"]) == (PEOPLE - 1, [])
    assert 2 * store.frame.scale_mm < 130, "the frame of all others has grown"


def test_the_others_are_as_if_it_had_not_been_there(prepared):
    names = ("centre_mm", "scale_mm")
    _, _, with_it = prepared("none", p5=times([1e-3] * 3))
    first = {name: getattr(with_it.frame, name) for name in names}
    _, _, debris = prepared("none", p5=with_debris)
    assert first == {name: getattr(debris.frame, name) for name in names}


def test_one_mesh_under_three_subjects_is_refused(prepared):
    def third(person, people):
        of_the_third(person, people, "copy.ply")

    said, report, store = prepared("none", p5=third, p8=of_the_third_moved)
    assert [(remark["row"], remark["topic"]) for remark in report["rejected"]] == [
        (4, "repeated"),
        (7, "repeated"),
        (10, "repeated"),
    ]
    assert "rows 7 and 10, of another subject ('s5', 's8')" in said
    assert len(store) == PEOPLE - 3


def test_one_mesh_for_two_visits_of_a_subject_is_told(prepared):
    def again(person, people):
        of_the_third(person, people)
        person.subject = "s2"

    said, report, store = prepared("none", p5=again)
    assert (report["rejected"], len(store)) == ([], PEOPLE)
    assert [one["row"] for one in report["warnings"] if one["topic"] == "repeated"] == [4, 7]
    assert "the mesh is that of row 4, another visit of the same subject" in said


def test_rows_that_were_looked_at_are_kept_and_told(prepared):
    def third(person, people):
        of_the_third(person, people, "copy.ply")

    _, report, store = prepared("none", accept=[7], p5=third)
    assert [remark["row"] for remark in report["rejected"]] == [4]
    assert "or keep it with --accept 4 if it is right" in report["rejected"][0]["reason"]
    assert (7, "repeated") in [(one["row"], one["topic"]) for one in report["warnings"]]
    assert len(store) == PEOPLE - 1
    _, report, store = prepared("none", accept=[7, 4], p5=third)
    assert (report["rejected"], len(store)) == ([], PEOPLE)
    kept = [one["row"] for one in report["warnings"] if "it was kept by --accept" in one["reason"]]
    assert kept == [4, 7]


@pytest.mark.parametrize("name", ["centimetres", "mirrored", "elsewhere"])
def test_so_is_a_mesh_unlike_the_others(prepared, name):
    method, change, first, *_ = WRONG[name]
    _, report, store = prepared(method, accept=[7], p5=change)
    assert (report["rejected"], len(store)) == ([], PEOPLE)
    assert [(one["row"], one["severity"]) for one in report["warnings"]] == [(7, "look")]
    assert first in report["warnings"][0]["reason"]


def test_a_row_with_a_code_is_left_out_as_if_it_had_not_been_there(prepared):
    def coded(person, _people):
        person.age = 999

    said, report, store = prepared("none", p5=coded)
    assert [(one["row"], one["topic"]) for one in report["rejected"]] == [(7, "missing")]
    assert "refuse: 'age' is 999 in row 7, and otherwise 20 to 130" in said
    assert "age [months]: a number from 20 to 130" in said and report["warnings"] == []
    assert (len(store), store.population.covariates[0].range[1]) == (PEOPLE - 1, 130)
    _, report, store = prepared("none", accept=[7], p5=coded)
    assert (report["rejected"], len(store)) == ([], PEOPLE)
    assert 999 in store.population.values[:, 0]


def test_an_accepted_row_that_is_not_there_is_told(tmp_path, capsys):
    (tmp_path / "data.csv").write_text("mesh,subject,age\na.stl,a,1\nb.stl,b,2\nc.stl,c,7\n")
    assert cli.main(["prepare", str(tmp_path / "data.csv"), "--check", "--accept", "9"]) == 2
    assert "has no row 9 to accept; its rows are 2 to 4" in capsys.readouterr().err


def test_another_volume_than_at_such_covariates_is_told(prepared):
    _, report, store = prepared("landmarks", p11=thinner)
    assert [remark["row"] for remark in report["warnings"]] == [13]
    assert "times smaller than usual at such covariates" in report["warnings"][0]["reason"]
    assert len(store) == PEOPLE


def changed_marks(change):
    def apply(person: Person, _people) -> None:
        person.landmarks = change({name: np.array(point) for name, point in person.landmarks.items()})

    return apply


MARKS = {
    "swapped": (lambda m: {**m, "c": m["e"], "e": m["c"]}, "'c' and 'e' look swapped"),
    "mirrored": (lambda m: {k: p * [-1, 1, 1] + [60, 0, 0] for k, p in m.items()}, "mirrored"),
    "in metres": (lambda m: {k: p / 1000 for k, p in m.items()}, "in the unit of the mesh"),
    "in RAS": (lambda m: {k: p * [-1, -1, 1] for k, p in m.items()}, "one frame, LPS or RAS"),
    "one slipped": (lambda m: {**m, "c": m["c"] + [50, 0, 0]}, "otherwise than those of the others"),
    "one at 1e6": (lambda m: {**m, "c": [1e6, 0, 0]}, "'c' is at 1e+06, 0, 0, beyond any scanner"),
    "one at 1e100": (lambda m: {**m, "c": [1e100, 0, 0]}, "larger than anything that is measured"),
    "one is no number": (
        lambda m: {**m, "c": ["nan", 0, 0]},
        "must have the columns name,x,y,z with numbers",
    ),
    "two at the origin": (lambda m: {**m, "c": [0, 0, 0], "d": [0, 0, 0]}, "'c' and 'd' both at 0, 0, 0"),
    "a name twice": (lambda m: {"o": m["o"], "a": m["a"], "A": m["b"], "c": m["c"]}, "twice"),
    "others alone": (lambda m: dict(zip("uvwxyz", m.values(), strict=True)), "3 landmarks of the atlas"),
    "two alone": (lambda m: {"o": m["o"], "a": m["a"]}, "3 landmarks of the atlas are needed"),
}


@pytest.mark.parametrize("name", MARKS)
def test_landmarks_that_do_not_belong_are_left_out_of_everything(prepared, name):
    change, words = MARKS[name]
    _, report, store = prepared("landmarks", p5=changed_marks(change))
    assert [remark["row"] for remark in report["rejected"]] == [7]
    assert words in report["rejected"][0]["reason"]
    assert sorted(store.alignment.reference) == list("abcdeo")
    between = np.linalg.norm(np.subtract(store.alignment.reference["c"], store.alignment.reference["d"]))
    assert between == pytest.approx(np.linalg.norm(MARKS_MM[3] - MARKS_MM[4]), rel=0.1)


def test_landmarks_that_are_missing_are_told_and_their_names_may_differ_by_case(prepared):
    few = changed_marks(lambda m: {name: m[name] for name in "oabc"})
    loud = changed_marks(lambda m: {name.upper(): point for name, point in m.items()})
    _, report, store = prepared("landmarks", p3=few, p5=loud)
    assert report["rejected"] == []
    assert [(one["row"], "'d', 'e'" in one["reason"]) for one in report["warnings"]] == [(5, True)]
    assert sorted(store.alignment.reference) == list("abcdeo")


def test_what_one_row_has_stands_before_what_all_have(prepared):
    """Eleven rows with a hole of one face each do not hide the one in another place."""

    def holed(person, people):
        for one in people:
            one.mesh.update_faces(np.arange(len(one.mesh.faces)) > 0)
        person.mesh.apply_translation([0, 62, 0])

    said, report, _ = prepared("none", p5=holed)
    looks = [line for line in said.splitlines() if line.startswith(("rejected", "look"))]
    assert "(row 7)" in looks[0] and "middle of the others" in looks[0]
    assert [remark for remark in report["warnings"] if remark["topic"] == "open"]
    assert sum("open edges" in line for line in looks) == 1
    assert f"{sum(remark['topic'] == 'open' for remark in report['warnings'])} rows" in said


def test_a_cohort_in_metres_is_told(prepared):
    everybody = {f"p{number}": times([1e-3] * 3) for number in range(PEOPLE)}
    _, report, _ = prepared("none", **everybody)
    assert [remark["topic"] for remark in report["table"]] == ["units"]


def test_half_of_a_cohort_in_metres_is_left_out(prepared):
    half = {f"p{number}": times([1e-3] * 3) for number in range(0, PEOPLE, 2)}
    _, report, store = prepared("none", **half)
    assert [remark["row"] for remark in report["rejected"]] == [number + 2 for number in range(0, PEOPLE, 2)]
    assert len(store) == PEOPLE // 2


def test_a_table_is_checked_without_preparing(tmp_path, capsys):
    (tmp_path / "data.csv").write_text(
        "mesh;subject;age\ngone.stl;a;1,5\nhere.stl;b;-99\nhere.stl;c;7\nc.stl;d;3\n"
    )
    (tmp_path / "here.stl").write_text("")
    assert cli.main(["prepare", str(tmp_path / "data.csv"), "--check"]) == 0
    said = capsys.readouterr().out
    assert "age: a number from 1.5 to 7" in said
    assert "refuse: 'age' is -99 in row 3" in said
    assert "row 2" in said and "gone.stl does not exist" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.csv", "here.stl"]
    assert cli.main(["prepare", str(tmp_path / "data.csv")]) == 2
    assert "--out FOLDER" in capsys.readouterr().err
