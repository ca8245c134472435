// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/tum_dataset.h"

#include <gtest/gtest.h>
