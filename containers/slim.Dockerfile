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
# Whoever runs it may write here: compiled code, matplotlib's fonts.
ENV PATH=/opt/paint/bin:/usr/bin:/bin HOME=/var/cache/paint NUMBA_CACHE_DIR=/var/cache/paint/compiled
# The self-test compiles what most commands need.
RUN paint doctor && chmod -R a+rwX /var/cache/paint
WORKDIR /work
ENTRYPOINT ["paint"]
