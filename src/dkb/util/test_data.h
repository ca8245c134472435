// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace dkb {

// The folder of real sequences and models that no test may need: the environment variable DKB_DATA, else CMake's cache
// variable of that name. Tests that do not find there what they want say "skipped: ...".
std::filesystem::path test_data();

}  // namespace dkb
