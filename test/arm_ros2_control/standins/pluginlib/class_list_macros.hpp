// SPDX-License-Identifier: Apache-2.0
// A stand-in of pluginlib, which registers nothing: it checks that a plugin can be made and is of its base class.
#pragma once

#include <type_traits>

#define PLUGINLIB_EXPORT_CLASS(plugin, base) \
  static_assert(std::is_base_of_v<base, plugin> && std::is_default_constructible_v<plugin>);
