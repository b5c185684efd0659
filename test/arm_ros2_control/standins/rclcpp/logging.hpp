// SPDX-License-Identifier: Apache-2.0
// A stand-in of rclcpp's logging, written from its documentation, to compile and drive the plugins without ROS.
#pragma once

#include <cstdio>

namespace rclcpp {
struct Logger {};
}  // namespace rclcpp

#define STANDIN_LOG(logger, ...) ((void)(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))
#define RCLCPP_ERROR STANDIN_LOG
#define RCLCPP_FATAL STANDIN_LOG
