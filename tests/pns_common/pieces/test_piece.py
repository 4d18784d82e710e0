"""One piece: what is its own, and what it says where its halo is too thin."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, MeshError, ParameterError, load_model, loop, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import Creases
from pns_common.pieces import ThinHaloError, halo_rings, refine_piece
from pns_common.pieces.piece import _asked, first_at_own, steps_of
from pns_common.runtimes.onnx_model import bundled_models
from tests.support.meshes import bumpy_sphere, grid
from tests.support.networks import scale_free_model
from tests.support.pieces import piece_of

SCHEMES = {"loop": loop(), **{name: pns(load_model(name)) for name in bundled_models()}}


@pytest.mark.parametrize("name", SCHEMES)
def test_a_halo_that_is_too_thin_is_told(name):
    scheme = SCHEMES[name]
    mesh = Mesh(*bumpy_sphere(5, 2))
    own = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.85
    for levels in (1, 2):
        rings = halo_rings(scheme, levels, guard_rings=0)
        with pytest.raises(ThinHaloError) as told:
            refine_piece(piece_of(mesh, own, rings - 1).piece, scheme, levels, 1.0, Blocks(1))
        assert told.value.faces > 0


@pytest.mark.parametrize("gentle", [None, 21.0])
def test_a_halo_that_is_too_thin_to_tell_lines_is_told(gentle):
    lines = Creases(line_angle=66.0, edged_angle=gentle)
    mesh = Mesh(*bumpy_sphere(5, 4))
    own = np.arange(len(mesh.faces)) == 0
    rings = halo_rings(loop(), 1, lines=lines)
    for thinner, is_enough in ((0, True), (2, False)):
        piece = piece_of(mesh, own, rings - thinner, lines=lines).piece
        assert not piece.whole.all()
        if is_enough:
            refine_piece(piece, loop(), 1, 1.0, Blocks(1))
        else:
            with pytest.raises(ThinHaloError):
                refine_piece(piece, loop(), 1, 1.0, Blocks(1))


def test_what_was_asked_of_the_guard_is_what_is_added_without_it():
    scheme = pns(scale_free_model(1, scale=30.0), budget=40.0)
    mesh = Mesh(*bumpy_sphere(0, 2))
    whole = piece_of(mesh, np.ones(len(mesh.faces), dtype=bool), 0).piece
    guarded, free = (
        next(steps_of(whole, each, 1, 1.0, Blocks(1)))
        for each in (scheme, replace(scheme, guard=None))
    )
    scale, asked = guarded.placed.guard, _asked(guarded.placed)
    assert ((scale > 0) & (scale < 1)).any()
    added = np.concatenate([free.placed.vertices.displacement, free.placed.edges.displacement])
    np.testing.assert_array_equal(asked, added)
    # Where it took all nobody knows.
    assert not np.isfinite(_asked(replace(guarded.placed, guard=0 * scale))).any()


def left_half(scheme=None, levels=1):
    mesh = Mesh(*grid(7))
    own = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] < 0
    return mesh, own, piece_of(mesh, own, halo_rings(scheme or loop(), levels))


def test_a_vertex_is_the_pieces_own_where_it_first_appears_in_an_own_face():
    mesh, own, cut = left_half()
    step = next(steps_of(cut.piece, loop(), 1, 1.0, Blocks(1)))
    mine = first_at_own(step.links, cut.piece.own)
    numbers = np.unique(mesh.faces[cut.faces])
    first = [np.flatnonzero((mesh.faces == v).any(axis=1))[0] for v in numbers]
    np.testing.assert_array_equal(mine, own[first])


def test_openers_are_the_first_face_of_each_edge_in_faces_of_the_control_piece():
    _, _, cut = left_half(levels=2)
    once, twice = (refine_piece(cut.piece, loop(), levels, 1.0, Blocks(1)) for levels in (1, 2))
    for level, faces in enumerate((cut.piece.faces, once.faces)):
        first = {}
        for number, (a, b, c) in enumerate(faces.tolist()):
            for edge in ((a, b), (b, c), (c, a)):
                first.setdefault(tuple(sorted(edge)), number // 4**level)
        assert twice.openers[level].tolist() == list(first.values())


def test_coordinates_that_outgrow_the_operator_are_an_error_in_a_piece_too():
    mesh = Mesh(*bumpy_sphere(0, subdivisions=0))
    whole = piece_of(mesh, np.ones(len(mesh.faces), dtype=bool), 0).piece
    with pytest.raises(MeshError, match="too large"):
        refine_piece(whole, pns(load_model("paper"), 1e80), 1, 1.0, Blocks(1))
    wide = pns(scale_free_model(0))
    assert refine_piece(whole, wide, 1, 1.0, Blocks(1)).own_vertices.all()


def test_a_piece_may_have_its_arrays_in_any_order_and_in_smaller_types():
    piece = left_half()[2].piece
    single = piece.points.astype(np.float32)
    given = replace(piece, points=np.asfortranarray(single), faces=piece.faces[:, ::-1])
    plain = replace(piece, points=single.astype(float), faces=piece.faces[:, ::-1].copy())
    small = replace(plain, faces=np.asfortranarray(plain.faces, dtype=np.int32))
    made, *others = (
        refine_piece(each, loop(), 2, 1.0, Blocks(1)) for each in (plain, given, small)
    )
    for other in others:
        np.testing.assert_array_equal(other.points, made.points)
        np.testing.assert_array_equal(other.faces, made.faces)


def test_an_index_out_of_range_is_refused_before_a_kernel_reads_there():
    piece = left_half()[2].piece
    fewer = {"points": piece.points[:3], "whole": piece.whole[:3]}
    for wrong in (fewer, {"faces": piece.faces - 1}):
        with pytest.raises(MeshError, match=r"face \d+: indices"):
            replace(piece, **wrong)


@pytest.mark.parametrize("levels", [0, -1, 17])
def test_levels_out_of_range_are_refused_by_name(levels):
    with pytest.raises(ParameterError, match=f"levels = {levels}: expected"):
        refine_piece(left_half()[2].piece, loop(), levels, 1.0, Blocks(1))
