"""Which folders become which packages, and the compiled loops; all else stands in pyproject.toml.

The wheel holds the library and the service. The folder service/ is installed as pns_service, since
`service` is a name that others use too; inside it all imports are relative. Where there is no
service/, as in Blender's extension, the wheel is the library alone.
"""

import os
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, find_namespace_packages, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.modified import newer_group

KERNELS = Path("pns_common/kernels")


class BuildLoops(build_ext):
    """Compile the loops by numba, and link them with what calls them."""

    def build_extension(self, ext: Extension) -> None:
        """Build the one extension; without a C compiler it is left out, with a warning."""
        import numpy as np

        sources = map(str, [*KERNELS.glob("*.py"), *KERNELS.glob("*.c")])
        if not newer_group(sources, self.get_ext_fullpath(ext.name), missing="newer"):
            return
        self.force = True
        folder = Path(self.build_temp) / "loops"
        command = [sys.executable, "-P", KERNELS / "ahead.py", folder]
        path = os.pathsep.join([str(Path.cwd()), *sys.path])
        subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": path})
        ext.include_dirs = [str(folder), np.get_include()]
        ext.extra_objects = sorted(map(str, folder.glob("*.o")))
        super().build_extension(ext)


service = ["pns_service"] if Path("service").is_dir() else []
setup(
    packages=[
        *find_packages(include=["pns_common", "pns_common.*"]),
        *service,
        # Folders of data alone, too: setuptools takes each for a package that was forgotten.
        *(
            f"pns_service.{room}"
            for room in (service and find_namespace_packages("service", exclude=["*__pycache__*"]))
        ),
    ],
    package_dir=dict.fromkeys(service, "service"),
    # One module for every Python from 3.11 on.
    ext_modules=[
        Extension(
            "pns_common.kernels.compiled",
            [str(KERNELS / "dispatch.c")],
            define_macros=[("Py_LIMITED_API", "0x030b0000")],
            py_limited_api=True,
            optional=True,
        )
    ],
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
    cmdclass={"build_ext": BuildLoops},
)
