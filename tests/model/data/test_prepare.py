"""Preparing a small cohort as a user would: whole, with faults in it, cancelled, killed."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from naisr_model.data import meshes
from naisr_model.data.prepare import PrepareOptions, prepare
from naisr_model.data.store import SampleStore
from naisr_model.errors import Cancelled, InputError
from naisr_model.progress import Progress

SMALL = PrepareOptions(surface_samples=400, near_samples=800, uniform_samples=300, workers=1)
AXES_MM = np.array([20.0, 14.0, 30.0])


def body(size: float) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(3)
    mesh.vertices *= AXES_MM * size
    return mesh


def write_cohort(folder: Path, sizes) -> Path:
    """Ellipsoids that grow with age, each in a scanner frame of its own, with their landmarks."""
    rng = np.random.default_rng(0)
    lines = ["mesh,subject,landmarks,age [months],sex"]
    for i, size in enumerate(sizes):
        rotation = Rotation.from_rotvec(0.2 * rng.uniform(-1, 1, 3))
        shift = rng.uniform(-50, 50, 3)
        mesh = body(size)
        mesh.vertices = rotation.apply(mesh.vertices) + shift
        mesh.export(folder / f"{i}.stl")
        marks = rotation.apply(np.vstack([np.zeros(3), np.diag(AXES_MM * size)])) + shift
        text = "".join(f"{name},{x},{y},{z}\n" for name, (x, y, z) in zip("oabc", marks, strict=True))
        (folder / f"{i}.csv").write_text("name,x,y,z\n" + text)
        lines.append(f"{i}.stl,s{i},{i}.csv,{10 * size:.3f},{'FM'[i % 2]}")
    (folder / "data.csv").write_text("\n".join(lines) + "\n")
    (folder / "data.toml").write_text(
        'name = "ellipsoids"\n[alignment]\nmethod = "landmarks"\norigin = "o"\n[source]\nmade_by = "test"\n'
    )
    return folder / "data.csv"


@pytest.fixture
def cohort(tmp_path) -> Path:
    return write_cohort(tmp_path, np.linspace(0.6, 1.4, 10))


def contents(store: Path) -> dict[str, str]:
    """Every file of a store but the report, which says what was skipped."""
    files = [path for path in store.rglob("*") if path.is_file() and path.name != "report.json"]
    return {str(p.relative_to(store)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def ellipsoid_values(points_mm, size) -> np.ndarray:
    return np.linalg.norm(points_mm / (AXES_MM * size), axis=-1) - 1


def test_a_cohort_becomes_a_store_in_one_frame(cohort, tmp_path):
    fractions: list[float] = []
    report = prepare(cohort, tmp_path / "store", options=SMALL, progress=Progress(fractions.append))
    assert report.accepted == tuple(range(2, 12))
    assert (report.skipped, report.rejected, report.warnings) == ((), (), ())
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0)

    store = SampleStore.open(tmp_path / "store")
    assert (store.name, store.source, store.alignment.method) == (
        "ellipsoids",
        {"made_by": "test"},
        "landmarks",
    )
    assert store.population.held_out.sum() == 2
    training = store.population.values[~store.population.held_out, 0]
    assert store.population.covariates[0].centre == pytest.approx(training.mean())

    # The reference keeps the scans' mean axes, so one common rotation away from the true ones.
    draw = store.draw(range(10), 200, 200, 100, np.random.default_rng(0))
    marks = np.array([store.alignment.reference[name] for name in "abc"])
    common = Rotation.align_vectors(np.eye(3), marks)[0]
    assert common.magnitude() < 0.2
    for row, size in enumerate(np.linspace(0.6, 1.4, 10)):
        surface_mm = common.apply(store.frame.to_mm(draw.surface_points[row]))
        assert np.abs(ellipsoid_values(surface_mm, size)).max() < 0.02
        inside = ellipsoid_values(common.apply(store.frame.to_mm(draw.space_points[row])), size) < 0
        clear = np.abs(draw.space_sdf[row]) > 0.02
        assert ((draw.space_sdf[row] < 0) == inside)[clear].all()
        assert store.mesh(row).volume == pytest.approx(body(size).volume, rel=1e-4)
        assert np.abs(store.frame.to_model(store.mesh(row).vertices)).max() < 0.9


def test_processes_and_one_process_make_the_same_store(cohort, tmp_path):
    prepare(cohort, tmp_path / "one", options=SMALL)
    prepare(cohort, tmp_path / "two", options=replace(SMALL, workers=2))
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


def test_a_cluster_makes_the_same_store(cohort, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    prepare(cohort, tmp_path / "one", options=SMALL)
    monkeypatch.chdir(tmp_path)  # where relative paths are meant from
    prepare(cohort, Path("two"), options=replace(SMALL, cluster="local:2"))
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


def test_what_is_done_is_skipped_and_what_changed_is_done_again(cohort, tmp_path):
    out = tmp_path / "store"
    prepare(cohort, out, options=SMALL)
    before = contents(out)
    assert prepare(cohort, out, options=SMALL).skipped == tuple(range(2, 12))
    assert contents(out) == before
    inner = trimesh.load_mesh(tmp_path / "3.stl")  # a little smaller, so that the common frame stays
    inner.vertices = inner.centroid + 0.98 * (inner.vertices - inner.centroid)
    inner.export(tmp_path / "3.stl")
    report = prepare(cohort, out, options=SMALL)
    assert set(report.accepted) - set(report.skipped) == {5}
    assert prepare(cohort, out, options=replace(SMALL, near_samples=500)).skipped == ()
    assert len(list((out / "shapes").iterdir())) == 10


def test_unusable_rows_are_reported_and_the_rest_goes_on(cohort, tmp_path):
    (tmp_path / "1.stl").unlink()
    (tmp_path / "2.stl").write_bytes(b"no mesh at all")
    (tmp_path / "4.csv").write_text("name,x,y,z\no,0,0,0\n")
    sheet = body(1.0)
    sheet.update_faces(sheet.triangles_center[:, 2] > 0)
    sheet.export(tmp_path / "6.stl")
    two = trimesh.util.concatenate([body(0.5), body(0.3).apply_translation([40, 0, 0])])
    two.export(tmp_path / "7.stl")
    report = prepare(cohort, tmp_path / "store", options=SMALL)
    assert report.accepted == (2, 5, 7, 9, 10, 11)
    reasons = {remark.row: remark.reason for remark in report.rejected}
    assert "does not exist" in reasons[3]
    assert "2.stl" in reasons[4]
    assert "landmark" in reasons[6]
    assert "open" in reasons[8]
    assert {warning.row for warning in report.warnings} == {9}
    assert any("2 components" in warning.reason for warning in report.warnings)
    assert len(SampleStore.open(tmp_path / "store").population) == 6
    written = json.loads((tmp_path / "store" / "report.json").read_text())
    assert {r["row"]: r["reason"] for r in written["rejected"]} == reasons


def test_no_usable_mesh_is_an_error(cohort, tmp_path):
    for path in tmp_path.glob("*.stl"):
        path.unlink()
    with pytest.raises(InputError, match="does not exist"):
        prepare(cohort, tmp_path / "store", options=SMALL)


def test_bad_options_and_a_table_without_meshes_are_explained(cohort, tmp_path):
    with pytest.raises(InputError, match="held-out share"):
        prepare(cohort, tmp_path / "store", options=replace(SMALL, held_out=1.0))
    with pytest.raises(InputError, match="the seed is -1; give 0 or more"):
        prepare(cohort, tmp_path / "store", options=replace(SMALL, seed=-1))
    with pytest.raises(InputError, match="at least 1"):
        prepare(cohort, tmp_path / "store", options=replace(SMALL, near_samples=0))
    (tmp_path / "bare.csv").write_text("subject,age\na,1\nb,2\nc,3\n")
    with pytest.raises(InputError, match="no column 'mesh'"):
        prepare(tmp_path / "bare.csv", tmp_path / "store", options=SMALL)
    assert not (tmp_path / "store").exists()
    (tmp_path / "file").write_text("in the way")
    for out in (tmp_path / "file", tmp_path / "file" / "store"):
        with pytest.raises(InputError, match=r"cannot write .*; choose another folder"):
            prepare(cohort, out, options=SMALL)
    assert (tmp_path / "file").read_text() == "in the way"


def test_nobody_need_be_held_out(cohort, tmp_path):
    prepare(cohort, tmp_path / "store", options=replace(SMALL, held_out=0))
    assert not SampleStore.open(tmp_path / "store").population.held_out.any()


@pytest.mark.parametrize("method", ["none", "icp"])
def test_other_alignments_go_through(cohort, tmp_path, method):
    (tmp_path / "data.toml").write_text(f'[alignment]\nmethod = "{method}"\n')
    prepare(cohort, tmp_path / "store", options=SMALL)
    store = SampleStore.open(tmp_path / "store")
    centres = np.array([store.mesh(row).centroid for row in range(len(store))])
    if method == "icp":
        np.testing.assert_allclose(centres, centres.mean(axis=0) + np.zeros_like(centres), atol=1.5)
    else:
        np.testing.assert_allclose(centres[3], trimesh.load_mesh(tmp_path / "3.stl").centroid, atol=1e-3)


@pytest.mark.parametrize("kind", ["surface.npy", "near.npy", "mesh.ply"])
def test_preparing_again_mends_a_damaged_store(cohort, tmp_path, kind):
    out = tmp_path / "store"
    prepare(cohort, out, options=SMALL)
    before = contents(out)
    first, second, *_ = sorted((out / "shapes").iterdir())
    (first / kind).unlink()
    (second / kind).write_bytes((second / kind).read_bytes()[:500])
    assert len(prepare(cohort, out, options=SMALL).skipped) == 8
    assert contents(out) == before


def test_a_mesh_that_breaks_the_program_is_reported_and_the_rest_goes_on(cohort, tmp_path, monkeypatch):
    stray = trimesh.load_mesh(tmp_path / "3.stl")
    faces = np.vstack([stray.faces, [[0, 1, len(stray.vertices)]]])
    broken = trimesh.Trimesh(stray.vertices, faces, process=False, validate=False)
    (tmp_path / "3.ply").write_bytes(trimesh.exchange.ply.export_ply(broken, vertex_normal=False))
    cohort.write_text(cohort.read_text().replace("3.stl", "3.ply"))
    repair = meshes.cleaned

    def breaks_on_large(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
        if np.ptp(mesh.vertices[:, 2]) > 2.5 * AXES_MM[2]:
            raise IndexError("index 7 is out of bounds")
        return repair(mesh)

    monkeypatch.setattr(meshes, "cleaned", breaks_on_large)
    report = prepare(cohort, tmp_path / "store", options=SMALL)
    reasons = {remark.row: remark.reason for remark in report.rejected}
    assert "3.ply has faces that name missing vertices" in reasons.pop(5)
    assert reasons
    assert all("cannot be used (IndexError" in reason for reason in reasons.values())
    assert len(report.accepted) == 9 - len(reasons)


def test_only_what_this_program_wrote_is_cleared_away(cohort, tmp_path):
    mine = [f"shapes/{name}/scan.stl" for name in ("raw", "0123456789abcdef", ".git", "f" * 25, "F" * 24)]
    mine += ["shapes/notes.txt"]
    stale = [f"shapes/{name}/near.npy" for name in ("0" * 24, "." + "a" * 24 + ".123.tmp")]
    for name in (*mine, *stale):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("precious")
    prepare(cohort, tmp_path, options=SMALL)
    assert all((tmp_path / name).read_text() == "precious" for name in mine)
    assert not any((tmp_path / name).parent.exists() for name in stale)


def finished_shapes(out: Path) -> list[Path]:
    shapes = out / "shapes"
    return [p for p in shapes.iterdir() if not p.name.startswith(".")] if shapes.is_dir() else []


@pytest.mark.parametrize("workers", [1, 2])
def test_a_cancelled_run_goes_on_later(cohort, tmp_path, workers):
    cut, heard = tmp_path / "cut", [0.0]

    def two_are_finished() -> bool:
        writing = heard[-1] > 0.099  # looking and placing take the first tenth
        deadline = time.monotonic() + 300
        while writing and workers > 1 and len(finished_shapes(cut)) < 2 and time.monotonic() < deadline:
            time.sleep(0.005)
        return len(finished_shapes(cut)) >= 2

    with pytest.raises(Cancelled):
        prepare(
            cohort,
            cut,
            options=replace(SMALL, workers=workers),
            progress=Progress(heard.append, two_are_finished),
        )
    assert not (cut / "store.json").exists()
    done = finished_shapes(cut)
    assert len(prepare(cohort, cut, options=SMALL).skipped) == len(done) >= 2
    prepare(cohort, tmp_path / "whole", options=SMALL)
    assert contents(cut) == contents(tmp_path / "whole")


PROGRAM = """
import contextlib, multiprocessing, os, signal, sys, threading
from naisr_model.data import prepare

write = prepare.write_samples


def write_or_kill(job):
    finished = [path for path in job.target.parent.iterdir() if not path.name.startswith(".")]
    if len(finished) < 3:
        return write(job)
    with contextlib.suppress(ProcessLookupError):
        os.kill(multiprocessing.parent_process().pid, signal.SIGKILL)
    threading.Event().wait()  # a worker that does not see its parent go hangs here


if __name__ == "__main__":
    prepare.write_samples = write_or_kill
    options = prepare.PrepareOptions(400, 800, 300, workers=2)
    prepare.prepare(sys.argv[1], sys.argv[2], options=options)
"""
"""Kills itself from within a worker once three of its shapes are finished."""


def group_is_empty(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_killed_run_goes_on_to_the_same_store(cohort, tmp_path):
    cut, whole, program = tmp_path / "cut", tmp_path / "whole", tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    command = [sys.executable, str(program), str(cohort), str(cut)]
    process = subprocess.Popen(command, env=environment, start_new_session=True)
    try:
        assert process.wait(timeout=600) == -signal.SIGKILL
        assert not (cut / "store.json").exists()
        deadline = time.monotonic() + 300
        while not group_is_empty(process.pid) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert group_is_empty(process.pid), "the workers outlived the killed program"
    finally:
        if not group_is_empty(process.pid):
            os.killpg(process.pid, signal.SIGKILL)

    done = finished_shapes(cut)
    assert 3 <= len(done) < 10
    shutil.copytree(
        done[0], done[0].with_name(f".{done[0].name}.123.tmp")
    )  # as a kill while writing leaves it
    report = prepare(cohort, cut, options=SMALL)
    assert len(report.skipped) == len(done)
    prepare(cohort, whole, options=SMALL)
    assert contents(cut) == contents(whole)


def test_the_store_of_another_table_is_left_alone(cohort, tmp_path):
    out, other = tmp_path / "store", tmp_path / "other.csv"
    prepare(cohort, out, options=SMALL)
    before = contents(out)
    other.write_text(cohort.read_text())
    with pytest.raises(InputError, match=r"holds the store of '.*', not of 'other'; give another --out"):
        prepare(other, out, options=SMALL)
    assert contents(out) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "report.json").write_text("{}")
    with pytest.raises(InputError, match=r"holds a report\.json of something else; give another --out"):
        prepare(cohort, tmp_path / "mine", options=SMALL)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["report.json"]


def test_a_second_run_on_the_same_store_is_told(cohort, tmp_path):
    told: list[object] = []

    def second(_share: float) -> None:
        if not told:
            with pytest.raises(
                InputError, match=r"another run prepares .*; wait until it has ended"
            ) as error:
                prepare(cohort, tmp_path / "store", options=SMALL)
            told.append(error)

    assert prepare(cohort, tmp_path / "store", options=SMALL, progress=Progress(second)).accepted
    assert told and not (tmp_path / "store" / ".lock").exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_store_that_finds_no_room_leaves_nothing_half_done_and_goes_on_later(
    cohort, tmp_path, workers, no_room
):
    out, options = tmp_path / "store", replace(SMALL, workers=workers)
    with no_room(4_000), pytest.raises(InputError, match=r"cannot write .*store.*: File too large; "):
        prepare(cohort, out, options=options)
    assert [path.name for path in out.rglob("*") if path.is_file() or path.name.startswith(".")] == []
    prepare(cohort, out, options=options)
    prepare(cohort, tmp_path / "whole", options=options)
    assert contents(out) == contents(tmp_path / "whole")
