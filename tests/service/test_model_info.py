"""`pns info` says whether a model has a vertex rule."""

from pns_common.onnx_model import load_model, model_from_bytes
from service.model_info import print_model
from tests.export.test_vertex_file import file_bytes, two_networks


def test_a_vertex_rule_is_shown_where_there_is_one(capsys):
    print_model(model_from_bytes(file_bytes(two_networks()), "two"))
    shown = capsys.readouterr().out
    assert "ring-10" in shown
    assert "symmetric" in shown
    print_model(load_model("paper"))
    assert "vertex" not in capsys.readouterr().out
