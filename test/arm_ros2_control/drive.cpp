// SPDX-License-Identifier: Apache-2.0
// Drives the plugins as controller_manager does, on stand-ins of its interfaces.
//
//   drive LIBRARY RATE KIND[,KIND…] [INITIAL] < COMMANDS
//
// KIND: position, velocity, effort, `sensor` to describe one as well, or `controller` for references of the
// computed-torque controller. INITIAL: position of the last joint at the beginning. COMMANDS: for each period, for each kind, a number for each joint. Prints positions,
// velocities and efforts after each period, in hexadecimal. Fails if anything is allocated, or waits for a lock, within a period.
#include <dlfcn.h>
#include <pthread.h>

#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <sstream>

#include "arm_ros2_control/arm_system.hpp"
#include "arm_ros2_control/computed_torque_controller.hpp"

namespace {

using hardware_interface::CallbackReturn;
using hardware_interface::Handle;

long allocated = 0, locked = 0;

void demand(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "%s failed\n", what);
  std::exit(1);
}

hardware_interface::HardwareInfo described(const std::string& library, unsigned rate, const std::vector<std::string>& kinds,
                                           const char* initial) {
  hardware_interface::HardwareInfo info;
  info.name = "arm";
  info.rw_rate = rate;
  info.hardware_parameters["library"] = library;
  const arm_ros2_control::ExportedArm arm(library);
  for (const auto& name : arm.joints()) {
    hardware_interface::ComponentInfo joint;
    joint.name = name;
    for (const auto& kind : kinds) joint.command_interfaces.push_back({kind, "", "", "", ""});
    for (const char* kind : {"position", "velocity", "effort"}) joint.state_interfaces.push_back({kind, "", "", "", ""});
    info.joints.insert(info.joints.begin(), joint); // in another order than the library's
  }
  if (initial) info.joints[0].state_interfaces[0].initial_value = initial;
  if (kinds.back() == "sensor") {
    info.sensors.emplace_back();
    info.sensors.back().name = "wrist";
  }
  return info;
}

} // namespace

// Functions of the C library, which count how often they are called, as those that allocate by them do.
extern "C" {
void* __libc_malloc(std::size_t size);
void* malloc(std::size_t size) noexcept {
  ++allocated;
  return __libc_malloc(size);
}

#define COUNTED(function, type) \
  int function(type* lock) noexcept { \
    ++locked; \
    static const auto plain = reinterpret_cast<int (*)(type*)>(dlsym(RTLD_NEXT, #function)); \
    return plain(lock); \
  }
COUNTED(pthread_mutex_lock, pthread_mutex_t)
COUNTED(pthread_rwlock_rdlock, pthread_rwlock_t)
COUNTED(pthread_rwlock_wrlock, pthread_rwlock_t)
}

int main(int count, char** arguments) {
  const std::string library = arguments[1];
  std::vector<std::string> kinds, names;
  std::istringstream given(arguments[3]);
  for (std::string kind; std::getline(given, kind, ',');) kinds.push_back(kind);
  const bool controlled = kinds[0] == "controller";
  if (controlled) kinds = {"effort"};

  arm_ros2_control::ArmSystem system;
  hardware_interface::HardwareComponentInterfaceParams params;
  params.hardware_info = described(library, std::atoi(arguments[2]), kinds, count > 4 ? arguments[4] : nullptr);
  demand(system.on_init(params) == CallbackReturn::SUCCESS, "on_init");
  demand(system.on_configure({}) == CallbackReturn::SUCCESS, "on_configure");
  const auto joints = arm_ros2_control::ExportedArm(library).joints();
  for (const auto& kind : kinds)
    for (const auto& joint : joints) names.push_back(joint + "/" + kind);
  system.perform_command_mode_switch(names, {"another/effort"});

  std::vector<Handle::SharedPtr> commands, states;
  for (const auto& name : names) commands.push_back(system.get_command_interface_handle(name));
  for (const char* kind : {"position", "velocity", "effort"})
    for (const auto& joint : joints) states.push_back(system.get_state_interface_handle(joint + "/" + kind));

  arm_ros2_control::ComputedTorqueController controller;
  if (controlled) {
    demand(controller.on_init() == CallbackReturn::SUCCESS, "on_init");
    controller.get_node()->parameters["library"].value = library;
    demand(controller.on_configure({}) == CallbackReturn::SUCCESS, "on_configure");
    for (const auto& name : controller.command_interface_configuration().names)
      controller.command_interfaces_.emplace_back(system.get_command_interface_handle(name));
    for (const auto& name : controller.state_interface_configuration().names)
      controller.state_interfaces_.emplace_back(system.get_state_interface_handle(name));
    commands = controller.export_reference_interfaces();
    demand(controller.on_activate({}) == CallbackReturn::SUCCESS, "on_activate");
  }

  const rclcpp::Time time;
  const rclcpp::Duration period(0, 0);
  std::vector<double> row(commands.size());
  for (;;) {
    for (double& number : row) {
      std::string text;
      if (!(std::cin >> text)) return 0;
      number = std::strtod(text.c_str(), nullptr);
    }
    const long before[] = {allocated, locked};
    bool fine = system.read(time, period) == hardware_interface::return_type::OK;
    for (std::size_t k = 0; k < row.size(); ++k) fine &= commands[k]->set_value(row[k]);
    if (controlled) fine &= controller.update(time, period) == hardware_interface::return_type::OK;
    fine &= system.write(time, period) == hardware_interface::return_type::OK;
    fine &= system.read(time, period) == hardware_interface::return_type::OK;
    demand(fine, "a period");
    demand(allocated == before[0], "not to allocate");
    demand(locked == before[1], "not to wait for a lock");
    for (const auto& state : states) std::printf("%a ", state->get_optional().value());
    std::printf("\n");
  }
}
