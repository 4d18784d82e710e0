"""Which folders become which packages; everything else stands in pyproject.toml.

The wheel holds the library and the service. The folder service/ is installed as pns_service, since
`service` is a name that others use too; inside it all imports are relative.
"""

from setuptools import find_namespace_packages, find_packages, setup

setup(
    packages=[
        *find_packages(include=["pns_common", "pns_common.*"]),
        "pns_service",
        # Folders of data alone, too: setuptools takes each for a package that was forgotten.
        *(
            f"pns_service.{room}"
            for room in find_namespace_packages("service", exclude=["*__pycache__*"])
        ),
    ],
    package_dir={"pns_service": "service"},
)
