// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/camera_file.h"

#include <gtest/gtest.h>
