"""Length and cross-sections of tubes against closed forms, plane sections and rigid motions."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from eggs import egg
from tubes import CIRCLE, bent, straight

from naisr_model.atlas import Atlas
from naisr_model.measures.tubes import tube_of
from naisr_model.shipped import shipped_atlas


def sections(mesh: trimesh.Trimesh):
    tube = tube_of(mesh)
    assert tube is not None
    return tube.sections(mesh.vertices)


@pytest.fixture(scope="module")
def airway() -> trimesh.Trimesh:
    return Atlas.load(shipped_atlas()).template(64)


def test_a_straight_tube():
    found = sections(straight(np.full(101, 5.0)))
    assert found.length_mm == pytest.approx(100, rel=1e-3)
    np.testing.assert_allclose(found.areas_mm2, 25 * CIRCLE, rtol=1e-3)
    np.testing.assert_allclose(found.centres_mm[:, :2], 0, atol=1e-3)


@pytest.mark.parametrize("radius", [3.0, 4.0])
def test_a_bent_tube(radius):
    mesh = bent(radius, about=20.0, angle=np.pi)
    found = sections(mesh)
    assert mesh.is_watertight and mesh.volume > 0
    assert found.length_mm == pytest.approx(20 * np.pi, rel=0.01)
    np.testing.assert_allclose(found.areas_mm2, radius**2 * CIRCLE, rtol=0.02)
    np.testing.assert_allclose(np.linalg.norm(found.centres_mm, axis=1), 20, rtol=0.02)


def test_a_cone():
    found = sections(straight(np.linspace(4.0, 8.0, 101)))
    # The upper end, z = 100, comes first.
    radii = 4 + 4 * (100 - found.places_mm) / 100
    np.testing.assert_allclose(found.areas_mm2, radii**2 * CIRCLE, rtol=0.03)
    assert found.length_mm == pytest.approx(100, rel=2e-3)
    assert found.narrowest > 180


@pytest.mark.parametrize("at", [30.0, 55.0, 80.0])
def test_a_ring_narrower_by_two_millimetres_is_found(at):
    heights = np.linspace(0, 100, 401)
    found = sections(straight(8 - 2 * np.exp(-(((heights - at) / 2) ** 2))))
    assert found.areas_mm2.min() == pytest.approx(36 * CIRCLE, rel=0.05)
    assert found.places_mm[found.narrowest] == pytest.approx(100 - at, abs=1)


def test_where_a_tube_lies_does_not_count(airway):
    motion = trimesh.transformations.compose_matrix(angles=(0.3, -0.2, 0.4), translate=(500, -300, 80))
    here, there = sections(airway), sections(airway.copy().apply_transform(motion))
    assert there.length_mm == pytest.approx(here.length_mm, rel=1e-6)
    np.testing.assert_allclose(there.areas_mm2, here.areas_mm2, rtol=1e-5)
    moved = trimesh.transform_points(here.centres_mm, motion)
    np.testing.assert_allclose(there.centres_mm, moved, atol=1e-3)


def test_stations_go_with_the_material(airway):
    tube = tube_of(airway)
    assert tube is not None
    plain, grown = tube.sections(airway.vertices), tube.sections(1.5 * airway.vertices)
    assert grown.length_mm == pytest.approx(1.5 * plain.length_mm)
    np.testing.assert_allclose(grown.areas_mm2, 1.5**2 * plain.areas_mm2)


def test_cross_sections_are_those_of_planes(airway):
    found = sections(airway)
    for station in (120, 150, 180):  # larynx and trachea
        direction = found.centres_mm[station + 2] - found.centres_mm[station - 2]
        cut = airway.section(plane_origin=found.centres_mm[station], plane_normal=direction)
        (loop,) = cut.discrete
        from_centre = loop - loop.mean(axis=0)
        area = np.linalg.norm(np.cross(from_centre[:-1], from_centre[1:]).sum(axis=0)) / 2
        assert found.areas_mm2[station] == pytest.approx(area, rel=0.03)


def test_cross_sections_of_two_passages_add_up_to_the_volume(airway):
    found = sections(airway)
    held = np.trapezoid(found.areas_mm2, found.places_mm)
    ends = found.places_mm[0] * found.areas_mm2[0]
    ends += (found.length_mm - found.places_mm[-1]) * found.areas_mm2[-1]
    assert held + ends == pytest.approx(airway.volume, rel=0.05)


def test_a_speck_beside_a_tube_does_not_count():
    tube = straight(np.full(101, 5.0))
    speck = trimesh.creation.icosphere(subdivisions=2, radius=2).apply_translation([60, 0, 150])
    assert sections(tube + speck).length_mm == pytest.approx(100, rel=1e-3)


def test_a_tube_may_be_open():
    tube = straight(np.full(101, 5.0))
    tube.update_faces(np.abs(tube.face_normals[:, 2]) < 0.5)
    assert sections(tube).areas_mm2 == pytest.approx(25 * CIRCLE, rel=1e-3)


def test_a_triangle_without_area_does_not_count():
    tube = straight(np.full(101, 5.0))
    pinched = trimesh.Trimesh(tube.vertices, np.vstack([tube.faces, [[500, 501, 501]]]), process=False)
    assert sections(pinched).length_mm == pytest.approx(100, rel=1e-3)


SOUP = straight(np.full(101, 5.0)).triangles


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.Trimesh(SOUP.reshape(-1, 3), np.arange(3 * len(SOUP)).reshape(-1, 3), process=False),
        trimesh.Trimesh(np.zeros((60, 3)), np.arange(60).reshape(-1, 3), process=False),
        trimesh.creation.icosphere(subdivisions=3, radius=10),
        trimesh.creation.torus(20, 3),
        trimesh.creation.box([10, 10, 20]).subdivide().subdivide().subdivide(),
        egg(9, -1),
        trimesh.Trimesh(),
    ],
    ids=["triangles that are not joined", "a point", "a ball", "a closed ring", "a box", "an egg", "nothing"],
)
def test_what_is_no_tube(mesh):
    assert tube_of(mesh) is None


def test_a_body_with_limbs_is_no_tube():
    bodies = Atlas.load(shipped_atlas().with_name("bodies.safetensors"))
    assert tube_of(bodies.template(64)) is None
