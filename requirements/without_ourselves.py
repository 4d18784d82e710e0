"""Leave out of a compiled list what has no place in it: this project, and meshopt.

meshopt's hashes are in meshopt.txt: those of the files that were looked into.
"""

import re
import sys
from pathlib import Path

HEAD = """# Everything that the service's image installs, with the hashes of what may be
# installed: made by `make hashes` from pyproject.toml and constraints.txt.
"""
OURS = r"(?m)^(?:# WARNING: [^\n]*\n(?:# [^\n]*\n)*)?pns-subdivision @ [^\n]*\n"
MESHOPT = r"(?m)^meshopt==[^\n]*\n(?:    --hash[^\n]*\n?)+"

compiled, wanted = map(Path, sys.argv[1:])
text = re.sub(MESHOPT, "", re.sub(OURS, "", compiled.read_text()))
wanted.write_text(HEAD + text)
compiled.unlink()
