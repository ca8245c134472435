// SPDX-License-Identifier: Apache-2.0
#include "dkb/sources/source_registry.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

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

TEST(SourceRegistry, LiveDevicesAreKnownByTheirScheme) {
  for (const char* where : {"fake:folder", "v4l2:0,1", "openni2", "openni2:uri", "realsense:12", "orbbec"})
    EXPECT_TRUE(is_live(where)) << where;
  for (const char* where : {"folder", "openni2.oni", "fake", "a.bag", "/data/realsense"})
    EXPECT_EQ(is_live(where), std::string(where) == "fake") << where;
}

TEST(SourceRegistry, ACameraThatIsNotBuiltInIsNamedWithTheRemedy) {
  for (const SourceKind& kind : source_kinds()) {
    if (kind.why_not().empty()) continue;
    try {
      open_source(kind.name + ":1");
      FAIL() << "it was opened";
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()), kind.name + ":1: " + kind.why_not());
      EXPECT_NE(kind.why_not().find("build again"), std::string::npos);
    }
  }
}

const SourceKind& kind_of(const std::vector<SourceKind>& kinds, const std::string& where) {
  for (const SourceKind& kind : kinds)
    if (kind.fits(where)) return kind;
  throw std::logic_error("folders take anything");
}

TEST(SourceRegistry, RecordingsAreToldByTheirEndingAndFoldersByWhatLiesInThem) {
  namespace fs = std::filesystem;
  const std::vector<SourceKind> kinds = source_kinds();
  for (const char* name : {"bag", "mcap", "db3"}) EXPECT_EQ(kind_of(kinds, std::string("x.") + name).name, name);
  const fs::path folder = fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_source_registry");
  fs::create_directories(folder);
  EXPECT_EQ(kind_of(kinds, folder).name, "folder");
  std::ofstream(folder / "x_0.mcap") << "";
  EXPECT_EQ(kind_of(kinds, folder).name, "db3");
  std::ofstream(folder / "rgb.txt") << "";
  EXPECT_EQ(kind_of(kinds, folder).name, "folder") << "a sequence that somebody keeps a recording in";
  fs::remove_all(folder);
}

TEST(SourceRegistry, ARecordingThatIsNotThereIsNamed) {
  try {
    open_source("/no/such/file.bag");
    FAIL() << "it was opened";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()), "/no/such/file.bag: no such file or folder");
  }
}

}  // namespace
}  // namespace dkb
