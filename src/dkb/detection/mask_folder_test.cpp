// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/mask_folder.h"

#include <gtest/gtest.h>

#include <fstream>

#include "dkb/util/errors.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

GreyImage painted(const std::vector<std::string>& rows) {
  GreyImage mask(static_cast<int>(rows[0].size()), static_cast<int>(rows.size()));
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      mask(x, y) = rows[static_cast<size_t>(y)][static_cast<size_t>(x)] == '#' ? 255 : 0;
  return mask;
}

TEST(RegionBoxes, DiagonalNeighboursBelongTogether) {
  const GreyImage mask = painted({"#...##",  //
                                  ".#....",  //
                                  "..#..."});
  EXPECT_EQ(region_boxes(mask, 1), (std::vector<Box>{{0, 0, 3, 3}, {4, 0, 2, 1}}));
  EXPECT_EQ(region_boxes(mask, 3).size(), 1u);
}

TEST(RegionBoxes, ArmsThatMeetBelowAreOneRegion) {
  const GreyImage mask = painted({"#.#.#",  //
                                  "#.#.#",  //
                                  "#####"});
  EXPECT_EQ(region_boxes(mask, 1), (std::vector<Box>{{0, 0, 5, 3}}));
}

TEST(RegionBoxes, AnEmptyMaskHasNone) {
  EXPECT_TRUE(region_boxes(GreyImage(4, 4), 1).empty());
}

class MaskFolderTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("dkb_masks_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  void touch(const std::string& name) { std::ofstream(folder_ / name) << "x"; }
  // A reader that makes a picture instead of reading one: a square of 10 x 10 px.
  static GreyImage square(const fs::path&) {
    GreyImage mask(40, 30);
    for (int y = 5; y < 15; ++y)
      for (int x = 20; x < 30; ++x) mask(x, y) = 200;
    return mask;
  }
  static Detections at(MaskFolder& detector, int64_t stamp_ns) {
    DetectorInput image;
    image.stamp_ns = stamp_ns;
    return detector.detect(image);
  }
  fs::path folder_;
};

TEST_F(MaskFolderTest, GivesTheMaskOfTheStampAndItsBoxes) {
  touch("12.500000.png");
  touch("notes.txt");
  MaskFolder detector(folder_, square, {12.4, 12.5, 12.6}, 40, 30);
  const Detections found = at(detector, 12'500'000'000);
  EXPECT_EQ(found.boxes, (std::vector<Detection>{{"mover", {20, 5, 10, 10}, 1.0f}}));
  EXPECT_EQ(found.mask(20, 5), 255);
  EXPECT_EQ(found.mask(19, 5), 0);
  EXPECT_TRUE(at(detector, 12'600'000'000).mask.empty());
}

TEST_F(MaskFolderTest, FoldersThatCannotServeAreRefusedAtOnce) {
  const auto open = [&](const fs::path& folder, double stamp, int width) {
    MaskFolder detector(folder, square, {stamp}, width, 30);
  };
  EXPECT_THROW(open(folder_ / "none", 12.5, 40), InputError);
  EXPECT_THROW(open(folder_, 12.5, 40), InputError);  // holds none
  touch("12.500000.png");
  EXPECT_THROW(open(folder_, 13.5, 40), InputError);  // none for this sequence
  EXPECT_THROW(open(folder_, 12.5, 41), InputError);  // another size
  EXPECT_NO_THROW(open(folder_, 12.5, 40));
}

TEST_F(MaskFolderTest, EveryValueAboveZeroIsAMover) {
  touch("1.png");
  const auto ones = [](const fs::path&) {
    GreyImage mask(40, 30);
    for (int x = 0; x < 20; ++x)
      for (int y = 0; y < 30; ++y) mask(x, y) = 1;
    return mask;
  };
  MaskFolder detector(folder_, ones, {1.0}, 40, 30);
  const Detections found = at(detector, 1'000'000'000);
  EXPECT_EQ(found.boxes, (std::vector<Detection>{{"mover", {0, 0, 20, 30}, 1.0f}}));
  EXPECT_EQ(found.mask(0, 0), 255);
  EXPECT_EQ(found.mask(20, 0), 0);
}

TEST_F(MaskFolderTest, StampsNeedNotBeKnownBeforehand) {
  touch("12.500000.png");
  EXPECT_NO_THROW(MaskFolder(folder_, square, {}, 40, 30));
  EXPECT_THROW(MaskFolder(folder_, square, {}, 41, 30), InputError);  // another size
}

}  // namespace
}  // namespace dkb
