// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace arm_ros2_control {

/// A shared library made of a scene by `./arm export SCENE --tick`, loaded at run time, and one
/// simulation of its arm. What is `noexcept` allocates nothing and takes no lock.
class ExportedArm {
public:
  /// Load a library.
  ///
  /// @param path The file, `libNAME.so` for a library called NAME.
  /// @throws std::runtime_error if it cannot be loaded, or was exported without its tick.
  explicit ExportedArm(const std::string& path);

  /// Names of the n joints, the order of all vectors, which have n numbers: positions in [rad] or [m], and so on.
  const std::vector<std::string>& joints() const noexcept { return joints_; }

  /// Length of a tick in [s].
  double period() const noexcept { return period_; }

  /// Positions in [rad] or [m] between which a joint can be; infinite where nothing stops it.
  std::pair<double, double> range(std::size_t joint) const noexcept { return {lower_[joint], upper_[joint]}; }

  /// Whether there are servos, which track positions and velocities.
  bool has_servos() const noexcept { return servo_ != nullptr; }

  /// Torques or forces `tau` of the joints at q, v to follow a motion q_d, v_d, a_d, held for a time `*dt` in [s], with
  /// gains kp in [1/s²] and kd in [1/s].
  using ComputedTorque = void(const double* q, const double* v, const double* q_d, const double* v_d, const double* a_d,
                              const double* kp, const double* kd, const double* dt, double* tau);

  /// Computed torque; null if there is none.
  ComputedTorque* computed_torque() const noexcept { return computed_torque_; }

  /// Begin at positions and velocities; null: those of the scene. Returns 0, or a code of `text`. Comes before all below.
  int begin(const double* q, const double* v) noexcept { return init_(memory_.get(), q, v); }

  /// Advance by a tick under commands of the drives, in their units. Returns 0, or a code: then the state is kept.
  int step(const double* command) noexcept { return step_(memory_.get(), command); }

  /// Commands with which the servos track positions and velocities, NaN where there are none; only if `has_servos`.
  void servo(const double* position, const double* velocity, const double* effort, double* command) const noexcept {
    servo_(memory_.get(), position, velocity, effort, command);
  }

  /// The state, and the torques or forces of the last tick on the joints.
  void state(double* q, double* v, double* effort) const noexcept { state_(memory_.get(), q, v, effort); }

  /// What a code means.
  const char* text(int code) const noexcept { return error_text_(code); }

private:
  struct Simulation;
  struct Close {
    void operator()(void* library) const noexcept;
  };
  struct Free {
    void operator()(Simulation* memory) const noexcept;
  };

  /// The function `NAME_what`; null if there is none and it is not required.
  template <class Function> void find(Function*& function, const char* suffix, bool is_required = true);

  std::string path_, name_;
  std::unique_ptr<void, Close> library_;
  int (*init_)(Simulation*, const double*, const double*) = nullptr;
  int (*step_)(Simulation*, const double*) = nullptr;
  void (*state_)(const Simulation*, double*, double*, double*) = nullptr;
  void (*servo_)(const Simulation*, const double*, const double*, const double*, double*) = nullptr;
  ComputedTorque* computed_torque_ = nullptr;
  const char* (*error_text_)(int) = nullptr;
  std::unique_ptr<Simulation, Free> memory_;
  std::vector<std::string> joints_;
  std::vector<double> lower_, upper_;
  double period_ = 0.0;
};

}  // namespace arm_ros2_control
