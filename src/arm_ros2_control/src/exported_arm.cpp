// SPDX-License-Identifier: Apache-2.0
#include "arm_ros2_control/exported_arm.hpp"

#include <dlfcn.h>

#include <new>
#include <stdexcept>

namespace arm_ros2_control {

namespace {

constexpr std::align_val_t kAligned{64};

/// NAME of a file `…/libNAME.so`.
std::string name_of(const std::string& path) {
  const std::size_t begin = path.rfind('/') + 1, end = path.rfind(".so");
  const std::string file = path.substr(begin);
  if (file.rfind("lib", 0) != 0 || end == std::string::npos || end < begin + 4)
    throw std::runtime_error("library = '" + path + "'; a file called libNAME.so is expected");
  return path.substr(begin + 3, end - begin - 3);
}

}  // namespace

void ExportedArm::Close::operator()(void* library) const noexcept { dlclose(library); }

void ExportedArm::Free::operator()(Simulation* memory) const noexcept { ::operator delete(memory, kAligned); }

template <class Function> void ExportedArm::find(Function*& function, const char* suffix, bool is_required) {
  const std::string symbol = name_ + "_" + suffix;
  function = reinterpret_cast<Function*>(dlsym(library_.get(), symbol.c_str()));
  if (!function && is_required)
    throw std::runtime_error("library = '" + path_ + "' has no " + symbol + "; export it again with ./arm export --tick");
}

ExportedArm::ExportedArm(const std::string& path) : path_(path), name_(name_of(path)) {
  library_.reset(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL));
  if (!library_) throw std::runtime_error("library = '" + path + "': " + dlerror());
  std::size_t (*size)() = nullptr;
  int (*count)() = nullptr;
  double (*period)() = nullptr;
  void (*range)(double*, double*) = nullptr;
  const char* const* names = nullptr;
  find(size, "sim_size");
  find(count, "sim_joints");
  find(period, "sim_period");
  find(range, "sim_range");
  find(names, "joint_names");
  find(init_, "sim_init");
  find(step_, "sim_step");
  find(state_, "sim_state");
  find(error_text_, "error_text");
  find(servo_, "sim_servo", false);
  find(computed_torque_, "computed_torque", false);
  joints_.assign(names, names + count());
  period_ = period();
  lower_.resize(joints_.size());
  upper_.resize(joints_.size());
  range(lower_.data(), upper_.data());
  memory_.reset(static_cast<Simulation*>(::operator new(size(), kAligned)));
}

}  // namespace arm_ros2_control
