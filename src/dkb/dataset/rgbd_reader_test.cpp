// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/rgbd_reader.h"

#include <gtest/gtest.h>
