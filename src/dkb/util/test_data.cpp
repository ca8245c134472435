// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/test_data.h"

#include <cstdlib>

namespace dkb {

std::filesystem::path test_data() {
  const char* folder = std::getenv("DKB_DATA");
  return folder != nullptr && *folder != '\0' ? folder : DKB_TEST_DATA;
}

}  // namespace dkb
