"""A client of the service as a program would write it, on the modules that the generator made.

Run in the generator's environment: `python python_client.py FOLDER ADDRESS INPUT OUTPUT`; the last
line that it prints is what it saw, as JSON.
"""

import json
import sys
from io import BytesIO
from pathlib import Path

folder, address, source, output = sys.argv[1:]
sys.path.insert(0, folder)

from generated import Client  # noqa: E402
from generated.api.default import limits, models, report, subdivide  # noqa: E402
from generated.models import (  # noqa: E402
    Problem,
    ReportFilesBody,
    SubdivideFilesBody,
    SubdivideScheme,
)
from generated.types import File  # noqa: E402


def file():
    return File(BytesIO(Path(source).read_bytes()), "mesh.glb", "model/gltf-binary")


with Client(address, timeout=600) as client:
    refined = subdivide.sync(
        client=client, body=SubdivideFilesBody(file()), levels=2, scheme=SubdivideScheme("loop")
    )
    Path(output).write_bytes(refined.payload.read())
    raw = subdivide.sync(client=client, body=file(), levels=2, scheme=SubdivideScheme("loop"))
    made = report.sync(client=client, body=ReportFilesBody(file()))
    refused = subdivide.sync(client=client, body=SubdivideFilesBody(file()), levels=7)
    seen = {
        "scheme": made["scheme"],
        "problem": refused.code if isinstance(refused, Problem) else None,
        "body_bytes": limits.sync(client=client).body_bytes,
        "models": [model.name for model in models.sync(client=client)],
        "raw": raw.payload.read() == Path(output).read_bytes(),
    }
print(json.dumps(seen))
