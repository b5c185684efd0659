// SPDX-License-Identifier: Apache-2.0
#include "arm_ros2_control/computed_torque_controller.hpp"

#include <cmath>
#include <complex>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace arm_ros2_control {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
/// Names of the reference interfaces, in the order of `Kind`.
constexpr std::array<const char*, 3> kReferences{"position", "velocity", "acceleration"};

using Configuration = controller_interface::InterfaceConfiguration;

/// Some interfaces of every joint.
Configuration of_all(const std::vector<std::string>& joints, std::initializer_list<const char*> interfaces) {
  Configuration configuration{controller_interface::interface_configuration_type::INDIVIDUAL, {}};
  for (const char* interface : interfaces)
    for (const auto& joint : joints) configuration.names.push_back(joint + "/" + interface);
  return configuration;
}

}  // namespace

ComputedTorqueController::CallbackReturn ComputedTorqueController::on_init() {
  auto_declare<std::string>("library", "");
  auto_declare<double>("bandwidth", 50.0);
  auto_declare<double>("damping_ratio", 1.0);
  return CallbackReturn::SUCCESS;
}

Configuration ComputedTorqueController::command_interface_configuration() const { return of_all(arm_->joints(), {"effort"}); }

Configuration ComputedTorqueController::state_interface_configuration() const {
  return of_all(arm_->joints(), {"position", "velocity"});
}

ComputedTorqueController::CallbackReturn ComputedTorqueController::on_configure(const rclcpp_lifecycle::State&) {
  try {
    arm_ = std::make_unique<ExportedArm>(get_node()->get_parameter("library").as_string());
    if (!arm_->computed_torque()) throw std::runtime_error("the library has no computed torque; export the scene again");
    for (auto* row : {&q_, &v_, &q_d_, &v_d_, &a_d_, &tau_}) row->assign(arm_->joints().size(), 0.0);
    choose_gains(get_node()->get_parameter("bandwidth").as_double(), get_node()->get_parameter("damping_ratio").as_double());
  } catch (const std::exception& error) {
    RCLCPP_FATAL(get_node()->get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

/// Gains with which the error falls by z = exp(λ dt) in a period dt, where λ² + 2 ζ ω λ + ω² = 0.
void ComputedTorqueController::choose_gains(double bandwidth, double damping_ratio) {
  const double damped = damping_ratio * bandwidth;
  if (!(bandwidth > 0.0) || !(damping_ratio > 0.0) || !std::isfinite(damped))
    throw std::runtime_error("bandwidth = " + std::to_string(bandwidth) + ", damping_ratio = " + std::to_string(damping_ratio)
                             + "; positive numbers are expected");
  period_ = 1.0 / get_update_rate();
  const auto root = std::sqrt(std::complex<double>(damped * damped - bandwidth * bandwidth));
  const auto first = std::exp((root - damped) * period_), second = std::exp(-(root + damped) * period_);
  kp_.assign(q_.size(), ((1.0 - first) * (1.0 - second)).real() / (period_ * period_));
  kd_.assign(q_.size(), (3.0 - first - second - first * second).real() / (2.0 * period_));
}

std::vector<hardware_interface::CommandInterface::SharedPtr> ComputedTorqueController::on_export_reference_interfaces_list() {
  std::vector<hardware_interface::CommandInterface::SharedPtr> interfaces;
  for (const char* kind : kReferences)
    for (const auto& joint : arm_->joints()) {
      hardware_interface::InterfaceInfo info{};
      info.name = kind;
      info.data_type = "double";
      const hardware_interface::InterfaceDescription described(std::string(get_node()->get_name()) + "/" + joint, info);
      interfaces.push_back(std::make_shared<hardware_interface::CommandInterface>(described));
    }
  return interfaces;
}

ComputedTorqueController::CallbackReturn ComputedTorqueController::on_activate(const rclcpp_lifecycle::State&) {
  read_state();
  q_d_ = q_;
  for (const auto& interface : ordered_exported_reference_interfaces_) std::ignore = interface->set_value(kNone);
  return CallbackReturn::SUCCESS;
}

void ComputedTorqueController::read_state() {
  const std::size_t n = arm_->joints().size();
  for (std::size_t i = 0; i < n; ++i) {
    q_[i] = state_interfaces_[i].get_optional().value_or(q_[i]);
    v_[i] = state_interfaces_[n + i].get_optional().value_or(v_[i]);
  }
}

/// A number of the reference; NaN for none.
double ComputedTorqueController::reference(Kind kind, std::size_t joint) const {
  const std::size_t index = kind * arm_->joints().size() + joint;
  if (!is_in_chained_mode()) return kNone;
  return ordered_exported_reference_interfaces_[index]->get_optional().value_or(kNone);
}

/// References come through interfaces alone.
ComputedTorqueController::return_type ComputedTorqueController::update_reference_from_subscribers(const rclcpp::Time&,
                                                                                                  const rclcpp::Duration&) {
  return return_type::OK;
}

/// An error that names the joint for whose reference there is no torque.
ComputedTorqueController::return_type ComputedTorqueController::refuse(std::size_t i) const {
  RCLCPP_ERROR(get_node()->get_logger(),
               "joint '%s': position %g, velocity %g and acceleration %g are commanded; finite numbers are expected that lead "
               "to a finite effort, or NaN for none",
               arm_->joints()[i].c_str(), reference(kPosition, i), reference(kVelocity, i), reference(kAcceleration, i));
  return return_type::ERROR;
}

ComputedTorqueController::return_type ComputedTorqueController::update_and_write_commands(const rclcpp::Time&,
                                                                                          const rclcpp::Duration&) {
  read_state();
  const auto or_zero = [](double x) { return std::isnan(x) ? 0.0 : x; };
  for (std::size_t i = 0; i < q_.size(); ++i) {
    if (const double q = reference(kPosition, i); !std::isnan(q)) q_d_[i] = q;
    v_d_[i] = or_zero(reference(kVelocity, i));
    a_d_[i] = or_zero(reference(kAcceleration, i));
    if (!std::isfinite(q_d_[i]) || !std::isfinite(v_d_[i]) || !std::isfinite(a_d_[i])) return refuse(i);
  }
  arm_->computed_torque()(q_.data(), v_.data(), q_d_.data(), v_d_.data(), a_d_.data(), kp_.data(), kd_.data(), &period_,
                          tau_.data());
  for (std::size_t i = 0; i < q_.size(); ++i)
    if (!std::isfinite(tau_[i])) return refuse(i);
  bool written = true;
  for (std::size_t i = 0; i < q_.size(); ++i) written &= command_interfaces_[i].set_value(tau_[i]);
  return written ? return_type::OK : return_type::ERROR;
}

}  // namespace arm_ros2_control

PLUGINLIB_EXPORT_CLASS(arm_ros2_control::ComputedTorqueController, controller_interface::ChainableControllerInterface)
