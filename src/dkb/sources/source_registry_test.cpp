// SPDX-License-Identifier: Apache-2.0
#include "dkb/sources/source_registry.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

TEST(SourceRegistry, KindsHaveNamesOfTheirOwn) {
  const std::vector<SourceKind> kinds = source_kinds();
  for (size_t i = 0; i < kinds.size(); ++i)
    for (size_t j = 0; j < i; ++j) EXPECT_NE(kinds[i].name, kinds[j].name);
}

TEST(SourceRegistry, PriorsHaveNames) {
  EXPECT_EQ(prior_kind_named("odom", ""), PriorKind::odometry);
  EXPECT_EQ(prior_kind_named("auto", ""), PriorKind::automatic);
  EXPECT_THROW(prior_kind_named("", "--prior"), InputError);
}

TEST(SourceRegistry, WhatIsNotThereIsNamed) {
  try {
    open_source("/no/such/folder");
    FAIL() << "it was opened";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("/no/such/folder: no such folder"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("`dkb-slam sources`"), std::string::npos) << error.what();
  }
}

TEST(SourceRegistry, OptionsOfBagsAreRefusedElsewhere) {
  const std::string folder = std::filesystem::temp_directory_path().string();
  const auto error_with = [&](const SourceOptions& options) -> std::string {
    try {
      open_source(folder, options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "it was opened";
  };
  SourceOptions topic, prior;
  topic.colour_topic = "/colour", prior.prior = PriorKind::odometry;
  EXPECT_EQ(error_with(topic), "--colour-topic: " + folder + " is no bag, and only bags have topics; leave it out");
  EXPECT_EQ(error_with(prior), "--prior odom: " + folder +
                                   " is no bag, and only bags have topics; leave it out, or give --prior-file FILE");
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
  std::ofstream(folder / "x.bag.active") << "";
  std::ofstream(folder / "x.oni") << "";
  EXPECT_EQ(kind_of(kinds, folder / "x.bag.active").name, "bag") << "of a recorder that was killed";
  EXPECT_EQ(kind_of(kinds, folder / "x.oni").name, "oni");
  EXPECT_EQ(kind_of(kinds, folder / "x_0.mcap").name, "mcap");
  fs::remove_all(folder);
}

TEST(SourceRegistry, AFolderOfAKnownLayoutStaysOneWhateverLiesInIt) {
  namespace fs = std::filesystem;
  const std::vector<SourceKind> kinds = source_kinds();
  const fs::path folder = fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_source_registry_layouts");
  const auto is_folder_with = [&](const std::vector<const char*>& files) {
    fs::remove_all(folder);
    for (const char* file : files) {
      fs::create_directories((folder / file).parent_path());
      std::ofstream(folder / file) << "";
    }
    return kind_of(kinds, folder).name == "folder";
  };
  EXPECT_TRUE(is_folder_with({"color.txt", "aligned_depth.txt", "metadata.yaml"})) << "OpenLORIS";
  EXPECT_TRUE(is_folder_with({"frame-000000.color.png", "frame-000000.depth.png", "a.mcap"})) << "7-Scenes";
  EXPECT_TRUE(is_folder_with({"color/0.jpg", "depth/0.png", "intrinsic/intrinsic_color.txt", "a.db3"})) << "ScanNet";
  EXPECT_TRUE(is_folder_with({"results/frame000000.jpg", "results/depth000000.png", "metadata.yaml"})) << "Replica";
  EXPECT_TRUE(is_folder_with({"rgb/000000.jpg", "depth/000000.png", "a.mcap"})) << "Redwood";
  EXPECT_FALSE(is_folder_with({"metadata.yaml", "x_0.mcap"}));
  EXPECT_FALSE(is_folder_with({"metadata.yaml", "x_0.mcap", "results/report.html"})) << "a bag with a run's results";
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
