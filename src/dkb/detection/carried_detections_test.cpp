// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/carried_detections.h"

#include <gtest/gtest.h>

#include <limits>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

// By the pixel that every side of a box grows by in a frame, whatever its points do.
Box grown(const Box& box, float by = 1) {
  return {box.x - by, box.y - by, box.w + 2 * by, box.h + 2 * by};
}

Detections one(Box box) {
  return {{{"person", box, 0.5f}}, {}};
}

// A grid of points every 5 px over `box`, each moved by `move`.
template <class Move>
std::vector<PointMotion> grid(const Box& box, Move move) {
  std::vector<PointMotion> motions;
  for (float y = box.y + 2; y < box.y + box.h; y += 5)
    for (float x = box.x + 2; x < box.x + box.w; x += 5) {
      PointMotion p{{x, y}, {x, y}};
      move(p);
      motions.push_back(p);
    }
  return motions;
}

TEST(Carry, BoxesMoveWithTheirPoints) {
  const Box box{100, 50, 40, 80};
  const auto motions = grid(box, [](PointMotion& p) { p.to.x() += 7, p.to.y() -= 3; });
  const Detections to = carry(one(box), motions, 2, 640, 480);
  ASSERT_EQ(to.boxes.size(), 1u);
  EXPECT_EQ(to.boxes[0], (Detection{"person", grown({107, 47, 40, 80}, 2), 0.5f}));
}

TEST(Carry, FalseTracksDoNotMoveTheBox) {
  const Box box{100, 50, 40, 80};
  Random random(1);
  const auto motions = grid(box, [&](PointMotion& p) {
    p.to.x() += 7;
    if (random.below(10) < 2) p.to.x() += static_cast<float>(random.uniform(-60, 60));
  });
  EXPECT_NEAR(carry(one(box), motions, 1, 640, 480).boxes[0].box.x, 106, 1e-3);
}

TEST(Carry, BoxesGrowWithWhatComesNear) {
  const Box box{100, 100, 100, 100};
  // Scaled by 1.04 about the box's middle.
  const auto motions = grid(box, [](PointMotion& p) {
    p.to.x() = 150 + 1.04f * (p.from.x() - 150);
    p.to.y() = 150 + 1.04f * (p.from.y() - 150);
  });
  const Box to = carry(one(box), motions, 1, 640, 480).boxes[0].box;
  EXPECT_NEAR(to.w, 104 + 2, 0.01);
  EXPECT_NEAR(to.x, 98 - 1, 0.01);
}

TEST(Carry, DividedPointsStretchTheBoxOverBothMotions) {
  // Half the points lie on the still background, half on somebody who moves by 20 px: the box covers both places.
  const Box box{100, 50, 60, 80};
  bool mover = false;
  const auto motions = grid(box, [&](PointMotion& p) {
    mover = !mover;
    if (mover) p.to.x() += 20;
  });
  const Box to = carry(one(box), motions, 1, 640, 480).boxes[0].box;
  EXPECT_LE(to.x, 100);
  EXPECT_GE(to.x + to.w, 180);
}

TEST(Carry, BoxesWithoutPointsOnlyGrow) {
  // 3 frames x (1 + 0.02 x 200) = 15 px a side.
  EXPECT_EQ(carry(one({100, 50, 40, 200}), {}, 3, 640, 480).boxes[0].box, grown({100, 50, 40, 200}, 15));
}

TEST(Carry, PointsBelongToTheSmallestBoxThatHoldsThem) {
  const Box large{100, 100, 200, 200}, small{150, 150, 40, 40};
  Detections from = one(large);
  from.boxes.push_back({"dog", small, 1});
  const auto motions = grid(large, [&](PointMotion& p) {
    if (small.contains(p.from.x(), p.from.y())) p.to.x() += 10;
  });
  const Detections to = carry(from, motions, 1, 640, 480);
  EXPECT_EQ(to.boxes[0].box, grown(large));
  EXPECT_EQ(to.boxes[1].box, grown({160, 150, 40, 40}));
}

TEST(Carry, BoxesThatLeaveAreDroppedAndOthersClipped) {
  const Box box{0, 50, 20, 40};
  const auto left = [&](float by) { return grid(box, [=](PointMotion& p) { p.to.x() -= by; }); };
  EXPECT_EQ(carry(one(box), left(5), 1, 640, 480).boxes[0].box, (Box{0, 49, 16, 42}));
  EXPECT_TRUE(carry(one(box), left(30), 1, 640, 480).boxes.empty());
}

TEST(Carry, TheMaskMovesWithItsBox) {
  Detections from = one({10, 10, 20, 20});
  from.mask = GreyImage(64, 48);
  for (int y = 12; y < 28; ++y)
    for (int x = 12; x < 28; ++x) from.mask(x, y) = 255;
  from.mask(50, 40) = 255;  // in no box
  const auto motions = grid(from.boxes[0].box, [](PointMotion& p) { p.to.x() += 6, p.to.y() += 2; });
  const Detections to = carry(from, motions, 1, 64, 48);
  int count = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) {
      count += to.mask(x, y) == 255;
      if (x >= 18 && x < 34 && y >= 14 && y < 30) {
        EXPECT_EQ(to.mask(x, y), 255) << x << ' ' << y;
      }
    }
  EXPECT_EQ(count, 16 * 16 + 1);
  EXPECT_EQ(to.mask(50, 40), 255);
}

TEST(Carry, NoFramesOrNonsenseChangeNothing) {
  const Box box{100, 50, 40, 80};
  auto motions = grid(box, [](PointMotion&) {});
  EXPECT_EQ(carry(one(box), motions, 0, 640, 480), one(box));
  motions.push_back({{110, 60}, {std::numeric_limits<float>::quiet_NaN(), 0}});
  EXPECT_EQ(carry(one(box), motions, 1, 640, 480), one(grown(box)));
}

}  // namespace
}  // namespace dkb
