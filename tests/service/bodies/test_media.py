"""Accept headers: what they say of one type, and what reading them takes."""

import pytest

from service.bodies import media


@pytest.mark.parametrize(
    ("accept", "wanted"),
    [
        ("", 0.0),
        ("application/json", 1.0),
        (" Application/JSON ; Q = 0.5 ", 0.5),
        ("*/*;q=0.1, application/*;q=0.2", 0.2),
        ("application/*, application/json;q=0", 0.0),
        ("application/json;v=1;q=0.3;q=0.4", 0.3),
        ("application/json;q=2", 1.0),
        ("application/json;q=0.5, application/json", 1.0),
        ("text/*, , application/jsonp", 0.0),
    ],
)
def test_the_most_specific_range_tells(accept, wanted):
    assert media.quality("application/json", accept) == wanted
