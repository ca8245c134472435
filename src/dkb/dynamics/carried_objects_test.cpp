// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/carried_objects.h"

#include <gtest/gtest.h>

#include "dkb/features/fast_corners.h"
#include "dkb/features/feature_test_util.h"
#include "dkb/features/optical_flow.h"

namespace dkb {
namespace {

constexpr int kStep = 3;  // [px] that the picture moves to the right from frame to frame

// A picture that moves sideways as a whole, somebody at 1.5 m in its middle before a wall at 3 m.
class CarriedObjectsTest : public ::testing::Test {
 protected:
  CarriedObjectsTest() { camera.width = 320, camera.height = 240; }

  static Box person(FrameIndex frame) { return {static_cast<float>(100 + kStep * frame), 60, 60, 120}; }
  static GreyImage mask_of(FrameIndex frame) {
    GreyImage mask(320, 240);
    const Box b = person(frame);
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x)
        if (b.contains(static_cast<float>(x), static_cast<float>(y))) mask(x, y) = 255;
    return mask;
  }
  PastFrame frame(FrameIndex index, bool keyframe = false) const {
    auto image = std::make_shared<RgbdImage>();
    image->grey = world.render({1, 0, -static_cast<double>(kStep * index), 0});
    image->depth = DepthImage(320, 240, 3.0f);
    const GreyImage mask = mask_of(index);
    for (size_t i = 0; i < mask.size(); ++i)
      if (mask.data()[i] != 0) image->depth.data()[i] = 1.5f;
    PastFrame made;
    made.frame = index;
    made.keyframe = keyframe;
    auto pyramid = std::make_shared<ImagePyramid>(flow_pyramid());
    pyramid->build(image->grey);
    std::vector<PixelCorner> corners;
    FastCornerFinder().find(image->grey, 30, 20, corners);
    for (const PixelCorner& c : corners) made.corners.emplace_back(static_cast<float>(c.x), static_cast<float>(c.y));
    made.pyramid = std::move(pyramid);
    made.image = std::move(image);
    return made;
  }
  // Frames 0 ... last come one after the other, `now` is the last one; `keyframes` among them.
  void see(FrameIndex last, const std::vector<FrameIndex>& keyframes = {}) {
    for (FrameIndex f = 0; f <= last; ++f) {
      PastFrame next = frame(f, std::find(keyframes.begin(), keyframes.end(), f) != keyframes.end());
      if (f < last)
        past.push_back(std::move(next));
      else
        now = std::move(next);
    }
  }
  // What is detected in an earlier frame is known before objects go on to this one, as in the pipeline.
  std::vector<LateMask> receive(FrameIndex from, const Detections& detections) {
    auto late = carried.receive(from, detections, past);
    if (from < now.frame) carried.follow(past, *now.pyramid);
    return late;
  }
  static void expect_near(const Box& box, const Box& truth, float tolerance) {
    EXPECT_NEAR(box.x, truth.x, tolerance);
    EXPECT_NEAR(box.y, truth.y, tolerance);
    EXPECT_NEAR(box.x + box.w, truth.x + truth.w, tolerance);
    EXPECT_NEAR(box.y + box.h, truth.y + truth.h, tolerance);
  }
  // An answer tells of somebody beside the person of image 4, whom it overlooks: both have their masks.
  void expect_both_when_another_is_seen() {
    GreyImage another(320, 240);
    const Box beside{250, 60, 40, 60};
    for (int y = 60; y < 120; ++y)
      for (int x = 250; x < 290; ++x) another(x, y) = 255;
    receive(4, {{{"person", beside, 1}}, another});
    ASSERT_EQ(carried.boxes().size(), 2U);
    EXPECT_EQ(shares(carried.mask(), 4).first, 1);
    EXPECT_EQ(carried.mask()(270, 90), 255);
  }
  // The share of the person's pixels that a mask marks, and of the others.
  static std::pair<double, double> shares(const GreyImage& mask, FrameIndex index) {
    const GreyImage truth = mask_of(index);
    double inside = 0, outside = 0, all = 0;
    for (size_t i = 0; i < truth.size(); ++i) {
      const bool marked = !mask.empty() && mask.data()[i] != 0;
      (truth.data()[i] != 0 ? inside : outside) += marked;
      all += truth.data()[i] != 0;
    }
    return {inside / all, outside / (static_cast<double>(truth.size()) - all)};
  }

  SquareWorld world{320, 240, 300, 8};
  Camera camera;
  CarriedObjects carried{small_camera(), {}};
  PastFrames past;
  PastFrame now;

  static Camera small_camera() {
    Camera camera;
    camera.width = 320, camera.height = 240;
    return camera;
  }
};

TEST_F(CarriedObjectsTest, AnOldBoxIsCarriedToTheNewestImage) {
  see(5);
  EXPECT_TRUE(receive(1, {{{"person", person(1), 0.9f}}, {}}).empty()) << "there was no keyframe";
  ASSERT_EQ(carried.boxes().size(), 1U);
  EXPECT_EQ(carried.boxes()[0].class_name, "person");
  EXPECT_EQ(carried.boxes()[0].score, 0.9f);
  expect_near(carried.boxes()[0].box, person(5), 6);
  EXPECT_TRUE(carried.mask().empty());
}

TEST_F(CarriedObjectsTest, BoxesFollowFromFrameToFrame) {
  see(1);
  receive(1, {{{"person", person(1), 1}}, {}});
  for (FrameIndex f = 2; f < 8; ++f) {
    past.push_back(std::move(now));
    now = frame(f);
    carried.follow(past, *now.pyramid);
  }
  ASSERT_EQ(carried.boxes().size(), 1U);
  expect_near(carried.boxes()[0].box, person(7), 9);
}

TEST_F(CarriedObjectsTest, WhoWalksBeforeSomebodyWhoStandsDoesNotTakeTheOthersBoxAlong) {
  // Only what is inside the walking one's box moves.
  const auto only_the_person_moves = [&](FrameIndex f) {
    PastFrame made = frame(f);
    auto image = std::make_shared<RgbdImage>(*made.image);
    image->grey = world.render();
    const GreyImage moved = world.render({1, 0, -static_cast<double>(kStep * f), 0}), mask = mask_of(f);
    for (size_t i = 0; i < mask.size(); ++i)
      if (mask.data()[i] != 0) image->grey.data()[i] = moved.data()[i];
    auto pyramid = std::make_shared<ImagePyramid>(flow_pyramid());
    pyramid->build(image->grey);
    std::vector<PixelCorner> corners;
    FastCornerFinder().find(image->grey, 30, 20, corners);
    made.corners.clear();
    for (const PixelCorner& c : corners) made.corners.emplace_back(static_cast<float>(c.x), static_cast<float>(c.y));
    made.pyramid = std::move(pyramid);
    made.image = std::move(image);
    return made;
  };
  const Box stands{30, 20, 240, 200};
  past.push_back(only_the_person_moves(0));
  carried.receive(0, {{{"person", stands, 1}, {"person", person(0), 1}}, {}}, past);
  constexpr FrameIndex kFrames = 8;
  for (FrameIndex f = 1; f <= kFrames; ++f) {
    const PastFrame next = only_the_person_moves(f);
    carried.follow(past, *next.pyramid);
    past.push_back(next);
  }
  ASSERT_EQ(carried.boxes().size(), 2U);
  expect_near(carried.boxes()[0].box, stands, kFrames + 3);               // grown by a pixel a frame
  expect_near(carried.boxes()[1].box, person(kFrames), 2 * kFrames + 3);  // what stands at its border holds it back
}

TEST_F(CarriedObjectsTest, MasksAreCarriedWithTheirBoxes) {
  see(4);
  receive(1, {{{"person", person(1), 1}}, mask_of(1)});
  const auto [inside, outside] = shares(carried.mask(), 4);
  EXPECT_GT(inside, 0.95);
  EXPECT_LT(outside, 0.02);
}

TEST_F(CarriedObjectsTest, ADetectorThatGivesOnlyMasksIsCarriedByTheirRegions) {
  see(4);
  receive(1, {{}, mask_of(1)});
  EXPECT_GT(shares(carried.mask(), 4).first, 0.95);
  ASSERT_EQ(carried.boxes().size(), 1U);
  EXPECT_EQ(carried.boxes()[0].class_name, "mover");
  past.push_back(std::move(now));
  now = frame(5);
  carried.follow(past, *now.pyramid);
  EXPECT_GT(shares(carried.mask(), 5).first, 0.95);
  EXPECT_LT(shares(carried.mask(), 5).second, 0.02);
}

TEST_F(CarriedObjectsTest, KeyframesMadeSinceGetLateMasksOfTheSilhouette) {
  see(6, {0, 2, 4});
  const auto late = receive(3, {{{"person", person(3), 1}}, {}});
  ASSERT_EQ(late.size(), 3U);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(late[i].frame, static_cast<FrameIndex>(2 * i));
    const Box b = person(late[i].frame);
    EXPECT_TRUE(late[i].mask.at(b.x + b.w / 2, b.y + b.h / 2));
    EXPECT_TRUE(late[i].mask.at(b.x + 6, b.y + b.h / 2));
    EXPECT_FALSE(late[i].mask.at(b.x - 20, b.y + b.h / 2)) << "the wall";
  }
}

TEST_F(CarriedObjectsTest, LateMasksAreTheDetectorsOwnWhereItGivesMasks) {
  see(4, {2});
  // Half of the person alone: depth would mark all of it.
  GreyImage half = mask_of(1);
  for (int y = 120; y < 240; ++y)
    for (int x = 0; x < 320; ++x) half(x, y) = 0;
  const auto late = receive(1, {{}, half});
  ASSERT_EQ(late.size(), 1U);
  const Box b = person(2);
  EXPECT_TRUE(late[0].mask.at(b.x + b.w / 2, 90));
  EXPECT_FALSE(late[0].mask.at(b.x + b.w / 2, 160));
}

TEST_F(CarriedObjectsTest, WhatStoodStillBeforeIsNoPartOfALateMask) {
  see(4, {2});
  past[2].still = {4, Image<uint8_t>(80, 60, StillCells::witnessed)};
  const auto late = receive(1, {{{"person", person(1), 1}}, {}});
  ASSERT_EQ(late.size(), 1U);
  for (size_t i = 0; i < late[0].mask.cells.size(); ++i) ASSERT_EQ(late[0].mask.cells.data()[i], 0);
}

TEST_F(CarriedObjectsTest, WhatIsOverlookedOnceOrTwiceDoesNotVanish) {
  see(4);
  receive(4, {{{"person", person(4), 1}}, {}});
  for (int missed = 1; missed <= 2; ++missed) {
    receive(4, {});
    EXPECT_EQ(carried.boxes().size(), 1U) << missed;
  }
  receive(4, {});
  EXPECT_TRUE(carried.boxes().empty());
}

TEST_F(CarriedObjectsTest, WhoeverIsOverlookedWhereOthersHaveMasksKeepsHis) {
  see(4);
  receive(4, {{{"person", person(4), 1}}, mask_of(4)});
  expect_both_when_another_is_seen();
}

TEST_F(CarriedObjectsTest, ABoxThatIsSeenAgainIsNotKeptTwice) {
  see(4);
  receive(3, {{{"person", person(3), 1}}, {}});
  receive(4, {{{"person", person(4), 1}}, {}});
  ASSERT_EQ(carried.boxes().size(), 1U);
  expect_near(carried.boxes()[0].box, person(4), 0.5f);
}

TEST_F(CarriedObjectsTest, WhoeverIsOverlookedTwiceKeepsHisMask) {
  see(4);
  receive(4, {{{"person", person(4), 1}}, mask_of(4)});
  receive(4, {});
  EXPECT_EQ(shares(carried.mask(), 4).first, 1);
  expect_both_when_another_is_seen();
}

TEST_F(CarriedObjectsTest, BoxesOfAnswersWithAndWithoutMasksStandSideBySide) {
  const Box beside{250, 60, 40, 60};
  for (const bool masked_first : {false, true}) {
    see(4);
    const Detections masked{{{"person", person(4), 1}}, mask_of(4)}, bare{{{"person", beside, 1}}, {}};
    receive(4, masked_first ? masked : bare);
    receive(4, masked_first ? bare : masked);
    ASSERT_EQ(carried.boxes().size(), 2U);
    EXPECT_EQ(shares(carried.mask(), 4).first, 1);
    ASSERT_EQ(carried.unmasked_boxes().size(), 1U);
    EXPECT_EQ(carried.unmasked_boxes()[0].box, beside);
    carried = CarriedObjects(small_camera(), {});
    past.clear();
  }
}

TEST_F(CarriedObjectsTest, AMaskLivesAsLongAsItsBox) {
  see(4);
  receive(4, {{}, mask_of(4)});
  for (int missed = 1; missed <= 2; ++missed) {
    receive(4, {});
    EXPECT_EQ(shares(carried.mask(), 4).first, 1) << missed;
  }
  receive(4, {});
  EXPECT_EQ(shares(carried.mask(), 4).first, 0);
}

TEST_F(CarriedObjectsTest, AnAnswerOfAFrameThatIsForgottenCountsWhereItWas) {
  see(3);
  past.clear();
  EXPECT_TRUE(receive(0, {{{"person", person(0), 1}}, {}}).empty());
  ASSERT_EQ(carried.boxes().size(), 1U);
  EXPECT_EQ(carried.boxes()[0].box, person(0));
}

}  // namespace
}  // namespace dkb
