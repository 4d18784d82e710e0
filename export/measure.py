"""The metrics on a bundled model's card, measured anew after a change of the operator."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import onnx

from pns_common import ModelError, load_model, pns
from pns_common.files import replace_file
from pns_common.model.card import CARD_KEY, PAPER_FORMAT
from pns_common.model.file import check_file
from train.metrics.card import MEASURES, ONE_STEP, TO_LIMIT
from train.metrics.one_step import improvements_as_data


def measure_anew(path: Path, on_measured: Callable[[str], None]) -> None:
    """Measure a model file and write its card with the new metrics; all else keeps its bytes.

    Args:
        on_measured: called with the name of each data set once it is measured.

    Raises:
        ModelError: there is no such file, or it breaks the contract.
    """
    if not path.is_file():
        raise ModelError(str(path), expected="a model file", found="none")
    data = path.read_bytes()
    card, scheme, metrics = check_file(data, path.stem), pns(load_model(path)), {}
    for name in [ONE_STEP] if card.format == PAPER_FORMAT else TO_LIMIT:
        metrics[name] = improvements_as_data(MEASURES[name](scheme))
        on_measured(name)
    proto = onnx.load_from_string(data)
    (entry,) = (each for each in proto.metadata_props if each.key == CARD_KEY)
    entry.value = replace(card, metrics=metrics).to_json()
    replace_file(path, proto.SerializeToString(deterministic=True))
