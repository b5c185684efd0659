# SPDX-License-Identifier: Apache-2.0
"""The standard interfaces of simulators, where the package ``simulation_interfaces`` is installed.

Definitions: github.com/ros-simulation/simulation_interfaces, version 1.5.1, which Jazzy
distributes. Depends on the engine and the simulation's frames; message packages are looked up when
the node starts.
"""
