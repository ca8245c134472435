// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_file.h"

#include <gtest/gtest.h>
