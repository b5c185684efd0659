// SPDX-License-Identifier: Apache-2.0
// A stand-in for rclcpp, which is on no registry: what a node that answers joint states uses of it.
// Names and signatures are those of rclcpp (Jazzy). spin() takes states from the standard input, a
// line each: the number of joints, then name, position and velocity of each; publish() writes the
// frame and names with efforts.
#pragma once

#include <cstdio>
#include <functional>
#include <iostream>
#include <memory>
#include <string>

#include <sensor_msgs/msg/joint_state.hpp>

namespace rclcpp {

class QoS {
public:
  QoS(size_t depth) { static_cast<void>(depth); } // NOLINT: a number is converted, as there
};

class SensorDataQoS : public QoS {
public:
  SensorDataQoS() : QoS(5) {}
};

template <typename Message> class Publisher {
public:
  using SharedPtr = std::shared_ptr<Publisher<Message>>;

  void publish(const Message& message) {
    std::printf("%s %u", message.header.frame_id.c_str(), message.header.stamp.nanosec);
    for (size_t i = 0; i < message.name.size(); ++i) std::printf(" %s %.17g", message.name[i].c_str(), message.effort.at(i));
    std::printf("\n");
  }
};

template <typename Message> class Subscription {
public:
  using SharedPtr = std::shared_ptr<Subscription<Message>>;
};

class Node {
public:
  using State = sensor_msgs::msg::JointState;

  explicit Node(const std::string& name) { static_cast<void>(name); }

  template <typename Message> typename Publisher<Message>::SharedPtr create_publisher(const std::string& topic, const QoS&) {
    return topic == "joint_commands" ? std::make_shared<Publisher<Message>>() : nullptr;
  }

  template <typename Message, typename Callback>
  typename Subscription<Message>::SharedPtr create_subscription(const std::string& topic, const QoS&, Callback&& callback) {
    if (topic == "joint_states") answer_ = callback;
    return std::make_shared<Subscription<Message>>();
  }

  void hear() {
    size_t joints = 0;
    for (unsigned count = 0; std::cin >> joints; ++count) {
      auto state = std::make_shared<State>();
      state->header.stamp.sec = 5, state->header.stamp.nanosec = count * 100000000; // 10 Hz
      state->name.resize(joints), state->position.resize(joints), state->velocity.resize(joints);
      for (size_t i = 0; i < joints; ++i) std::cin >> state->name[i] >> state->position[i] >> state->velocity[i];
      answer_(state);
    }
  }

private:
  std::function<void(State::ConstSharedPtr)> answer_;
};

inline void init(int, char**) {}
inline void spin(const std::shared_ptr<Node>& node) { node->hear(); }
inline void shutdown() {}

} // namespace rclcpp
