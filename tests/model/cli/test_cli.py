"""The command line as a user types it: a CSV and a folder of STL files become an atlas and a mesh."""

import dataclasses
import signal
import subprocess
import sys

import pytest
import trimesh
from eggs import egg

from naisr_model import cli
from naisr_model.capabilities import CAN, Capabilities
from naisr_model.evaluation.studies import STUDIES
from naisr_model.models.factory import presets

SETTINGS = """
[network]
latent = 4
template = {width = 32, hidden = 1, omega0 = 5.0}
displacement = {width = 16, hidden = 1, omega0 = 2.0}
[training]
batch_shapes = 10
template_rate = 2e-3
"""


@pytest.fixture
def naisr(capsys):
    """``naisr(...)`` runs the command and gives exit code, standard output and standard error."""

    def run(*words):
        code = cli.main([str(word) for word in words])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def test_from_a_table_of_stl_files_to_a_mesh(naisr, egg_table, tmp_path):
    store, atlas, settings = tmp_path / "store", tmp_path / "mine.safetensors", tmp_path / "small.toml"
    settings.write_text(SETTINGS)
    counts = ["--surface-samples", 500, "--near-samples", 500, "--uniform-samples", 500, "--workers", 1]
    code, out, _ = naisr("prepare", egg_table, "--out", store, *counts)
    assert code == 0 and "24 shapes" in out and "0 rejected" in out
    code, out, _ = naisr("prepare", egg_table, "--out", store, *counts)
    assert "24 were there already" in out
    code, out, _ = naisr(
        "train", store, "--preset", "demo", "--config", settings, "--out", atlas, "--epochs", 2
    )
    assert code == 0 and "after 4 iterations" in out and "folded points" in out
    code, out, _ = naisr("info", atlas)
    assert code == 0 and "age: 1 years to" in out and "sex: F or M\n" in out
    assert "trained on 19 shapes of 19 subjects; 5 shapes of 5 subjects held out" in out
    assert "model: NAISR\n" in out and "  a patient can be seen on another day\n" in out
    assert "training: 4 iterations, 0.0 minutes, folded points near the surface " in out


def test_a_mesh_of_the_atlas_is_written_in_millimetres(naisr, egg_atlas, tmp_path):
    out = tmp_path / "eight.stl"
    code, said, _ = naisr("mesh", egg_atlas, out, "--set", "age=8", "--set", "sex=M", "--resolution", 64)
    written, truth = trimesh.load_mesh(out), egg(8, 1)
    assert code == 0 and written.is_watertight and f"{written.volume / 1000:.2f} cm³" in said
    assert written.extents == pytest.approx(truth.extents, rel=0.1)
    assert naisr("mesh", egg_atlas, tmp_path / "t.ply", "--template", "--resolution", 32)[0] == 0
    code, _, _ = naisr("mesh", egg_atlas, tmp_path / "a.obj", "--effect", "age", "--set", "age=2")
    assert code == 0 and len(trimesh.load_mesh(tmp_path / "a.obj").faces) > 1000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["mesh", "ATLAS", "x.stl", "--set", "age=99"], "the atlas was trained on 1 to"),
        (["mesh", "ATLAS", "x.stl", "--set", "age=old"], "expected a number in years"),
        (["mesh", "ATLAS", "x.stl", "--set", "length=1"], "NAME=VALUE with one of age, sex"),
        (["mesh", "ATLAS", "x.doc"], "name the file .stl, .ply, .obj, .vtp or .glb"),
        (["mesh", "ATLAS", "x.stl", "--effect", "age"], "--set age=VALUE"),
        (["mesh", "ATLAS", "x.stl", "--effect", "size"], "unknown covariate 'size'; this atlas has age, sex"),
        (
            ["mesh", "nowhere.safetensors", "x.stl"],
            "does not exist; give the path of an atlas",
        ),
        (["train", "nowhere", "--out", "x.safetensors"], "run 'naisr prepare' first"),
        (["train", "STORE", "--out", "x.safetensors", "--preset", "huge"], "there is no preset 'huge'"),
        (["train", "STORE", "--out", "x.safetensors", "--time-budget", "soon"], "write it as 90s"),
        (["prepare", "nowhere.csv", "--out", "x"], "nowhere.csv"),
        (["populate", "moon", "x"], "unknown population 'moon'"),
        (["mesh", "DEEPSDF", "x.stl", "--template"], "DeepSDF has no template; leave out --template"),
        (["mesh", "DEEPSDF", "x.stl", "--set", "age=3"], "depend on no covariates; leave out --set"),
        (["mesh", "DEEPSDF", "x.stl", "--effect", "age"], "does not tell covariates apart; leave out"),
        (["fly"], "fly"),
    ],
)
def test_bad_input_gets_one_sentence_and_exit_code_2(
    naisr, egg_atlas, egg_deepsdf, egg_store, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    there = {"ATLAS": egg_atlas, "DEEPSDF": egg_deepsdf, "STORE": egg_store.path}
    code, _, error = naisr(*(there.get(word, word) for word in words))
    assert code == 2 and message in error and "Traceback" not in error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", "transfer", "DEEPSDF", "--store", "STORE"],
        ["evaluate", "reconstruction", "ATLAS"],
        ["evaluate", "reconstruction", "ATLAS", "--store", "STORE", "--journal", "STRANGE"],
        ["bench", "DEEPSDF"],
        ["fit", "EGG", "--atlas", "ATLAS", "--known", "age=900"],
        ["train", "STORE", "--out", "NOWHERE"],
        ["prepare", "nowhere.csv", "--out", "x"],
        ["populate", "moon", "x"],
    ],
)
def test_a_refusal_shows_no_bar(naisr, egg_atlas, egg_deepsdf, egg_store, egg_table, tmp_path, words):
    strange = tmp_path / "strange.jsonl"
    strange.write_text('{"study": "another"}\n')
    there = {"ATLAS": egg_atlas, "DEEPSDF": egg_deepsdf, "STORE": egg_store.path, "STRANGE": strange}
    there |= {"EGG": egg_table.parent / "egg0.stl", "NOWHERE": strange / "x.safetensors"}
    code, _, error = naisr(*(there.get(word, word) for word in words))
    assert code == 2 and error.startswith("naisr: ") and error.count("\n") == 1


def test_a_bar_is_there_once_the_work_goes_on(naisr, tmp_path):
    code, _, error = naisr("populate", "bodies", tmp_path / "people", "--patients", 2)
    assert code == 0 and "writing bodies" in error and "100 %" in error


def test_a_population_replaces_nobody_elses_table(naisr, tmp_path):
    out, words = tmp_path / "people", ("--patients", 2)
    assert naisr("populate", "airway", out, *words)[0] == naisr("populate", "airway", out, *words)[0] == 0
    before = (out / "data.csv").read_bytes()
    code, _, error = naisr("populate", "bodies", out, *words)
    assert code == 2 and "holds a table of something else; give another folder" in error
    assert (out / "data.csv").read_bytes() == before
    (tmp_path / "data.csv").write_text("precious")
    assert naisr("populate", "airway", tmp_path, *words)[0] == 2
    assert (tmp_path / "data.csv").read_text() == "precious"


def test_figures_replace_no_other_file(naisr, egg_atlas, egg_table, tmp_path):
    scan, there = egg_table.parent / "egg0.stl", tmp_path / "table.csv"
    there.write_text("subject,age\n")
    for target, told in (
        (there, "holds no figures; give another file"),
        (tmp_path, "is a folder"),
        (there / "x.json", "is a file, no folder"),
    ):
        code, out, error = naisr("fit", scan, "--atlas", egg_atlas, "--json", target)
        assert (code, out) == (2, "") and told in error and error.count("\n") == 1
    assert there.read_text() == "subject,age\n"


def test_ctrl_c_stops_also_where_a_library_swallows_it(naisr, egg_atlas, monkeypatch):
    def swallowing(_path):
        try:
            signal.raise_signal(signal.SIGINT)
        except BaseException as error:
            raise TypeError("not loaded") from error

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr("naisr_model.checkpoint.load", swallowing)
    assert naisr("info", egg_atlas) == (130, "", "naisr: stopped; what was finished is kept\n")
    assert signal.getsignal(signal.SIGINT) is before


def test_who_was_rejected_is_told_also_when_the_others_are_of_no_use(naisr, egg_table, tmp_path):
    """Of two ages one is left, because the mesh of the other is missing."""
    table = tmp_path / "two.csv"
    meshes = [egg_table.parent / "egg0.stl", egg_table.parent / "egg2.stl", "gone.stl"]
    rows = [f"{mesh},{mesh},1,{age}" for mesh, age in zip(meshes, (3, 3, 4), strict=True)]
    table.write_text("\n".join(["mesh,subject,visit,age [years]", *rows]) + "\n")
    code, _, error = naisr("prepare", table, "--out", tmp_path / "out", "--held-out", 0, "--workers", 1)
    assert code == 2 and "covariate 'age' does not vary" in error
    assert "rejected " in error and "gone.stl (row 4): " in error


@pytest.mark.parametrize("word", ["--help", "--version"])
def test_help_is_there_without_heavy_imports(word):
    probe = (
        "import sys; from naisr_model import cli\n"
        f"try: cli.main([{word!r}])\n"
        "finally: assert not {'torch', 'numpy', 'pyvista', 'trimesh'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)


def test_the_help_of_populate_names_every_population():
    """In a program of its own, where the registry has one more."""
    program = (
        "from naisr_model.data import populations\n"
        "populations.POPULATIONS = {**populations.POPULATIONS, 'pears': 'pears'}\n"
        "from naisr_model import cli; cli.main(['populate', '--help'])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "airway or bodies or starman or pears." in " ".join(done.stdout.replace("\u2502", " ").split())


def test_a_switch_is_there_to_be_turned_on(naisr):
    for command in (
        *(["populate"], ["prepare"], ["train"], ["fit"], ["transfer"], ["evolve"], ["info"], ["mesh"]),
        *(["bench"], *(["evaluate", study] for study in STUDIES)),
    ):
        code, said, _ = naisr(*command, "--help")
        assert code == 0 and "--no-" not in said and "--empty-" not in said
    assert "--template" in naisr("mesh", "--help")[1]


def test_the_package_runs_as_a_module():
    command = [sys.executable, "-m", "naisr_model.cli"]
    done = subprocess.run([*command, "--help"], capture_output=True, text=True, check=True)
    assert all(word in done.stdout for word in ("prepare", "train", "mesh", "fit", "evaluate", "bench"))
    assert subprocess.run([*command, "fly"], capture_output=True, check=False).returncode == 2


def test_a_model_without_covariates_makes_its_average(naisr, egg_deepsdf, tmp_path):
    assert naisr("mesh", egg_deepsdf, tmp_path / "mean.stl", "--resolution", 32)[0] == 0
    assert trimesh.load_mesh(tmp_path / "mean.stl").is_watertight
    _, out, _ = naisr("info", egg_deepsdf)
    assert (
        "  its shapes depend on no covariates\nmodel: DeepSDF\n  surfaces at any resolution\nnetworks" in out
    )
    assert "age" not in out and "seconds:" not in out


def test_info_has_words_for_every_capability():
    assert list(CAN) == [field.name for field in dataclasses.fields(Capabilities)]


def test_the_help_of_train_names_the_presets_of_every_model(naisr):
    code, out, _ = naisr("train", "--help")
    told = " ".join(out.replace("\u2502", " ").split())
    assert code == 0 and "OUT can be opened from the first minute on" in told
    assert all(f"{name}" in told for name in presets())
    assert "NAISR: " in told and "DeepSDF: " in told
