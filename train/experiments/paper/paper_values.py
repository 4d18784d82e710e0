"""Values that others report, for the columns beside ours; never shown as a measurement of ours.

`PAPER_…` is printed in the paper; `PUBLISHED_…` is printed in the CSV files of the author's
repository, https://github.com/ugail/Proximity-Preserving-Neural-Subdivision (MIT License).
Improvements over Loop in per cent, ratios as fractions of the envelope, angles in radians.
"""

from collections.abc import Mapping
from typing import Any

Values = Mapping[str, Any]


# Paper, table "Held-out ridge comparison": improvement and its interval.
PAPER_HEADLINE: Values = {
    "distance_near": (21.0, 13.7, 31.3),
    "distance": (13.3, 7.4, 21.4),
    "hausdorff_near": (9.3, 1.7, 21.0),
    "hausdorff": (9.3, 1.7, 21.0),
    "normal_near": (0.4, -2.5, 2.5),
    "normal": (0.1, -2.0, 3.6),
}
PAPER_UNCONSTRAINED: Values = {
    "distance_near": (56.0, 35.5, 69.4),
    "distance": (54.0, 33.6, 67.5),
    "hausdorff_near": (49.6, 29.4, 62.4),
    "hausdorff": (49.6, 29.4, 62.4),
    "normal_near": (38.7, 34.0, 44.5),
    "normal": (-4.0, -16.5, 4.0),
}

# main_results_table.csv
PUBLISHED_HEADLINE: Values = {
    "distance_near": 21.01,
    "distance": 13.29,
    "hausdorff_near": 9.25,
    "hausdorff": 9.25,
    "normal_near": 0.42,
    "normal": 0.07,
}
PUBLISHED_UNCONSTRAINED: Values = {
    "distance_near": 56.21,
    "distance": 54.34,
    "hausdorff_near": 49.83,
    "hausdorff": 49.83,
    "normal_near": 38.80,
    "normal": -4.16,
}

# ablation.csv: ratio after one step, affine error, ratio and normal jump at level 3, near fit.
PUBLISHED_ABLATION: Values = {
    "pns": (1.0, 0.0, 0.9994, 0.3189, 20.82),
    "random": (0.1367, 0.0, 0.1233, 0.1595, 1.31),
    "no-h2": (4.1112, 0.0, 104.6719, 3.1336, 12.97),
    "no-gate": (1.0, 6.556e-02, 1.0, 0.4618, 23.30),
    "unbounded": (4.2831, 0.0, 14.9553, 3.1398, 11.65),
    "unconstrained": (4.0687, 1.261e-01, 2900.2427, 3.1410, 56.52),
}

# c_sweep.csv: near and global improvement, largest ratio; the paper gives "roughly 5 … 22 %".
PUBLISHED_C_SWEEP: Values = {
    "0.1": (5.33, 3.62, 1.0),
    "0.25": (12.67, 8.31, 1.0),
    "0.5": (20.41, 12.36, 1.0),
    "1.0": (21.94, 13.12, 1.0),
}

# metrics_summary.json, capacity_boost and saddle.
PUBLISHED_CAPACITY: Values = {
    "distance_near": 18.43,
    "distance": 14.89,
    "hausdorff_near": 7.15,
    "normal_near": 0.61,
}
PUBLISHED_SADDLE: Values = {"distance_near": 0.0215, "distance": 0.0188, "normal_near": 0.59}

# cross_family_sphere_ridge.csv; plain ratios of means.
PUBLISHED_SPHERE_RIDGE: Values = {"distance": 1.38, "hausdorff": 0.01}

# Paper, table "Repeated-subdivision summary": largest error at levels 1 and 4, normal jump at
# level 4, largest ratio of levels 1 to 4. Text stands where the paper prints no number.
PAPER_REPEATED: Values = {
    "loop": (0.098, 0.103, 0.139, 0.0),
    "butterfly": (0.092, 0.094, 0.862, 61.6),
    "pn-triangles": (0.076, 0.086, 0.858, 8.0),
    "quadric": (0.138, 0.210, 3.122, 458.7),
    "normal-displacement": (0.098, 0.103, 0.139, "≈ 0"),
    "curvature-adaptive": (0.097, 0.100, 0.390, 5.2),
    "pns": (0.098, 0.104, 0.130, "≤ 1"),
    "unconstrained": (0.090, 0.088, "≈ π", "192.7 (figure: 1.15e4)"),
}
# The instance of the paper's cross-section, hero and repeated figures.
PAPER_INSTANCE: Values = {"amplitude": 0.61, "sharpness": 8.94}

# structural_certification.csv, and the paper's table "Structural tests"; "T4" is the paper's only.
PUBLISHED_STRUCTURAL: Values = {
    "bounded displacement": (0.073609, None),
    "equivariance, double precision": (1.780e-15, 3.5e-15),
    "affine reproduction, axis-aligned": (0.0, 0.0),
    "proximity slope": (None, 2.000),
    "normal-variation slope": (None, 1.000),
    "Lipschitz slope": (None, 1.02),
}
PUBLISHED_ADVERSARIAL: Values = {
    "proximity ratio": 1.0,
    "equivariance": 1.018e-15,
    "affine reproduction": 0.0,
}

# spectral_certification.csv: tangent eigenvalue and Reif gap of the (k+1)-star.
PUBLISHED_SPECTRAL: Values = {
    "3": (0.250000000, 0.187500),
    "4": (0.375000000, 0.234375),
    "5": (0.452254249, 0.247720),
    "6": (0.500000000, 0.250000),
    "7": (0.530872450, 0.211503),
    "8": (0.551776695, 0.176777),
    "9": (0.566511111, 0.148099),
    "10": (0.577254249, 0.125000),
    "11": (0.585313383, 0.106460),
    "12": (0.591506351, 0.091506),
}
