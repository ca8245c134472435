// SPDX-License-Identifier: Apache-2.0
#include "report/lost_stretches.h"

#include <gtest/gtest.h>

namespace dkb::report {
namespace {

FrameRow good(int frame) {
  FrameRow row;
  row.stamp_ns = frame * int64_t{33'333'333};
  row.state = TrackingState::tracking;
  row.features = 1000;
  row.with_depth = 800;
  row.inliers = 300;
  row.depth = 0.8F;
  row.brightness = 120;
  return row;
}

// Ten good frames, three lost ones as `spoil` makes them, ten good ones.
template <class Spoil>
LostPart part_of(Spoil spoil) {
  std::vector<FrameRow> rows;
  for (int i = 0; i < 23; ++i) rows.push_back(good(i));
  for (size_t i = 10; i < 13; ++i) {
    rows[i].state = TrackingState::lost;
    rows[i].inliers = 7;
    spoil(rows, i);
  }
  const std::vector<LostStretch> stretches = lost_stretches(rows, {});
  EXPECT_EQ(stretches.size(), 1u);
  EXPECT_EQ(stretches.front().begin, 10u);
  EXPECT_EQ(stretches.front().end, 13u);
  EXPECT_EQ(stretches.front().parts.size(), 1u);
  return stretches.front().parts.front();
}

using Rows = std::vector<FrameRow>;

TEST(LostStretches, BlackPicturesHaveNoFeatures) {
  const LostPart s = part_of([](Rows& rows, size_t i) {
    rows[i].features = 0;
    rows[i].with_depth = 0;
    rows[i].depth = rows[i].brightness = 0;
  });
  EXPECT_EQ(s.cause, "no features");
  EXPECT_EQ(s.evidence, "0 features a frame, usually 1000; the picture is dark: grey level 0 of 255");
}

TEST(LostStretches, PeopleThatCoverThePictureAreNamed) {
  const LostPart s = part_of([](Rows& rows, size_t i) {
    rows[i].masked = 0.7F;
    rows[i].removed = 640;
  });
  EXPECT_EQ(s.cause, "covered by people");
  EXPECT_EQ(s.evidence, "movers cover 70 % of the picture, and 640 of 1000 features lie on them");
}

TEST(LostStretches, MissingDepthIsNamed) {
  const LostPart s = part_of([](Rows& rows, size_t i) {
    rows[i].depth = 0.02F;
    rows[i].with_depth = 110;
  });
  EXPECT_EQ(s.cause, "no depth");
  EXPECT_EQ(s.evidence, "2 % of the picture and 110 of 1000 features have depth, usually 80 % and 800");
}

TEST(LostStretches, FastTurnsAreNamedWithTheirSpeed) {
  const LostPart s = part_of([](Rows& rows, size_t) { rows[9].turned_deg = 10; });
  EXPECT_EQ(s.cause, "too fast");
  EXPECT_EQ(s.evidence, "the camera turned by 300 deg/s before it: 93 px from frame to frame");
}

TEST(LostStretches, AGapInTheRecordingIsNamed) {
  const LostPart s = part_of([](Rows& rows, size_t i) {
    if (i == 10)
      for (size_t k = i; k < rows.size(); ++k) rows[k].stamp_ns += 2'000'000'000;
  });
  EXPECT_EQ(s.cause, "frames missing");
  EXPECT_EQ(s.evidence, "2.03 s without a frame before it, usually 0.033 s");
}

TEST(LostStretches, WhatIsLeftIsAViewThatTheMapDoesNotKnow) {
  const LostPart s = part_of([](Rows&, size_t) {});
  EXPECT_EQ(s.cause, "not recognised");
  EXPECT_EQ(s.evidence, "1000 features a frame, 800 of them with depth, but only 7 fit the map (at least 20)");
}

TEST(LostStretches, AViewThatMayBeALookAlikeIsNamed) {
  const LostPart s = part_of([](Rows& rows, size_t i) { rows[i].ambiguous = true; });
  EXPECT_EQ(s.cause, "a look-alike");
}

TEST(LostStretches, FramesByAPriorAreAStretchOfTheirOwn) {
  Rows rows;
  for (int i = 0; i < 6; ++i) rows.push_back(good(i));
  rows[2].state = rows[3].state = TrackingState::predicted;
  rows[4].state = TrackingState::lost;
  const std::vector<LostStretch> stretches = lost_stretches(rows, {});
  ASSERT_EQ(stretches.size(), 2u);
  EXPECT_EQ(stretches[0].state, TrackingState::predicted);
  EXPECT_EQ(stretches[0].end, 4u);
  EXPECT_EQ(stretches[1].state, TrackingState::lost);
}

// Ten good frames, then lost ones, each of them as `spoil` makes it.
template <class Spoil>
std::vector<LostPart> parts_of(size_t lost, Spoil spoil) {
  std::vector<FrameRow> rows;
  for (size_t i = 0; i < 10 + lost; ++i) rows.push_back(good(static_cast<int>(i)));
  for (size_t i = 10; i < rows.size(); ++i) {
    rows[i].state = TrackingState::lost;
    rows[i].inliers = 0;
    spoil(rows[i], i);
  }
  return lost_stretches(rows, {}).front().parts;
}

TEST(LostStretches, WhatKeepsTheCameraLostIsToldApartFromWhatBeganIt) {
  const std::vector<LostPart> parts = parts_of(30, [](FrameRow& row, size_t i) {
    row.features = i < 13 ? 0 : 280;
    row.with_depth = i < 13 ? 0 : 90;
    row.brightness = i < 13 ? 0 : 110;
  });
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].cause, "no features");
  EXPECT_EQ(parts[0].begin, 10u);
  EXPECT_EQ(parts[0].end, 13u);
  EXPECT_EQ(parts[1].cause, "not recognised");
  EXPECT_EQ(parts[1].evidence,
            "280 features a frame, 90 of them with depth, but nothing of the map is found; that is too few with "
            "depth to begin a new map (at least 100)");
  EXPECT_EQ(parts[1].end, 40u);
}

TEST(LostStretches, CausesThatFlickerAreNoPartsOfTheirOwn) {
  const std::vector<LostPart> parts =
      parts_of(30, [](FrameRow& row, size_t i) { row.features = row.with_depth = i % 4 == 3 ? 90 : 400; });
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].cause, "not recognised");
  EXPECT_EQ(parts[0].evidence,
            "400 features a frame, 400 of them with depth, but nothing of the map is found; 8 of 30 frames have too "
            "few with depth to begin a new map (at least 100)");
  EXPECT_EQ(parts[0].end, 40u);
}

TEST(LostStretches, AFastTurnIsNoCauseOfWhatFollowsTheDark) {
  std::vector<FrameRow> rows;
  for (int i = 0; i < 30; ++i) rows.push_back(good(i));
  rows[9].turned_deg = 10;
  for (size_t i = 10; i < 30; ++i) rows[i].state = TrackingState::lost;
  for (size_t i = 10; i < 14; ++i) rows[i].features = 0;
  const std::vector<LostPart> parts = lost_stretches(rows, {}).front().parts;
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[1].cause, "not recognised");
}

TEST(LostStretches, BeforeTheFirstMapTooLittleDepthIsNamed) {
  std::vector<FrameRow> rows;
  for (int i = 0; i < 5; ++i) rows.push_back(good(i));
  for (FrameRow& row : rows) row.state = TrackingState::initialising, row.with_depth = 70, row.features = 200;
  const std::vector<LostPart> parts = lost_stretches(rows, {}).front().parts;
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].cause, "no depth");
  EXPECT_NE(parts[0].evidence.find("; that is too few with depth to begin a map (at least 100)"), std::string::npos)
      << parts[0].evidence;
}

}  // namespace
}  // namespace dkb::report
