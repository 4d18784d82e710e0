"""Broken mesh files by the hundred: whatever the bytes, a result or a named refusal."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
import trimesh

from pns_common.errors import PnsError
from pns_common.operator.scheme import loop
from service.errors import ServiceError
from service.meshfiles import formats
from service.meshfiles.convert import converted
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.options import Limits, Options

LIMITS = Limits(max_faces=20_000, max_memory_bytes=64 * 2**20)
OPTIONS = Options(scheme="loop")
MUTANTS = 60
WORDS = [
    *(b"0", b"-1", b"3", b"255", b"99999999999", b"9" * 25, b"9" * 5000, b"1e39", b"1e400"),
    *(b"nan", b"-inf", b"1e-320", b"0x10", b"1_0", b"\xff\xfe", b"\xe9t\xe9", b"\0", b"", b"#"),
    *(b"f", b"v", b"solid", b"endsolid", b"vertex", b"element", b"list", b"\n", b"//", b"1/1/1"),
]


def samples() -> dict[str, tuple[str, bytes]]:
    """Small files, text and binary, with what the formats have beside triangles."""
    box = trimesh.creation.box()
    text_ply = box.export(file_type="ply", encoding="ascii")
    uv = "".join(f"vt {n / 8} 0.5\n" for n in range(8))
    faces = "".join("f " + " ".join(f"{v + 1}/{v + 1}" for v in f) + "\n" for f in box.faces)
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in box.vertices)
    return {
        "obj": ("obj", f"# box\no part\n{corners}{uv}usemtl a\n{faces}f -4 -3 -2 -1\n".encode()),
        "off": ("off", box.export(file_type="off").encode() + b"\n"),
        "ply": ("ply", bytes(box.export(file_type="ply"))),
        "text ply": ("ply", text_ply if isinstance(text_ply, bytes) else text_ply.encode()),
        "stl": ("stl", bytes(box.export(file_type="stl"))),
        "text stl": ("stl", box.export(file_type="stl_ascii").encode()),
    }


def outcome(data: bytes, kind: str) -> str:
    """`refined`, or the code of the refusal; any other exception fails the test."""
    refusal: ServiceError | PnsError
    try:
        fine, _ = refine_mesh_file(formats.read(data, kind), loop(), OPTIONS, LIMITS)
    except (ServiceError, PnsError) as error:
        refusal = error
    else:
        assert len(fine.faces) >= 4
        return "refined"
    assert str(refusal)
    if isinstance(refusal, PnsError):
        return "mesh"
    assert 400 <= refusal.status < 500
    return refusal.code


def status_of(data: bytes, kind: str) -> int:
    """Return what the service would answer, which has it as glTF; other exceptions fail."""
    try:
        converted(data, kind, "glb", OPTIONS, None, LIMITS)
    except ServiceError as refusal:
        return refusal.status
    except PnsError:
        return 422
    return 200


def flipped(data: bytes, rng: random.Random) -> bytes:
    mutant = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 8, 64])):
        mutant[rng.randrange(len(mutant))] ^= 1 << rng.randrange(8)
    return bytes(mutant)


def reworded(data: bytes, rng: random.Random) -> bytes:
    """Words of the text, or of a binary file's head, replaced, left out or repeated."""
    head, body = data[:400], data[400:]
    if data.isascii():
        head, body = data, b""
    words = head.split(b" ")
    for _ in range(rng.choice([1, 1, 2, 4])):
        words[rng.randrange(len(words))] = rng.choice(WORDS)
    return b" ".join(words) + body


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


@pytest.mark.parametrize("change", [flipped, reworded, cut])
@pytest.mark.parametrize("name", samples())
def test_broken_files_give_results_or_named_refusals(
    name: str, change: Callable[[bytes, random.Random], bytes]
) -> None:
    kind, data = samples()[name]
    rng = random.Random(0)
    mutants = [change(data, rng) for _ in range(MUTANTS)]
    seen = {outcome(mutant, kind) for mutant in mutants}
    # A bit of a binary STL is a bit of a position.
    assert "unreadable" in seen or (name, change) == ("stl", flipped)
    assert {status_of(mutant, kind) for mutant in mutants} <= {200, 400, 413, 422}
