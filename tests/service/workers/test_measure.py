"""A glance at a document: what it predicts, and what it builds nothing of."""

from __future__ import annotations

import io
import re
import zipfile

import numpy as np
import pytest

from service.bodies.multipart import MAX_PARTS
from service.errors import LimitError
from service.options import BYTES_PER_INPUT_BYTE, Limits, Options
from service.workers.costs import Cost, cost_of
from service.workers.jobs import GLANCE_BYTES, Work, measure
from service.workers.measure import cost_of_gltf, cost_of_other
from service.workers.memory_file import MemoryFile
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron


def cost(data: bytes, levels: int = 1, limits: Limits | None = None) -> Cost:
    return cost_of_gltf(data, "glb", levels, limits or Limits())


def test_faces_and_primitives_are_those_that_the_document_counts() -> None:
    data = files.pack(*files.document([octahedron(), box()], [octahedron()]))
    measured = cost(data, levels=2)
    assert (measured.faces, measured.primitives) == (16 * (8 + 12 + 8), 3)


@pytest.mark.parametrize(("mode", "faces"), [(4, 2), (5, 4), (6, 4), (1, 0)])
def test_faces_by_mode(mode: int, faces: int) -> None:
    shape = {"POSITION": np.zeros((6, 3), np.float32), "mode": mode}
    assert cost(files.pack(*files.document([shape]))).faces == 4 * faces


def test_a_text_with_a_byte_order_mark_is_the_same() -> None:
    tree, _ = files.document([octahedron()])
    text = files.json.dumps(tree).encode()
    plain = cost_of_gltf(text, "gltf", 1, Limits())
    marked = cost_of_gltf(b"\xef\xbb\xbf" + text, "gltf", 1, Limits())
    assert plain.faces == marked.faces == 32


def test_integers_with_a_fraction_count_as_integers() -> None:
    tree, _ = files.document([octahedron()])
    text = re.sub(r": (\d+)(?=[,}])", r": \1.0", files.json.dumps(tree))
    assert '"count": 24.0' in text
    measured = cost_of_gltf(text.encode(), "gltf", 1, Limits())
    assert (measured.faces, measured.primitives) == (32, 1)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"glTF",
        files.pack(b"{"),
        files.pack(b'{"meshes":[{"primitives":3}]}'),
        files.pack(b'{"meshes":[{"primitives":[{"attributes":{"POSITION":9}}]}]}'),
        files.pack(b'{"accessors":[{"count":-4}],"meshes":[{"primitives":[{"indices":0}]}]}'),
        files.pack(b'{"accessors":[{"count":' + b"9" * 5000 + b"}]}"),
    ],
)
def test_what_will_be_refused_costs_its_bytes(data: bytes) -> None:
    measured, least = cost(data), cost_of(0, 0, len(data))
    assert (measured.faces, measured.primitives) == (0, 0)
    assert least.seconds <= measured.seconds < least.seconds + 1e-4


def test_what_is_over_the_limit_of_faces_costs_its_bytes() -> None:
    data = files.pack(*files.document([octahedron()]))
    assert cost(data, levels=3, limits=Limits(max_faces=100)) == cost_of(0, 0, len(data))


def test_more_levels_and_more_learned_levels_cost_more() -> None:
    data = files.pack(*files.document([octahedron()]))
    learned = [cost_of_gltf(data, "glb", 3, Limits(), count).seconds for count in (0, 1, 2, 3)]
    assert learned == sorted(set(learned))
    # A model cannot act at more levels than there are.
    assert cost_of_gltf(data, "glb", 3, Limits(), 9).seconds == learned[3]
    assert cost(data, levels=3).seconds < cost(data, levels=4).seconds


@pytest.mark.parametrize(
    "place", ["targets", "empty targets", "another primitive", "attributes", "joints"]
)
def test_what_many_attributes_carry_is_no_short_job(place: str) -> None:
    """A hundred kilobytes that take ten seconds: every target may be the same accessor."""
    tree, binary = files.document([octahedron()])
    tree["accessors"][0]["count"] = tree["accessors"][1]["count"] = 15_000
    (primitive,) = tree["meshes"][0]["primitives"]
    few = cost(files.pack(tree, binary)).seconds
    if place == "targets":
        primitive["targets"] = [{"POSITION": 0}] * 4_000
    elif place == "empty targets":
        primitive["targets"] = [{}] * 4_000
    elif place == "another primitive":
        small = {"POSITION": len(tree["accessors"])}
        tree["accessors"].append(tree["accessors"][0] | {"count": 3})
        tree["meshes"][0]["primitives"].append({"attributes": small, "targets": [small] * 4_000})
    elif place == "attributes":
        primitive["attributes"] |= {f"_A{number}": 0 for number in range(4_000)}
    else:
        for name in ("JOINTS", "WEIGHTS"):
            primitive["attributes"] |= {f"{name}_{number}": 0 for number in range(40)}
    assert cost(files.pack(tree, binary)).seconds > 10 > 0.2 > few


def test_the_places_of_sparse_accessors_are_gone_through_each_time() -> None:
    """Ten million, named a hundred times, take seconds, and may lie in a file beside the JSON."""
    tree, binary = files.document([octahedron()])
    (primitive,) = tree["meshes"][0]["primitives"]
    primitive["attributes"] |= {f"_A{number}": len(tree["accessors"]) for number in range(100)}
    few = cost(files.pack(tree, binary)).seconds
    tree["accessors"].append({"count": 10**7, "sparse": {"count": 10**7}})
    assert cost(files.pack(tree, binary)).seconds > 3 > 0.1 > few


def test_every_value_of_the_json_and_every_array_costs_something() -> None:
    tree, binary = files.document([octahedron()])
    plain = cost(files.pack(tree, binary)).seconds
    named = tree | {"animations": [{"channels": [], "samplers": []}] * 100_000}
    assert cost(files.pack(named, binary)).seconds > plain + 0.3
    tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}] * 8_000
    assert cost(files.pack(tree, binary)).seconds > plain + 0.5


def test_other_formats_cost_by_their_bytes_within_the_limit() -> None:
    assert cost_of_other(bytes(3000), "ply", 1, Limits()).faces == 400
    assert cost_of_other(bytes(3000), "ply", 1, Limits(max_faces=9)).faces == 8


def test_an_archive_too_large_for_a_glance_is_taken_for_the_largest() -> None:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("a.gltf", b"{" + bytes(GLANCE_BYTES // BYTES_PER_INPUT_BYTE) + b"}")
    limits = Limits(max_faces=1000)
    most = measured(content.getvalue(), "application/zip", limits)
    assert (most.faces, most.most) == (1000, True)


def test_a_form_of_too_many_parts_is_refused_at_a_glance() -> None:
    part = b'--X\r\nContent-Disposition: form-data; name="%d"\r\n\r\n\r\n'
    form = b"".join(part % number for number in range(MAX_PARTS + 1)) + b"--X--\r\n"
    with pytest.raises(LimitError) as refusal:
        measured(form, "multipart/form-data; boundary=X")
    assert refusal.value.limit == "parts"


@pytest.mark.parametrize("digits", [400, 4_300])
@pytest.mark.parametrize("field", ["count", "sparse"])
def test_a_count_of_thousands_of_digits_is_a_cost_and_no_fault(digits: int, field: str) -> None:
    tree, binary = files.document([octahedron()])
    text = files.json.dumps(tree).encode()
    number = b"9" * digits
    if field == "count":
        text = re.sub(rb'"count": \d+', b'"count": ' + number, text)
    else:
        text = re.sub(rb'("count": \d+)', rb'\1, "sparse": {"count": ' + number + b"}", text)
    job = measured(files.pack(text, binary), "model/gltf-binary")
    assert job.faces >= 0
    assert np.isfinite(job.seconds)


def test_counts_that_no_number_holds_cost_the_most(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_large(*_: object) -> Cost:
        raise OverflowError("int too large to convert to float")

    monkeypatch.setattr("service.workers.measure.cost_of_gltf", too_large)
    job = measured(b"glTF", "model/gltf-binary", Limits(max_faces=1000))
    assert (job.faces, job.most) == (1000, True)


def measured(content: bytes, kind: str, limits: Limits | None = None) -> Cost:
    """The cost of a body, as the worker of short jobs measures it."""
    with MemoryFile() as body, MemoryFile() as page:
        body.append(content)
        limits = limits or Limits()
        return measure(Work(body.name, None, None, page.name, kind, Options(), None, limits))
