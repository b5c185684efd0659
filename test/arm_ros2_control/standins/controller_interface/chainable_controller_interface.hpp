// SPDX-License-Identifier: Apache-2.0
// A stand-in of controller_interface, written from its documentation: as much as the plugins use.
#pragma once

#include <any>

#include "hardware_interface/system_interface.hpp"

namespace controller_interface {

using CallbackReturn = hardware_interface::CallbackReturn;
using hardware_interface::return_type;
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names;
};

struct Parameter {
  std::any value;
  double as_double() const { return std::any_cast<double>(value); }
  std::string as_string() const { return std::any_cast<std::string>(value); }
};

struct Node {
  std::map<std::string, Parameter> parameters;
  const char* get_name() const { return "controller"; }
  rclcpp::Logger get_logger() const { return {}; }
  Parameter get_parameter(const std::string& name) const { return parameters.at(name); }
};

/// An interface that is lent to a controller.
class Loaned {
public:
  explicit Loaned(hardware_interface::Handle::SharedPtr handle) : handle_(std::move(handle)) {}
  [[nodiscard]] std::optional<double> get_optional() const { return handle_->get_optional(); }
  [[nodiscard]] bool set_value(double value) { return handle_->set_value(value); }

private:
  hardware_interface::Handle::SharedPtr handle_;
};

class ChainableControllerInterface {
public:
  virtual ~ChainableControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State&) = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State&) = 0;

  const std::vector<hardware_interface::Handle::SharedPtr>& export_reference_interfaces() {
    ordered_exported_reference_interfaces_ = on_export_reference_interfaces_list();
    chained_ = true;
    return ordered_exported_reference_interfaces_;
  }
  return_type update(const rclcpp::Time& time, const rclcpp::Duration& period) {
    if (!chained_) update_reference_from_subscribers(time, period);
    return update_and_write_commands(time, period);
  }
  bool is_in_chained_mode() const { return chained_; }
  unsigned get_update_rate() const { return 1000; }
  std::shared_ptr<Node> get_node() const { return node_; }
  std::vector<Loaned> command_interfaces_, state_interfaces_;

protected:
  template <class Value> void auto_declare(const std::string& name, const Value& otherwise) {
    node_->parameters.insert({name, Parameter{otherwise}});
  }
  virtual std::vector<hardware_interface::CommandInterface::SharedPtr> on_export_reference_interfaces_list() = 0;
  virtual return_type update_reference_from_subscribers(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  virtual return_type update_and_write_commands(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  std::vector<hardware_interface::Handle::SharedPtr> ordered_exported_reference_interfaces_;

private:
  std::shared_ptr<Node> node_ = std::make_shared<Node>();
  bool chained_ = false;
};

}  // namespace controller_interface
