// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "arm_ros2_control/exported_arm.hpp"
#include "controller_interface/chainable_controller_interface.hpp"

namespace arm_ros2_control {

/// Torques by which an arm follows a motion: τ = M(q) a + C(q, v) v + G(q) + F(v) with
/// a = a_d + K_d (v_d - v) + K_p (q_d - q) (Craig, Introduction to Robotics, section 10.4), in the
/// middle of the period for which they are held, and with gains whose error, seen once a period,
/// falls as ë + 2 ζ ω ė + ω² e = 0 says (Åström and Wittenmark, Computer-Controlled Systems,
/// section 4.3).
///
/// Another controller, such as joint_trajectory_controller, commands its reference interfaces
/// `JOINT/position`, `JOINT/velocity` and `JOINT/acceleration`. Without one it holds the arm where
/// it was when it was activated. Parameters:
///   - `library`: the shared library of `./arm export SCENE --tick`, whose joints are all needed;
///   - `bandwidth`: ω in [rad/s], 50 by default;
///   - `damping_ratio`: ζ, 1 by default.
class ComputedTorqueController : public controller_interface::ChainableControllerInterface {
public:
  using CallbackReturn = controller_interface::CallbackReturn;
  using return_type = controller_interface::return_type;
  using Configuration = controller_interface::InterfaceConfiguration;

  /// Declare the parameters.
  CallbackReturn on_init() override;

  /// Efforts of all joints.
  Configuration command_interface_configuration() const override;

  /// Positions and velocities of all joints.
  Configuration state_interface_configuration() const override;

  /// Load the library, and compute the gains.
  CallbackReturn on_configure(const rclcpp_lifecycle::State& previous) override;

  /// Hold the arm where it is until there is another reference.
  CallbackReturn on_activate(const rclcpp_lifecycle::State& previous) override;

protected:
  std::vector<hardware_interface::CommandInterface::SharedPtr> on_export_reference_interfaces_list() override;
  return_type update_reference_from_subscribers(const rclcpp::Time& time, const rclcpp::Duration& period) override;
  return_type update_and_write_commands(const rclcpp::Time& time, const rclcpp::Duration& period) override;

private:
  enum Kind { kPosition, kVelocity, kAcceleration };

  void choose_gains(double bandwidth, double damping_ratio);
  void read_state();
  double reference(Kind kind, std::size_t joint) const;
  return_type refuse(std::size_t i) const;

  std::unique_ptr<ExportedArm> arm_;
  std::vector<double> q_, v_, q_d_, v_d_, a_d_, kp_, kd_, tau_; // of all joints; gains in [1/s²] and [1/s]
  double period_ = 0.0;                                         // [s]
};

}  // namespace arm_ros2_control
