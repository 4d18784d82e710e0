"""On a Ray cluster of one worker: the bytes of this machine."""

import pytest

from service.scale.batch import batch_work
from service.scale.engines import on_ray
from tests.service.scale import libraries

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip("ray", reason="the extra [ray] is not installed")
    with pytest.MonkeyPatch.context() as settings:
        # A busy machine starts its daemons slowly.
        settings.setenv("RAY_raylet_start_wait_time_s", "300")
        on_ray._connected(ray, None, 1)
        yield
        ray.shutdown()


def test_a_library_has_the_same_bytes(tmp_path, cluster):
    libraries.library(tmp_path / "in", ["a.obj", "b/c.obj"])
    libraries.refined(libraries.batch_of(tmp_path))
    over = libraries.batch_of(
        tmp_path, destination=str(tmp_path / "ray"), report=tmp_path / "ray.jsonl"
    )
    done = libraries.refined(over, on_ray.on_ray(batch_work(60.0), None, 1))
    assert done.counts == {"done": 2}
    assert libraries.hashes(tmp_path / "ray") == libraries.hashes(tmp_path / "out")
