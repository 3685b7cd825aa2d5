# Serving only: no torch, no onnx. The image holds the shipped models. For STEP, FBX, COLLADA and USD:
#   docker build --build-arg EXTRAS=formats .

FROM python:3.12-slim AS build
WORKDIR /src
RUN python -m venv --without-pip /opt/meshconv3d
COPY pyproject.toml README.md LICENSE ./
COPY model model
COPY export export
COPY service service
COPY meshconv3d meshconv3d
ARG EXTRAS=""
# Without the libraries' own tests.
RUN pip --python /opt/meshconv3d/bin/python install --no-cache-dir ".${EXTRAS:+[$EXTRAS]}" && \
    find /opt/meshconv3d -type d -name tests -prune -exec rm -r {} +

FROM python:3.12-slim
RUN useradd --system --uid 10001 --no-create-home meshconv3d
COPY --from=build /opt/meshconv3d /opt/meshconv3d
# The image holds compiled kernels, for any processor of its architecture, so that no start waits
# for the compiler. They are only read. The root file system may be read-only, and /tmp with it:
# the one place that is written to, for a socket and the files of the extra `formats`, is the memory
# that every container has.
ENV PATH=/opt/meshconv3d/bin:$PATH \
    NUMBA_CACHE_DIR=/opt/numba \
    NUMBA_CPU_NAME=generic \
    TMPDIR=/dev/shm \
    MESHCONV3D_HOST=0.0.0.0 \
    PYTHONDONTWRITEBYTECODE=1
# Starts a worker and classifies all samples with each shipped model, which compiles all kernels.
RUN python -c "from meshconv3d.service.http import server; from meshconv3d.service.settings import \
Settings; server.start_workers(Settings(workers=1)).close()" && \
    package="$(python -c 'import meshconv3d; print(meshconv3d.__path__[0])')" && \
    for model in "$package"/service/shipped/*.onnx; do \
        meshconv3d classify --json --model "$model" "$package/model/samples" > /dev/null || exit 1; \
    done
USER 10001
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=30s \
    CMD ["python", "-c", "import os, urllib.request as u; u.urlopen(f\"http://127.0.0.1:{os.environ.get('MESHCONV3D_PORT', 8000)}/readyz\", timeout=2)"]
CMD ["meshconv3d", "serve"]
