# The nodes on ROS 2, with foxglove_bridge; compose.yaml makes a cell of it.
ARG DISTRIBUTION=jazzy
FROM ros:${DISTRIBUTION}
SHELL ["/bin/bash", "-c"]
RUN apt-get update && apt-get install --yes --no-install-recommends \
    cmake g++ make python3-colcon-common-extensions python3-dev python3-venv \
    ros-${ROS_DISTRO}-foxglove-bridge ros-${ROS_DISTRO}-launch-ros \
    ros-${ROS_DISTRO}-rmw-cyclonedds-cpp ros-${ROS_DISTRO}-tf2-ros-py \
    && rm -rf /var/lib/apt/lists/*
COPY . /paint
WORKDIR /paint
RUN . /opt/ros/${ROS_DISTRO}/setup.bash && make build && . setup/environment.sh && paint doctor
ENTRYPOINT ["/bin/bash", "-c", \
    ". /opt/ros/$ROS_DISTRO/setup.bash && . setup/environment.sh && exec \"$@\"", "--"]
CMD ["bash"]
