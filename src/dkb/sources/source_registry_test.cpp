// SPDX-License-Identifier: Apache-2.0
#include "dkb/sources/source_registry.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

TEST(SourceRegistry, KindsHaveNamesOfTheirOwn) {
  const std::vector<SourceKind> kinds = source_kinds();
  for (size_t i = 0; i < kinds.size(); ++i)
    for (size_t j = 0; j < i; ++j) EXPECT_NE(kinds[i].name, kinds[j].name);
}

TEST(SourceRegistry, WhatIsNotThereIsNamed) {
  try {
    open_source("/no/such/folder");
    FAIL() << "it was opened";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("/no/such/folder: no such folder"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace dkb
