"""Small meshes of a file are refined together, and come out as if each had been alone."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pns_common import Mesh, load_model
from service.gltf.refine import meshes
from service.gltf.subdivide import Subdivided, subdivide_gltf
from service.options import Limits, Options
from service.stages import Stages
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.meshes import icosphere

MODEL = load_model("paper")
OPTIONS = [
    {},
    {"levels": 2},
    {"levels": 3, "scheme": "loop"},
    {"diagnostics": "full"},
    {"uv": "smooth"},
    {"crease": "normals", "levels": 2},
    {"crease": "angle:30"},
    {"crease": "off"},
    {"reference_length": 1.0},
    {"compress": "meshopt"},
    {"normals": "smooth"},
    {"limit": True},
    {"weld_tolerance": 0.001},
]
MORE_OPTIONS = [
    {"limit": False, "normals": "smooth", "levels": 2},
    {"normals": "smooth", "crease": "angle:40", "levels": 2},
    {"weld_tolerance": 0.01, "reference_length": 0.5, "normals": "smooth"},
    {"limit": True, "crease": "normals", "uv": "smooth", "levels": 3},
    {"diagnostics": "full", "compress": "meshopt", "levels": 2},
]


def refine(data: bytes, **options: object) -> Subdivided:
    return subdivide_gltf(data, "glb", Options(**options), MODEL, Limits())


@pytest.mark.parametrize("options", [{}, {"normals": "smooth"}, {"uv": "smooth"}], ids=str)
def test_creases_are_found_in_each_mesh_by_itself(
    options: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rims and walls of a cylinder of six sides are sharp, and a sphere has no such edge."""
    cylinder = trimesh.creation.cylinder(1.0, 2.0, sections=6)
    drum = Mesh(cylinder.vertices, cylinder.faces)
    shapes = [drum, *(Mesh(*icosphere(2)) for _ in range(4))]
    data = files.glb(*([{"POSITION": m.vertices, "indices": m.faces}] for m in shapes))
    asked = Options(levels=2, **options)

    def made() -> Subdivided:
        return subdivide_gltf(data, "glb", asked, load_model(), Limits())

    together = made()
    edges = [mesh["levels"][0]["edges"] for mesh in together.report["meshes"]]
    assert [counts.get("soft", 0) for counts in edges] == [18, 0, 0, 0, 0]
    monkeypatch.setattr(meshes, "MOST_FACES", -1)
    alone = made()
    assert together.report == alone.report
    assert together.glb == alone.glb


def skinned_pair(joint: int) -> list[dict[str, object]]:
    """Halves of a surface, the one with wide joints, of which one reaches into the other."""
    shape, bound = octahedron(), {"WEIGHTS_0": np.tile([1.0, 0, 0, 0], (6, 1))}
    joints = np.zeros((6, 4), dtype=np.uint16)
    joints[5] = joint
    halves = ((shape["indices"][:4], np.zeros((6, 4), np.uint8)), (shape["indices"][4:], joints))
    return [octahedron(indices=own, JOINTS_0=named, **bound) for own, named in halves]


@pytest.mark.parametrize(
    "kinds",
    [
        [[box(_T=files.Normalized(np.arange(24, dtype=np.uint8)[:, None]))] for _ in range(2)]
        + [[box(_T=np.arange(24, dtype=np.uint8)[:, None])] for _ in range(2)],
        [skinned_pair(1), skinned_pair(300), skinned_pair(2)],
    ],
    ids=["numbers and fractions", "narrow and wide joints"],
)
def test_meshes_of_two_kinds_are_as_alone(
    kinds: list[list[dict[str, object]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    data = files.glb(*kinds)
    made = refine(data, scheme="loop")
    monkeypatch.setattr(meshes, "MOST_FACES", -1)
    assert made.glb == refine(data, scheme="loop").glb


def random_mesh(rng: np.random.Generator, kind: int) -> list[dict[str, object]]:
    """Primitives of one of 16 kinds: skins, morph targets, normals, two pieces of one surface."""
    skinned, morphed, shaded, parted = (bool(kind >> bit & 1) for bit in range(4))
    whole = dict(box() if shaded else octahedron())
    rows = len(whole["POSITION"])
    moved = np.asarray(whole["POSITION"]) * rng.uniform(0.2, 3, 3)
    # On a grid of a thousandth: some are near each other, none nearer than weld_tolerance joins.
    whole["POSITION"] = (moved + rng.choice([0, 1e-4], (rows, 3))).astype(np.float32)
    whole["COLOR_0"] = files.Normalized(rng.integers(0, 255, (rows, 4)).astype(np.uint8))
    whole["_ID"] = rng.integers(0, 9, (rows, 1)).astype(np.uint8)
    place = np.unique(moved.round(3), axis=0, return_inverse=True)[1].reshape(-1)
    if skinned:
        joints = rng.integers(0, rng.choice([2, 30]), (rows, 4)).astype(np.uint8)
        weights = rng.random((rows, 4)) * rng.integers(0, 2, (rows, 4))
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
        whole["JOINTS_0"], whole["WEIGHTS_0"] = joints[place], weights[place].astype(np.float32)
    if morphed:
        delta = rng.normal(size=(2, rows, 3)).astype(np.float32)[:, place]
        whole["targets"] = [{"POSITION": delta[0]}, {"POSITION": delta[1]}]
        if shaded:
            whole["targets"][1]["NORMAL"] = delta[0]
    faces = np.asarray(whole["indices"]).reshape(-1, 3)
    extra = [faces[:1, ::-1], [[0, 0, 1]]] if rng.random() < 0.3 else []
    if rng.random() < 0.1:
        faces, extra = faces[:1].repeat(3, axis=1)[:, :3], []
    pieces = [np.concatenate([faces[:5], *extra]), faces[5:]] if parted else [faces]
    return [whole | {"indices": piece} for piece in pieces if len(piece)]


@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.lists(st.integers(0, 15), min_size=1, max_size=3),
    asked=st.sampled_from(OPTIONS + MORE_OPTIONS),
)
@settings(max_examples=40, deadline=None)
def test_skins_targets_and_pieces_together_are_as_alone(
    seed: int, kinds: list[int], asked: dict[str, object]
) -> None:
    rng = np.random.default_rng(seed)
    data = files.glb(*(random_mesh(rng, kinds[n % len(kinds)]) for n in range(3 * len(kinds))))
    made = refine(data, **asked)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(meshes, "MOST_FACES", -1)
        alone = refine(data, **asked)
    assert made.report == alone.report
    assert made.glb == alone.glb


@pytest.mark.parametrize("sets", [[[1, 2]], [[1], [1, 1]]], ids=str)
def test_joints_of_several_types_or_sets_are_as_alone(
    sets: list[list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def piece(first: int, widths: list[int], faces: np.ndarray) -> dict[str, object]:
        made = {**octahedron(), "indices": faces}
        for number, width in enumerate(widths):
            joints = first + np.arange(24).reshape(6, 4) + 24 * number
            joints = joints if width == 2 else joints % 200
            made[f"JOINTS_{number}"] = joints.astype(f"<u{width}")
            # Pieces that are bound alike are one surface.
            share = 0.25 if number == 0 or len(sets) == 1 else 0.0
            made[f"WEIGHTS_{number}"] = np.full((6, 4), share, dtype=np.float32)
        return made

    halves = np.array_split(np.asarray(octahedron()["indices"]).reshape(-1, 3), len(sets))
    shapes = [[piece(first, *own) for own in zip(sets, halves, strict=True)] for first in (0, 300)]
    made = refine(files.glb(*shapes))
    monkeypatch.setattr(meshes, "MOST_FACES", -1)
    alone = refine(files.glb(*shapes))
    assert (made.glb, made.report) == (alone.glb, alone.report)


@pytest.mark.parametrize(
    "asked", [{}, {"limit": True}, {"normals": "smooth"}, {"weld_tolerance": 0.001}], ids=str
)
def test_no_small_mesh_goes_alone(
    asked: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("a mesh was refined alone")

    monkeypatch.setattr(meshes, "refine_alone", refuse)
    rng = np.random.default_rng(0)
    shapes = [random_mesh(rng, number % 16) for number in range(64)]
    # Those that have no face to keep are not refined at all.
    whole = [shape for shape in shapes if sum(len(piece["indices"]) for piece in shape) > 4]
    assert len(whole) > 48
    assert refine(files.glb(*whole), **asked).report["totals"]["meshes"] == len(whole)


def test_a_mesh_that_cannot_be_refined_is_named_among_others() -> None:
    far = octahedron() | {"POSITION": octahedron()["POSITION"] * np.float32(3e38)}
    data = files.pack(*files.document([octahedron()], [far], [octahedron()]))
    with pytest.raises(Exception, match="float32") as refusal:
        refine(data, budget=1e6)
    assert getattr(refusal.value, "pointer", None) == "/meshes/1"


def test_progress_goes_on_through_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "GROUP_FACES", 1000)
    shapes = [[octahedron()]] * 5 + [[box()]] + [[octahedron()]] * 5
    told: list[float] = []
    options = Options(levels=3)
    data = files.pack(*files.document(*shapes))
    subdivide_gltf(data, "glb", options, MODEL, Limits(), Stages(moves=told.append))
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1)
    assert len(told) > 5
