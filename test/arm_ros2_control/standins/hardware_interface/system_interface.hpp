// SPDX-License-Identifier: Apache-2.0
// A stand-in of hardware_interface, written from its documentation: as much as the plugins use.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "rclcpp/logging.hpp"

namespace rclcpp {
struct Time {};
struct Duration {
  Duration(int, unsigned) {}
};
}  // namespace rclcpp

namespace rclcpp_lifecycle {
struct State {};
namespace node_interfaces {
struct LifecycleNodeInterface {
  enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
};
}  // namespace node_interfaces
}  // namespace rclcpp_lifecycle

namespace hardware_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
enum class return_type { OK, ERROR };

struct InterfaceInfo {
  std::string name, min, max, initial_value, data_type;
};

struct ComponentInfo {
  std::string name;
  std::vector<InterfaceInfo> command_interfaces, state_interfaces;
};

struct HardwareInfo {
  std::string name;
  unsigned rw_rate = 0;
  std::unordered_map<std::string, std::string> hardware_parameters;
  std::vector<ComponentInfo> joints, sensors, gpios;
};

struct HardwareComponentInterfaceParams {
  HardwareInfo hardware_info;
};

struct InterfaceDescription {
  InterfaceDescription(const std::string& prefix_, const InterfaceInfo& info) : name(prefix_ + "/" + info.name) {}
  std::string name;
};

class Handle {
public:
  using SharedPtr = std::shared_ptr<Handle>;
  explicit Handle(const InterfaceDescription& described) : name_(described.name) {}
  const std::string& get_name() const { return name_; }
  [[nodiscard]] std::optional<double> get_optional() const { return value_; }
  [[nodiscard]] bool set_value(double value) { return value_ = value, true; }

private:
  std::string name_;
  double value_ = __builtin_nan("");
};
using StateInterface = Handle;
using CommandInterface = Handle;

class SystemInterface {
public:
  virtual ~SystemInterface() = default;
  virtual CallbackReturn on_init(const HardwareComponentInterfaceParams& params) {
    info_ = params.hardware_info;
    for (const auto& joint : info_.joints) {
      for (const auto& state : joint.state_interfaces) add(states_, joint.name, state);
      for (const auto& command : joint.command_interfaces) add(commands_, joint.name, command);
    }
    return CallbackReturn::SUCCESS;
  }
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State&) = 0;
  virtual return_type perform_command_mode_switch(const std::vector<std::string>&, const std::vector<std::string>&) = 0;
  virtual return_type read(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  virtual return_type write(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  bool has_state(const std::string& name) const { return states_.count(name) > 0; }
  bool has_command(const std::string& name) const { return commands_.count(name) > 0; }
  const Handle::SharedPtr& get_state_interface_handle(const std::string& name) const { return states_.at(name); }
  const Handle::SharedPtr& get_command_interface_handle(const std::string& name) const { return commands_.at(name); }
  rclcpp::Logger get_logger() const { return {}; }

protected:
  HardwareInfo info_;

private:
  using Handles = std::map<std::string, Handle::SharedPtr>;
  static void add(Handles& handles, const std::string& joint, const InterfaceInfo& info) {
    const InterfaceDescription described(joint, info);
    handles[described.name] = std::make_shared<Handle>(described);
  }
  Handles states_, commands_;
};

}  // namespace hardware_interface
