// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "arm_ros2_control/exported_arm.hpp"
#include "hardware_interface/system_interface.hpp"

namespace arm_ros2_control {

/// A simulated arm as hardware of ros2_control. `write` advances it by exactly one period, whatever
/// the clock says, so the same commands give the same motion.
///
/// Parameters in the URDF's `<ros2_control>` tag:
///   - `library`: the shared library of `./arm export SCENE --tick` or `--servo`;
///   - `hold`: whether joints without a command stay where they are; `true` with servos, which
///     this needs, else `false`.
/// Every joint of the library is expected, with the state interfaces `position`, `velocity`,
/// `effort` and the command interfaces `effort` and, with servos, `position` and `velocity`. The
/// `initial_value` of states says where it begins, by default where the scene does.
class ArmSystem : public hardware_interface::SystemInterface {
public:
  using CallbackReturn = hardware_interface::CallbackReturn;
  using return_type = hardware_interface::return_type;

  /// Load the library, and compare the joints of the description with its joints.
  CallbackReturn on_init(const hardware_interface::HardwareComponentInterfaceParams& params) override;

  /// Begin anew.
  CallbackReturn on_configure(const rclcpp_lifecycle::State& previous) override;

  /// Note which commands are given from now on, and which no longer.
  return_type perform_command_mode_switch(const std::vector<std::string>& start,
                                          const std::vector<std::string>& stop) override;

  /// Publish the state.
  return_type read(const rclcpp::Time& time, const rclcpp::Duration& period) override;

  /// Advance by one period under the commands.
  return_type write(const rclcpp::Time& time, const rclcpp::Duration& period) override;

private:
  enum Kind { kPosition, kVelocity, kEffort, kKinds };
  using State = hardware_interface::StateInterface::SharedPtr;
  using Command = hardware_interface::CommandInterface::SharedPtr;

  /// A joint: its interfaces, null where there are none, and the reference of its servo.
  struct Joint {
    std::array<std::string, kKinds> names;
    std::array<State, kKinds> states;
    std::array<Command, kKinds> commands;
    std::array<bool, kKinds> is_commanded{};
    bool is_holding = false;   // whether it has no command and stays at `held_position`
    double held_position = 0.0; // in [rad] or [m]
    double last_command = 0.0; // position commanded in the period before, NaN for none
  };

  void check_joints() const;
  void choose_ticks();
  void choose_hold();
  void find_interfaces();
  void begin();
  bool follow(std::size_t i);

  std::unique_ptr<ExportedArm> arm_;
  std::vector<Joint> joints_;
  std::array<std::vector<double>, kKinds> state_, reference_;  // by kind, then by joint
  std::vector<double> command_;
  int ticks_ = 1;  // in a period
  bool hold_ = false;
};

}  // namespace arm_ros2_control
