// SPDX-License-Identifier: Apache-2.0
// ROS 1's package compiles these headers as C++17 (types.h). This tells where ROS 1 is not installed.
#include "messages.h"
#include "ros_core.h"

static_assert(__cplusplus < 202002L);
