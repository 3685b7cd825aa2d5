# The image of all nodes of a Ray cluster, for deploy/rayjob.yaml:
#   docker build -f deploy/ray.Dockerfile -t meshconv3d-ray:0.1.0 .
FROM rayproject/ray:2.60.0-py312
COPY --chown=ray pyproject.toml README.md LICENSE /home/ray/src/
COPY --chown=ray model /home/ray/src/model
COPY --chown=ray export /home/ray/src/export
COPY --chown=ray service /home/ray/src/service
COPY --chown=ray meshconv3d /home/ray/src/meshconv3d
RUN pip install --no-cache-dir '/home/ray/src[ray,remote,parquet]' s3fs && rm -r /home/ray/src
# Compiled kernels, as in ../Dockerfile.
ENV NUMBA_CACHE_DIR=/home/ray/numba \
    NUMBA_CPU_NAME=generic \
    RAY_USAGE_STATS_ENABLED=0
RUN meshconv3d classify --json "$(python -c 'import meshconv3d.model.samples as s; print(s.__path__[0])')"
