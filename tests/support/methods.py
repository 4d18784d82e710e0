"""The baselines that need no training, by name."""

from train.baselines.butterfly import modified_butterfly
from train.baselines.curvature_adaptive import curvature_adaptive
from train.baselines.normal_displacement import normal_displacement
from train.baselines.pn_triangles import pn_triangles
from train.baselines.quadric import quadric_fit

BASELINES = {
    "butterfly": modified_butterfly(),
    "pn-triangles": pn_triangles(),
    "quadric": quadric_fit(),
    "normal-displacement": normal_displacement(0.05),
    "curvature-adaptive": curvature_adaptive(10.0),
}
INTERPOLATING = ("butterfly", "pn-triangles", "quadric")
