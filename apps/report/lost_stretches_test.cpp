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
  row.with_depth = 0.8F;
  row.inliers = 300;
  row.depth = 0.8F;
  row.brightness = 120;
  return row;
}

// Ten good frames, three lost ones as `spoil` makes them, ten good ones.
template <class Spoil>
LostStretch stretch_of(Spoil spoil) {
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
  return stretches.front();
}

using Rows = std::vector<FrameRow>;

TEST(LostStretches, BlackPicturesHaveNoFeatures) {
  const LostStretch s = stretch_of([](Rows& rows, size_t i) {
    rows[i].features = 0;
    rows[i].with_depth = rows[i].depth = rows[i].brightness = 0;
  });
  EXPECT_EQ(s.cause, "no features");
  EXPECT_EQ(s.evidence, "0 features a frame, usually 1000; the picture is dark: grey level 0 of 255");
}

TEST(LostStretches, PeopleThatCoverThePictureAreNamed) {
  const LostStretch s = stretch_of([](Rows& rows, size_t i) {
    rows[i].masked = 0.7F;
    rows[i].removed = 640;
  });
  EXPECT_EQ(s.cause, "covered by people");
  EXPECT_EQ(s.evidence, "movers cover 70 % of the picture, and 640 of 1000 features lie on them");
}

TEST(LostStretches, MissingDepthIsNamed) {
  const LostStretch s = stretch_of([](Rows& rows, size_t i) {
    rows[i].depth = 0.02F;
    rows[i].with_depth = 0.01F;
  });
  EXPECT_EQ(s.cause, "no depth");
  EXPECT_EQ(s.evidence, "2 % of the picture and 1 % of the features have depth, usually 80 % and 80 %");
}

TEST(LostStretches, FastTurnsAreNamedWithTheirSpeed) {
  const LostStretch s = stretch_of([](Rows& rows, size_t) { rows[9].turned_deg = 10; });
  EXPECT_EQ(s.cause, "too fast");
  EXPECT_EQ(s.evidence, "the camera turned by 300 deg/s before it: 93 px from frame to frame");
}

TEST(LostStretches, AGapInTheRecordingIsNamed) {
  const LostStretch s = stretch_of([](Rows& rows, size_t i) {
    if (i == 10)
      for (size_t k = i; k < rows.size(); ++k) rows[k].stamp_ns += 2'000'000'000;
  });
  EXPECT_EQ(s.cause, "frames missing");
  EXPECT_EQ(s.evidence, "2.03 s without a frame before it, usually 0.033 s");
}

TEST(LostStretches, WhatIsLeftIsAViewThatTheMapDoesNotKnow) {
  const LostStretch s = stretch_of([](Rows&, size_t) {});
  EXPECT_EQ(s.cause, "not recognised");
  EXPECT_EQ(s.evidence, "1000 features a frame, 80 % with depth, but only 7 fit the map (at least 20)");
}

TEST(LostStretches, AViewThatMayBeALookAlikeIsNamed) {
  const LostStretch s = stretch_of([](Rows& rows, size_t i) { rows[i].ambiguous = true; });
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

}  // namespace
}  // namespace dkb::report
