// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_source.h"

#include <gtest/gtest.h>
namespace dkb {
namespace {
TEST(RecordedSource, Exists) {}
}  // namespace
}  // namespace dkb
