import numpy as np
import torch

from train.data.batch import disjoint_union
from train.data.datasets import ridge_training


def test_each_inserted_vertex_belongs_to_its_own_instance():
    instances = ridge_training().instances[:3]
    batch = disjoint_union(instances)
    topology = batch.topology
    midpoints = batch.points.numpy()[topology.edges[topology.interior]].mean(axis=1)
    values = batch.surface.value(torch.from_numpy(midpoints)).numpy()
    per_mesh = len(topology.interior) // 3
    for index, instance in enumerate(instances):
        rows = slice(index * per_mesh, (index + 1) * per_mesh)
        expected = instance.surface.value(midpoints[rows])
        np.testing.assert_allclose(values[rows], expected, rtol=0, atol=1e-15)


def test_union_keeps_every_mesh_and_joins_none():
    instances = ridge_training().instances[:3]
    batch = disjoint_union(instances)
    count = len(instances[0].mesh.vertices)
    assert batch.points.dtype == torch.float64
    assert len(batch.children) == 4 * sum(len(instance.mesh.faces) for instance in instances)
    for index, instance in enumerate(instances):
        rows = slice(index * count, (index + 1) * count)
        np.testing.assert_array_equal(batch.points[rows], instance.mesh.vertices)
    owners = batch.topology.stencil[batch.topology.interior] // count
    assert (owners == owners[:, :1]).all()
