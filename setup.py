"""Which folders become which packages; everything else stands in pyproject.toml.

The wheel holds the library and the service. The folder service/ is installed as pns_service, since
`service` is a name that others use too; inside it all imports are relative.
"""

from setuptools import find_packages, setup

setup(
    packages=[
        *find_packages(include=["pns_common", "pns_common.*"]),
        "pns_service",
        *(f"pns_service.{room}" for room in find_packages("service")),
    ],
    package_dir={"pns_service": "service"},
)
