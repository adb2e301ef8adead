// Copyright 2026 The manifold_mpc_ros authors
// SPDX-License-Identifier: Apache-2.0
//
// What docs/embedding.md uses of ros2_control's interface of a controller, declared and no more.
#pragma once

#include <string>
#include <vector>

namespace rclcpp
{
class Time {};
class Duration {};
}

namespace rclcpp_lifecycle
{
class State {};
}

namespace controller_interface
{
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };

struct InterfaceConfiguration
{
  interface_configuration_type type;
  std::vector<std::string> names;
};

struct LoanedInterface
{
  double get_value() const;
  bool set_value(const double & value);
};

class ControllerInterface
{
public:
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual return_type update(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State & previous_state);
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State & previous_state);

protected:
  std::vector<LoanedInterface> command_interfaces_, state_interfaces_;
};
}  // namespace controller_interface
