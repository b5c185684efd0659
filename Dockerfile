# SPDX-License-Identifier: Apache-2.0
# Two images to use as a starting point:
#   docker build --target library -t arm .     the libraries and the commands that need no ROS
#   docker build --target ros -t arm-ros .     everything, on ROS 2 Jazzy
#   docker run --rm arm describe panda
#   docker run --rm --network host arm-ros sim panda

FROM python:3.12-slim AS library
RUN apt-get update \
    && apt-get install -y --no-install-recommends g++ gcc libc6-dev \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /suite
COPY . .
RUN python -m pip install --no-cache-dir .
RUN arm describe pendulum
ENTRYPOINT ["arm"]
CMD ["--help"]

FROM ros:jazzy-ros-base AS ros
RUN apt-get update \
    && apt-get install -y --no-install-recommends build-essential python3-dev python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /suite
COPY . .
RUN . /opt/ros/jazzy/setup.sh && ./arm setup && ./arm describe pendulum
ENTRYPOINT ["/ros_entrypoint.sh", "./arm"]
CMD ["help"]
