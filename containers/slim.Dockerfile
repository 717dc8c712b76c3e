# The command `paint` without ROS.
#   docker build --tag paint --file containers/slim.Dockerfile .
#   docker run --rm --user $(id -u) --volume $PWD:/work paint simulate --mesh part.stl ...
FROM debian:trixie-slim
RUN apt-get update && apt-get install --yes --no-install-recommends python3-venv \
    && rm -rf /var/lib/apt/lists/*
COPY requirements/core.txt /build/core.txt
RUN python3 -m venv /opt/paint \
    && /opt/paint/bin/pip install --no-cache-dir --require-hashes --requirement /build/core.txt
COPY ros2_ws/src/paint_deposition /build/paint_deposition
RUN /opt/paint/bin/pip install --no-cache-dir --no-deps /build/paint_deposition && rm -r /build
ENV PATH=/opt/paint/bin:/usr/bin:/bin
# The self-test compiles what most commands need. Compiled code is run: each run has a copy of its own.
RUN HOME=/var/cache/paint NUMBA_CACHE_DIR=/var/cache/paint/compiled paint doctor \
    && chmod -R a+rX,go-w /var/cache/paint
WORKDIR /work
ENTRYPOINT ["/bin/sh", "-c", \
    "export HOME=$(mktemp -d); export NUMBA_CACHE_DIR=$HOME/compiled; cp -r /var/cache/paint/. $HOME; exec paint \"$@\"", "--"]
