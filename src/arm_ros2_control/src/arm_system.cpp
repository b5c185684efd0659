// SPDX-License-Identifier: Apache-2.0
#include "arm_ros2_control/arm_system.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace arm_ros2_control {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<const char*, 3> kInterfaces{"position", "velocity", "effort"};

/// The part that has a name; the end if there is none.
template <class Parts> auto find_named(const Parts& parts, const std::string& name) {
  return std::find_if(parts.begin(), parts.end(), [&](const auto& p) { return p.name == name; });
}

/// Refuse an interface that joints do not have.
void check_kind(const std::string& joint, const std::string& use, const std::string& kind) {
  if (std::find(kInterfaces.begin(), kInterfaces.end(), kind) == kInterfaces.end())
    throw std::runtime_error("joint '" + joint + "': " + use + " interface '" + kind
                             + "'; position, velocity and effort are allowed");
}

/// A number that a text gives and nothing else.
double parse_number(const std::string& joint, const char* quantity, const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end || !std::isfinite(value))
    throw std::runtime_error("joint '" + joint + "': " + quantity + " '" + text + "'; a finite number is expected");
  return value;
}

/// A parameter of the hardware, or a default.
std::string parameter(const hardware_interface::HardwareInfo& info, const std::string& name, const std::string& otherwise) {
  const auto entry = info.hardware_parameters.find(name);
  return entry == info.hardware_parameters.end() ? otherwise : entry->second;
}

}  // namespace

ArmSystem::CallbackReturn ArmSystem::on_init(const hardware_interface::HardwareComponentInterfaceParams& params) {
  if (SystemInterface::on_init(params) != CallbackReturn::SUCCESS) return CallbackReturn::ERROR;
  try {
    arm_ = std::make_unique<ExportedArm>(parameter(info_, "library", ""));
    check_joints();
    choose_ticks();
    choose_hold();
  } catch (const std::exception& error) {
    RCLCPP_FATAL(get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  const std::size_t n = arm_->joints().size();
  joints_.assign(n, Joint());
  for (auto& row : state_) row.assign(n, 0.0);
  command_.assign(n, 0.0);
  return CallbackReturn::SUCCESS;
}

/// Compare the joints of the description with those of the library, which has nothing else.
void ArmSystem::check_joints() const {
  for (const auto* others : {&info_.sensors, &info_.gpios})
    for (const auto& other : *others)
      throw std::runtime_error("'" + other.name + "': the library has no sensors and no inputs or outputs besides its joints");
  const auto& joints = arm_->joints();
  for (const auto& joint : info_.joints) {
    if (std::find(joints.begin(), joints.end(), joint.name) == joints.end())
      throw std::runtime_error("joint '" + joint.name + "' is not one of the library");
    for (const auto& state : joint.state_interfaces) check_kind(joint.name, "state", state.name);
    for (const auto& command : joint.command_interfaces) {
      check_kind(joint.name, "command", command.name);
      if (command.name != kInterfaces[kEffort] && !arm_->has_servos())
        throw std::runtime_error("joint '" + joint.name + "': command interface '" + command.name
                                 + "' needs a library exported by ./arm export --servo");
    }
  }
  for (const auto& joint : joints)
    if (find_named(info_.joints, joint) == info_.joints.end())
      throw std::runtime_error("joint '" + joint + "' of the library is not described");
}

/// Choose the number of ticks in a period; at an unknown rate, a period is one tick.
void ArmSystem::choose_ticks() {
  if (info_.rw_rate == 0) return;
  const double ticks = 1.0 / (info_.rw_rate * arm_->period());
  ticks_ = static_cast<int>(std::lround(ticks));
  if (ticks_ < 1 || std::abs(ticks - ticks_) > 1e-6) // beyond rounding
    throw std::runtime_error("the rate is " + std::to_string(info_.rw_rate) + " Hz; a period of one or more ticks of "
                             + std::to_string(arm_->period()) + " s is expected");
}

/// Choose whether joints without a command stay where they are.
void ArmSystem::choose_hold() {
  const std::string hold = parameter(info_, "hold", arm_->has_servos() ? "true" : "false");
  if (hold != "true" && hold != "false") throw std::runtime_error("hold = '" + hold + "'; true and false are allowed");
  if (hold == "true" && !arm_->has_servos())
    throw std::runtime_error("hold = 'true' needs a library exported by ./arm export --servo");
  hold_ = hold == "true";
}

ArmSystem::CallbackReturn ArmSystem::on_configure(const rclcpp_lifecycle::State&) {
  find_interfaces();
  try {
    begin();
  } catch (const std::exception& error) {
    RCLCPP_FATAL(get_logger(), "initial_value: %s", error.what());
    return CallbackReturn::ERROR;
  }
  return read(rclcpp::Time(), rclcpp::Duration(0, 0)) == return_type::OK ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
}

/// Keep the interfaces, so that no name is looked up in the loop.
void ArmSystem::find_interfaces() {
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const auto& described = *find_named(info_.joints, arm_->joints()[i]);
    Joint& joint = joints_[i];
    for (int kind = 0; kind < kKinds; ++kind) {
      joint.names[kind] = described.name + "/" + kInterfaces[kind];
      if (has_state(joint.names[kind])) joint.states[kind] = get_state_interface_handle(joint.names[kind]);
      if (has_command(joint.names[kind])) joint.commands[kind] = get_command_interface_handle(joint.names[kind]);
    }
  }
}

/// Begin where the description says, else where the scene does, without commands.
void ArmSystem::begin() {
  for (auto& row : reference_) row.assign(joints_.size(), kNone);
  int code = arm_->begin(nullptr, nullptr);
  arm_->state(state_[kPosition].data(), state_[kVelocity].data(), state_[kEffort].data());
  bool has_start = false;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const auto& described = *find_named(info_.joints, arm_->joints()[i]);
    for (int kind : {kPosition, kVelocity}) {
      const auto interface = find_named(described.state_interfaces, kInterfaces[kind]);
      if (interface == described.state_interfaces.end() || interface->initial_value.empty()) continue;
      state_[kind][i] = parse_number(described.name, kInterfaces[kind], interface->initial_value);
      has_start = true;
    }
    joints_[i].is_holding = false;
    joints_[i].last_command = kNone;
  }
  if (has_start && !code) code = arm_->begin(state_[kPosition].data(), state_[kVelocity].data());
  for (std::size_t i = 0; i < joints_.size() && code; ++i) {
    const auto [lower, upper] = arm_->range(i);
    if (const double q = state_[kPosition][i]; q < lower || q > upper)
      RCLCPP_FATAL(get_logger(), "joint '%s': position %g; %g to %g is allowed", arm_->joints()[i].c_str(), q, lower, upper);
  }
  if (code) throw std::runtime_error(arm_->text(code));
}

ArmSystem::return_type ArmSystem::perform_command_mode_switch(const std::vector<std::string>& start,
                                                              const std::vector<std::string>& stop) {
  for (Joint& joint : joints_)
    for (int kind = 0; kind < kKinds; ++kind) {
      const auto& name = joint.names[kind];
      if (std::find(stop.begin(), stop.end(), name) != stop.end()) joint.is_commanded[kind] = false;
      if (std::find(start.begin(), start.end(), name) != start.end()) joint.is_commanded[kind] = true;
    }
  return return_type::OK;
}

ArmSystem::return_type ArmSystem::read(const rclcpp::Time&, const rclcpp::Duration&) {
  arm_->state(state_[kPosition].data(), state_[kVelocity].data(), state_[kEffort].data());
  for (std::size_t i = 0; i < joints_.size(); ++i)
    for (int kind = 0; kind < kKinds; ++kind)
      if (const State& state = joints_[i].states[kind]) std::ignore = state->set_value(state_[kind][i]);
  return return_type::OK;
}

/// Read the commands of a joint into the reference; false, with a message, if one is infinite. A position without a velocity
/// has that of the stream of positions, as in `Simulator`; without any command the joint stays where it is.
bool ArmSystem::follow(std::size_t i) {
  Joint& joint = joints_[i];
  std::array<double, kKinds> value{kNone, kNone, kNone};
  for (int kind = 0; kind < kKinds; ++kind)
    if (joint.is_commanded[kind] && joint.commands[kind])
      value[kind] = joint.commands[kind]->get_optional().value_or(reference_[kind][i]);
  for (int kind = 0; kind < kKinds; ++kind)
    if (std::isinf(value[kind])) {
      RCLCPP_ERROR(get_logger(), "joint '%s': %s command %g; a finite number is expected, or NaN for none",
                   arm_->joints()[i].c_str(), kInterfaces[kind], value[kind]);
      return false;
    }
  const bool is_commanded = std::any_of(value.begin(), value.end(), [](double x) { return !std::isnan(x); });
  if (!is_commanded && hold_) {
    if (!joint.is_holding) joint.held_position = state_[kPosition][i];
    value[kPosition] = joint.held_position;
    value[kVelocity] = 0.0;
  }
  joint.is_holding = !is_commanded && hold_;
  const double moved = value[kPosition] - joint.last_command;
  joint.last_command = is_commanded ? value[kPosition] : kNone;
  if (std::isnan(value[kVelocity]) && !std::isnan(value[kPosition]))
    value[kVelocity] = std::isnan(moved) ? 0.0 : moved / (ticks_ * arm_->period());
  for (int kind = 0; kind < kKinds; ++kind) reference_[kind][i] = value[kind];
  return true;
}

ArmSystem::return_type ArmSystem::write(const rclcpp::Time&, const rclcpp::Duration&) {
  bool is_tracking = false; // whether a servo has something to track
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    if (!follow(i)) return return_type::ERROR;
    is_tracking |= !std::isnan(reference_[kPosition][i]) || !std::isnan(reference_[kVelocity][i]);
  }
  for (std::size_t i = 0; i < joints_.size() && !is_tracking; ++i)
    command_[i] = std::isnan(reference_[kEffort][i]) ? 0.0 : reference_[kEffort][i];
  for (int tick = 0; tick < ticks_; ++tick) {
    if (is_tracking)
      arm_->servo(reference_[kPosition].data(), reference_[kVelocity].data(), reference_[kEffort].data(), command_.data());
    if (const int code = arm_->step(command_.data())) {
      RCLCPP_ERROR(get_logger(), "%s", arm_->text(code));
      return return_type::ERROR;
    }
  }
  return return_type::OK;
}

}  // namespace arm_ros2_control

PLUGINLIB_EXPORT_CLASS(arm_ros2_control::ArmSystem, hardware_interface::SystemInterface)
