# Build: a virtual environment with the pinned inference dependencies; no torch, no compiler.
FROM python:3.11-slim-bookworm AS build
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_CONSTRAINT=/src/constraints.txt
WORKDIR /src
RUN python -m venv /opt/pns
COPY constraints.txt pyproject.toml README.md LICENSE ./
COPY requirements requirements
COPY pns_common pns_common
COPY service service
RUN /opt/pns/bin/python -m pip install --no-deps --require-hashes -r requirements/meshopt.txt \
 && /opt/pns/bin/python -m pip install .

# Run: the environment alone, as a user without a name, on a root that may be read-only.
FROM python:3.11-slim-bookworm
COPY --from=build /opt/pns /opt/pns
# One thread a library: the workers are the parallelism, and a pids limit counts threads.
# For 1 GiB: two workers of PNS_MEMORY each, four bodies of 64 MiB, and what all take at rest.
# With a larger --memory, raise both.
ENV PATH=/opt/pns/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1 \
    PNS_HOST=0.0.0.0 \
    PNS_PORT=8000 \
    PNS_MEMORY=320MiB \
    PNS_QUEUE=2
USER 10001:10001
WORKDIR /tmp
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=5s --start-period=20s --retries=3 \
  CMD ["python", "-c", "import os, urllib.request as u; u.urlopen(f'http://127.0.0.1:{os.environ[\"PNS_PORT\"]}/healthz', timeout=4)"]
CMD ["pns", "serve"]
