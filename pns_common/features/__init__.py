"""What the networks read of an edge and of a vertex's ring, and in which order."""

from pns_common.features.edge_features import FEATURE_COUNT, FEATURE_SETS
from pns_common.features.feature_set import FeatureGroup, FeatureSet
from pns_common.features.ring_features import RING_10, RING_FEATURE_SETS
from pns_common.features.symmetry import HALF_TURN, MIRROR, TURN_OVER, Feature, Symmetries, symmetries
