"""Broken files by the hundred: whatever the bytes, the answer is a result or a named refusal.

`make fuzz` takes as many as one likes.
"""

import json
import random

import numpy as np
import pytest

from service.errors import ServiceError
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron

LIMITS = Limits(max_faces=20_000, max_memory_bytes=64 * 2**20)
BINARY_MUTANTS, JSON_MUTANTS, TRUNCATIONS = 400, 400, 300


def sample():
    """A small file that uses every kind of thing the reader looks at."""
    tree, binary = files.document(
        [box(), octahedron()],
        [octahedron(), {"POSITION": np.zeros((2, 3)), "mode": 1}],
    )
    tree["nodes"] += [{"children": [0, 1]}, {"mesh": 0, "extras": [1, "two", None]}]
    tree["scenes"] = [{"nodes": [2, 3]}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["textures"] = [{"source": 0, "sampler": 0}]
    tree["samplers"] = [{}]
    tree["images"] = [{"bufferView": 0, "mimeType": "image/png"}]
    tree["animations"] = [
        {
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "scale"}}],
            "samplers": [{"input": 0, "output": 1}],
        }
    ]
    return tree, bytes(binary)


def outcome(data, media="glb"):
    """ "refined", or the code of the refusal; any other exception fails the test."""
    refusal = None
    try:
        result = subdivide_gltf(data, media, Options(levels=1, scheme="loop"), None, LIMITS)
    except ServiceError as error:
        refusal = error
    if refusal is None:
        files.unpack(result.glb)
        return "refined"
    assert 400 <= refusal.status < 500
    assert refusal.detail
    return refusal.code


def test_the_sample_itself_is_refined():
    assert outcome(files.pack(*sample())) == "refined"


@pytest.mark.parametrize("seed", range(2))
def test_flipped_bits_give_results_or_named_refusals(seed):
    rng = random.Random(seed)
    whole = files.pack(*sample())
    seen = set()
    for _ in range(BINARY_MUTANTS // 2):
        mutant = bytearray(whole)
        for _ in range(rng.choice([1, 1, 2, 8, 64])):
            mutant[rng.randrange(len(mutant))] ^= 1 << rng.randrange(8)
        seen.add(outcome(bytes(mutant)))
    assert {"refined", "unreadable", "invalid-gltf"} <= seen


def test_truncated_files_are_unreadable():
    rng = random.Random(0)
    whole = files.pack(*sample())
    for end in rng.sample(range(len(whole)), TRUNCATIONS):
        assert outcome(whole[:end]) == "unreadable"


def test_truncated_json_in_an_intact_container_is_refused():
    tree, binary = sample()
    text = json.dumps(tree).encode()
    for end in range(0, len(text), 7):
        assert outcome(files.pack(text[:end], binary)) in {"unreadable", "invalid-gltf"}


def test_truncated_binary_chunks_are_refused():
    tree, binary = sample()
    for end in range(0, len(binary) - 4, 5):
        assert outcome(files.pack(tree, binary[:end])) == "invalid-gltf"


NUMBERS = [
    -1,
    0,
    1,
    2,
    3,
    4,
    5,
    7,
    12,
    100,
    252,
    253,
    5121,
    5126,
    65535,
    2**31,
    2**32,
    2**63,
    2**70,
]
VALUES = [*NUMBERS, 0.5, -1e308, None, True, "", "POSITION", "data:,", [], [0], {}, {"a": []}]


@pytest.mark.parametrize("seed", range(2))
def test_replaced_json_values_give_results_or_named_refusals(seed):
    rng = random.Random(seed)
    tree, binary = sample()
    seen = set()
    for _ in range(JSON_MUTANTS // 2):
        mutant = json.loads(json.dumps(tree))
        for _ in range(rng.choice([1, 1, 1, 2, 4])):
            holder, key = rng.choice(list(places(mutant)))
            if rng.random() < 0.2:
                del holder[key]
            else:
                holder[key] = rng.choice(VALUES)
        seen.add(outcome(files.pack(mutant, binary)))
    assert {"refined", "invalid-gltf"} <= seen


def places(value):
    """Every (container, key) of a JSON tree."""
    keys = value.keys() if isinstance(value, dict) else range(len(value))
    for key in list(keys):
        yield value, key
        if isinstance(value[key], dict | list):
            yield from places(value[key])
