# Build: a virtual environment with nothing that is not pinned by hash; no torch. Debian's C compiler links the loops,
# and stays behind.
FROM python:3.13.14-slim-bookworm@sha256:67a1e1f215ccda113cfc024e8639049257e88f273898f595b61476d128d387e8 AS build
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /src
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -r /var/lib/apt/lists/*
RUN python3 -m venv /opt/pns && python3 -m venv /opt/build
COPY requirements requirements
RUN /opt/build/bin/python -m pip install --require-hashes -r requirements/build.txt \
 && /opt/pns/bin/python -m pip install --require-hashes --no-deps -r requirements/meshopt.txt -r requirements/service.txt
COPY pyproject.toml setup.py README.md LICENSE ./
COPY pns_common pns_common
COPY service service
# Our own package alone has no hash: it is built here, from these files, by what is pinned above.
# What is never loaded goes: libraries' tests, tools, kernels of GPUs and sources in C, stubs, lexers, and the
# libraries for other languages.
RUN (cd pns_common/models && sha256sum --check --strict SHA256SUMS) \
 && /opt/build/bin/python -m pip wheel --no-build-isolation --no-deps --no-index --wheel-dir /src/dist . \
 && /opt/pns/bin/python -m pip install --no-deps --no-index dist/*.whl \
 && /opt/pns/bin/python -m pip check \
 && /opt/build/bin/cyclonedx-py environment /opt/pns/bin/python --output-reproducible --of JSON -o /opt/pns/sbom.cdx.json \
 && /opt/pns/bin/python -m pip uninstall --yes --quiet setuptools pip \
 && find /opt/pns/lib -type d \( -name test -o -name tests -o -name transformers -o -name f2py \
      -o -path '*/onnx/reference' -o -path '*/onnxruntime/quantization' -o -path '*/onnxruntime/tools' \) \
      -prune -exec rm -r {} + \
 && find /opt/pns/lib -regextype posix-extended -type f \
      -regex '.*(\.(pyi|pxd|h|c|cc|cpp|a|proto)|/pygments/lexers/(__pycache__/)?([a-z]|_.*_b)[^/]*)' -delete \
 && rm -r /opt/pns/lib/python3*/site-packages/onnxruntime/capi/libonnxruntime.so.* \
      /opt/pns/bin/draco_* /opt/pns/include /opt/pns/share
RUN cd / && /opt/pns/bin/pns doctor

# Run: the environment alone, as a user without a name, on a root that may be read-only.
FROM python:3.13.14-slim-bookworm@sha256:67a1e1f215ccda113cfc024e8639049257e88f273898f595b61476d128d387e8
COPY --from=build /opt/pns /opt/pns
# One thread a library: the workers are the parallelism, and a pids limit counts threads.
# For 1 GiB: at rest two workers take 146 MiB each and the server 55. Bodies and answers are memory
# that no worker's end gives back: with all bodies a job of PNS_MEMORY has room, and two that take
# what was predicted where clients do not hold so much. With a larger --memory, raise these.
ENV PATH=/opt/pns/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1 \
    PNS_HOST=0.0.0.0 \
    PNS_PORT=8000 \
    PNS_METRICS_PORT=9000 \
    PNS_MEMORY=256MiB \
    PNS_QUEUE=4
USER 10001:10001
WORKDIR /tmp
EXPOSE 8000 9000
STOPSIGNAL SIGTERM
# Not urllib, which asks the proxy that Docker may name in the environment of its containers.
HEALTHCHECK --interval=30s --timeout=5s --start-period=20s --retries=3 \
  CMD ["python", "-c", "import os, http.client as h; c = h.HTTPConnection('127.0.0.1', os.environ['PNS_PORT'], timeout=4); c.request('GET', '/healthz'); exit(c.getresponse().status != 200)"]
CMD ["pns", "serve"]
