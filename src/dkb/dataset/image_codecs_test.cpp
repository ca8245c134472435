// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/image_codecs.h"

#include <gtest/gtest.h>
