// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_segmenter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <utility>

#include "dkb/detection/mask_folder.h"
#include "dkb/dynamics/motion_segmenter_test_scene.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

TEST(MotionSegmenter, WhatWasSeenLongAgoSaysNothingOfWhatStandsThereNow) {
  World world;
  world.still_camera = true;
  // A gap of 16 s in which a box was put down.
  MotionSegmenter segmenter(world.camera, {}, {});
  for (int f = 0; f < 30; ++f) {
    segment(segmenter, world.render(f, {}).image, world.cam_from_world(f));
    segmenter.commit(world.cam_from_world(f));
  }
  Panel box = box_at(0);
  for (int f = 30 + 16 * 30; f < 30 + 16 * 30 + 10; ++f) {
    const Picture p = world.render(f, {box});
    const MoverMask mask = segment(segmenter, p.image, world.cam_from_world(f));
    EXPECT_LT(judge(mask, p.truth).covered, 0.02) << f;
    segmenter.commit(world.cam_from_world(f));
  }
}

TEST(MotionSegmenter, MarksNothingInTheFirstFrame) {
  run(
      World(), 1, [](int) { return std::vector{box_at(0)}; },
      [](int, const MoverMask& mask, const Figures& figures) {
        EXPECT_EQ(mask.cells.width(), 160);  // cells of 2 px
        EXPECT_EQ(mask.cells.height(), 120);
        EXPECT_EQ(figures.covered, 0);
      });
}

TEST(MotionSegmenter, LeavesAStillWorldUnmarked) {
  run(
      World(), 60, [](int) { return std::vector<Panel>{}; },
      [](int f, const MoverMask&, const Figures& figures) { EXPECT_LT(figures.wrong, 0.01) << f; });
}

TEST(MotionSegmenter, FindsABoxThatComesInAndNothingElse) {
  run(
      World(), 50, [](int f) { return std::vector{box_at(-1.4 + 0.03 * f)}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f < 20) return;
        EXPECT_GT(figures.covered, 0.9) << f;
        EXPECT_LT(figures.wrong, 0.01) << f;
      });
}

TEST(MotionSegmenter, DoesNotTakeTheRoomForWhoLeftDuringAGap) {
  World world;
  MotionSegmenter segmenter(world.camera, {}, {});
  const auto see = [&](int frame, const std::vector<Panel>& movers) {
    const Picture p = world.render(frame, movers);
    const MoverMask mask = segment(segmenter, p.image, world.cam_from_world(frame));
    segmenter.commit(world.cam_from_world(frame));
    return judge(mask, p.truth);
  };
  for (int f = 0; f < 30; ++f) see(f, {box_at(-0.6 + 0.02 * f, 2.6)});
  EXPECT_LT(see(90, {}).wrong, 0.05) << "two seconds later he is gone";
}

// A box stands there from the first frame on; in frame 20 matches may show that it moves, and it goes 2 cm a frame if
// so.
double share_marked(bool accused, bool goes, int frame) {
  const World world;
  MotionSegmenter segmenter(world.camera, {}, {});
  double covered = 0;
  for (int f = 0; f <= frame; ++f) {
    const Picture p = world.render(f, {box_at(goes ? 0.02 * std::max(0, f - 19) : 0)});
    const Figures figures = judge(segment(segmenter, p.image, world.cam_from_world(f)), p.truth);
    EXPECT_LT(figures.wrong, 0.01) << f;
    covered = figures.covered;
    std::vector<MatchMotion> matches;
    for (int y = 5; y < World::kHeight; y += 10)
      for (int x = 5; x < World::kWidth; x += 10)
        matches.push_back({Eigen::Vector2i(x, y).cast<float>(), p.image.depth(x, y), p.truth(x, y) != 0});
    if (accused && f == 20) segmenter.take_second_motion(matches);
    segmenter.commit(world.cam_from_world(f));
  }
  return covered;
}

TEST(MotionSegmenter, WhoMatchesShowToWalkOffIsMarkedInTheNextFrame) {
  EXPECT_LT(share_marked(false, true, 21), 0.1);
  EXPECT_GT(share_marked(true, true, 21), 0.9);
}

// Views of before testify that it stands where it stood.
TEST(MotionSegmenter, WhatMatchesAccuseWronglyStaysStill) {
  EXPECT_LT(share_marked(true, false, 21), 0.05);
}

// The turn over a gap is not what the velocity before it says: a room held against views of before from there moves.
TEST(MotionSegmenter, SaysNothingWhereALeapLeavesThePoseUnknown) {
  const World world;
  MotionSegmenter segmenter(world.camera, {}, {});
  const auto see = [&](int frame, const Rigid3& expected, const Matrix6d& covariance) {
    const Picture p = world.render(frame, {});
    segmenter.observe(p.image, p.image.depth_timestamp, expected, covariance);
    const double wrong = judge(segmenter.mask(), p.truth).wrong;
    segmenter.commit(world.cam_from_world(frame));
    return wrong;
  };
  for (int f = 0; f < 30; ++f) see(f, world.cam_from_world(f), kStepCovariance);
  constexpr double kGap = 0.8;  // [s]
  const Rigid3 off(rotation_from_vector({0, 0.09, 0}), {0.05, 0, 0.1});
  const Matrix6d unknown = axis_covariance(kAccelerationSd * kGap * kGap, kAngularAccelerationSd * kGap * kGap);
  EXPECT_EQ(see(54, off * world.cam_from_world(54), unknown), 0);
  const StillCells still = segmenter.still();
  EXPECT_EQ(std::count(still.kinds.data(), still.kinds.data() + still.kinds.size(), StillCells::unknown),
            static_cast<std::ptrdiff_t>(still.kinds.size()));
  EXPECT_LT(see(55, world.cam_from_world(55), kStepCovariance), 0.01);
}

TEST(MotionSegmenter, KnowsNothingOfTheFirstFrame) {
  const World world;
  MotionSegmenter segmenter(world.camera, {}, {});
  segmenter.observe(world.render(0, {}).image, 0, world.cam_from_world(0), Matrix6d::Identity());
  const StillCells still = segmenter.still();
  for (size_t i = 0; i < still.kinds.size(); ++i) ASSERT_EQ(still.kinds.data()[i], StillCells::unknown) << i;
}

TEST(MotionSegmenter, KeepsABoxMarkedThatStops) {
  run(
      World(), 120, [](int f) { return std::vector{box_at(std::min(0.1, -1.4 + 0.05 * f))}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f < 30) return;  // stands from here on, for three seconds
        EXPECT_GT(figures.covered, 0.9) << f;
        EXPECT_LT(figures.wrong, 0.01) << f;
      });
}

TEST(MotionSegmenter, FreesTheBackgroundAtOnceWhenTheBoxLeaves) {
  run(
      World(), 40,
      [](int f) { return f < 30 ? std::vector{box_at(std::min(0.0, -1.4 + 0.07 * f))} : std::vector<Panel>{}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f >= 31) {
          EXPECT_LT(figures.wrong, 0.01) << f;
        }
      });
}

TEST(MotionSegmenter, FindsABoxThatWasThereFromTheStartWhenItSways) {
  run(
      World(), 90, [](int f) { return std::vector{box_at(0.12 * std::sin(2.5 * f / 30.0))}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f >= 60) {
          EXPECT_GT(figures.covered, 0.85) << f;
        }
        EXPECT_LT(figures.wrong, 0.01) << f;
      });
}

TEST(MotionSegmenter, FindsABoxThatComesNearerBeforeAStillCamera) {
  World world;
  world.still_camera = true;
  run(
      world, 40, [](int f) { return std::vector{box_at(0.0, 2.2 - 0.02 * f)}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f < 20) return;
        EXPECT_GT(figures.covered, 0.95) << f;
        EXPECT_LT(figures.wrong, 0.01) << f;
      });
}

TEST(MotionSegmenter, IsNotConfusedByMissingDepth) {
  World world;
  world.holes = 0.3;
  run(
      world, 50, [](int f) { return std::vector{box_at(-1.4 + 0.03 * f)}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f < 20) return;
        EXPECT_GT(figures.covered, 0.9) << f;
        EXPECT_LT(figures.wrong, 0.01) << f;
      });
}

TEST(MotionSegmenter, MarksWhatGetsTooNearForTheSensor) {
  // A box comes up to 0.5 m; then its depth is missing but for a rim.
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  for (int f = 0; f < 45; ++f) {
    const double z = std::max(0.5, 2.0 - 0.05 * f);
    Picture p = world.render(f, {box_at(0, z)});
    if (f > 32)
      for (int y = 60; y < 180; ++y)
        for (int x = 100; x < 220; ++x)
          if (p.truth(x, y) != 0) p.image.depth(x, y) = 0;
    const MoverMask mask = segment(segmenter, p.image, world.cam_from_world(f));
    if (f > 36) {
      EXPECT_GT(judge(mask, p.truth).covered, 0.9) << f;
      EXPECT_LT(judge(mask, p.truth).wrong, 0.02) << f;
    }
    segmenter.commit(world.cam_from_world(f));
  }
}

// Missing depth beside a mover, as at the edges of screens: a strip that touches it, and a patch that does not.
TEST(MotionSegmenter, MissingDepthAloneIsNoMover) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  for (int f = 0; f < 40; ++f) {
    Picture p = world.render(f, {box_at(-1.2 + 0.03 * f)});
    if (f > 25) {
      int right = 0;
      for (int x = 0; x < World::kWidth; ++x)
        if (p.truth(x, 120) != 0) right = x;
      for (int x = right + 1; x < std::min(World::kWidth, right + 60); ++x)
        for (int y = 116; y < 126; ++y) p.image.depth(x, y) = 0;
      for (int x = 20; x < 44; ++x)
        for (int y = 20; y < 44; ++y) p.image.depth(x, y) = 0;
    }
    const MoverMask mask = segment(segmenter, p.image, world.cam_from_world(f));
    if (f > 28) {
      EXPECT_GT(judge(mask, p.truth).covered, 0.9) << f;
      EXPECT_LT(judge(mask, p.truth).wrong, 0.002) << f;
    }
    segmenter.commit(world.cam_from_world(f));
  }
}

TEST(MotionSegmenter, GivesNothingOnImagesWithoutDepth) {
  World world;
  world.holes = 1;
  run(
      world, 10, [](int) { return std::vector<Panel>{}; },
      [](int, const MoverMask&, const Figures& figures) { EXPECT_EQ(figures.wrong, 0); });
}

// As with depth at half the rate of colour.
TEST(MotionSegmenter, KnowsWhatMovesThroughImagesWithoutDepth) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  const auto look = [&](int f) {
    Picture p = world.render(f, {box_at(-1.4 + 0.05 * std::min(f, 40))});
    if (f > 40 || (f > 20 && f % 2 == 1)) p.image.depth = DepthImage(World::kWidth, World::kHeight);
    const MoverMask mask = segment(segmenter, p.image, world.cam_from_world(f));
    segmenter.commit(world.cam_from_world(f));
    return std::pair(judge(mask, p.truth), segmenter.aligned_step().has_value());
  };
  for (int f = 0; f <= 40; ++f) {
    const auto [figures, aligned] = look(f);
    EXPECT_LT(figures.wrong, 0.01) << f;
    if (f < 20) continue;
    EXPECT_GT(figures.covered, 0.85) << f;
    EXPECT_EQ(aligned, f <= 20 || f % 2 == 0) << f << ": with the image before that had depth";
  }
  for (int f = 41; f < 60; ++f) {
    const auto [figures, aligned] = look(f);
    EXPECT_FALSE(aligned);
    EXPECT_TRUE(segmenter.still().kinds.empty());
    if (f > 56) {
      EXPECT_EQ(figures.covered, 0) << "nobody knows where it is half a second later";
    }
  }
}

TEST(MotionSegmenter, BeginsAnewWhenTrackingIsLost) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  for (int f = 0; f < 25; ++f) {
    const Picture p = world.render(f, {box_at(-1.4 + 0.05 * f)});
    const MoverMask mask = segment(segmenter, p.image, world.cam_from_world(f));
    if (f == 24) {
      EXPECT_GT(judge(mask, p.truth).covered, 0.9);
    }
    segmenter.commit(f == 24 ? std::nullopt : std::optional(world.cam_from_world(f)));
  }
  EXPECT_TRUE(segmenter.score().empty());
  const Picture p = world.render(25, {box_at(-0.2)});
  EXPECT_EQ(judge(segment(segmenter, p.image, Rigid3()), p.truth).covered, 0);
}

TEST(MotionSegmenter, FollowsAMoveOfTheWorld) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  const Rigid3 new_from_old(rotation_from_vector({0.1, -0.3, 0.2}), {1, 2, 3});
  for (int f = 0; f < 40; ++f) {
    const Picture p = world.render(f, {box_at(-1.4 + 0.04 * f)});
    const Rigid3 cam_from_world = f < 30 ? world.cam_from_world(f) : world.cam_from_world(f) * new_from_old.inverse();
    const Figures figures = judge(segment(segmenter, p.image, cam_from_world), p.truth);
    if (f >= 30) {
      EXPECT_GT(figures.covered, 0.9) << f;
      EXPECT_LT(figures.wrong, 0.01) << f;
    }
    segmenter.commit(cam_from_world);
    if (f == 29) segmenter.move_world(new_from_old);
  }
}

// Three frames by guesses that go astray, and then the images tell: views from before the guesses stay where they are.
TEST(MotionSegmenter, CorrectsTheGuessesAlone) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  const Rigid3 found_from_guessed(rotation_from_vector({0.01, -0.02, 0.01}), {0.1, 0.1, 0.4});
  for (int f = 0; f < 34; ++f) {
    const Picture p = world.render(f, {box_at(-1.4 + 0.04 * f)});
    const bool guess = f >= 27 && f < 30;
    const Rigid3 truth = world.cam_from_world(f), guessed = truth * found_from_guessed;
    const Rigid3& expected = f > 27 && f <= 30 ? guessed : truth;
    const Figures figures = judge(segment(segmenter, p.image, expected), p.truth);
    if (f >= 27) {
      EXPECT_GT(figures.covered, 0.9) << f;
      EXPECT_LT(figures.wrong, 0.01) << f;
    }
    if (f == 30) segmenter.correct_guesses(found_from_guessed);
    segmenter.commit(guess ? guessed : truth, guess);
  }
}

// What was seen before is not known to lie to what is seen now; the image last given still tells the next step.
TEST(MotionSegmenter, ForgetsTheViewsButNotTheImageLastGiven) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  for (int f = 0; f < 16; ++f) {
    segment(segmenter, world.render(f, {}).image, world.cam_from_world(f));
    EXPECT_EQ(segmenter.aligned_step().has_value(), f > 0) << f;
    if (f == 10) segmenter.forget_views();
    segmenter.commit(world.cam_from_world(f));
  }
  segmenter.reset();
  segment(segmenter, world.render(16, {}).image, world.cam_from_world(16));
  EXPECT_FALSE(segmenter.aligned_step());
}

TEST(MotionSegmenter, GivesTheSameMasksAgain) {
  std::vector<Image<uint8_t>> first, second;
  for (auto* masks : {&first, &second})
    run(
        World(), 30, [](int f) { return std::vector{box_at(-1.4 + 0.05 * f)}; },
        [&](int, const MoverMask& mask, const Figures&) { masks->push_back(mask.cells); });
  EXPECT_EQ(first, second);
}

TEST(MotionSegmenter, RefusesDepthOfAnotherSize) {
  MotionSegmenter segmenter(World().camera, {});
  RgbdImage image;
  image.depth = DepthImage(64, 48);
  EXPECT_THROW(segment(segmenter, image, Rigid3()), InputError);
}

// Nobody saw empty what he walks into, since the camera turns after him.
TEST(MotionSegmenter, FindsWhoWalksWhereTheCameraHasNotLookedYet) {
  World world;
  world.turn = -5 * M_PI / 180;
  world.rate = 10;
  run(
      world, 9, [](int f) { return std::vector{box_at(-0.75 - 0.12 * f)}; },
      [](int f, const MoverMask&, const Figures& figures) {
        if (f < 3) return;
        EXPECT_GT(figures.covered, 0.9) << f;
        EXPECT_LT(figures.wrong, 0.01) << f;
      });
}

// By the box of what the truth marks.
Silhouettes boxed_in(const World& world, const Picture& p) {
  const Detection box{"person", region_boxes(p.truth, 100).front(), 1};
  return silhouettes(p.image.depth, std::vector{box}, world.camera, {});
}

TEST(MotionSegmenter, WhoStandsInABoxFromTheStartStaysMarked) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  for (int f = 0; f < 60; ++f) {
    const Picture p = world.render(f, {box_at(0)});
    segmenter.observe(p.image, p.image.depth_timestamp, world.cam_from_world(f), kStepCovariance);
    const Silhouettes left = without_still(boxed_in(world, p), segmenter.still());
    segmenter.take_bodies(left.body);
    const Figures figures = judge(left.mask, p.truth);
    EXPECT_GT(figures.covered, 0.9) << f;
    EXPECT_LT(figures.wrong, 0.01) << f;
    segmenter.commit(world.cam_from_world(f));
  }
}

TEST(MotionSegmenter, WhatStoodThereBeforeABoxCameIsNoPartOfIt) {
  const World world;
  MotionSegmenter segmenter(world.camera, {});
  for (int f = 0; f < 40; ++f) {
    Picture p = world.render(f, {});
    segmenter.observe(p.image, p.image.depth_timestamp, world.cam_from_world(f), kStepCovariance);
    if (f >= 30) {  // a detector takes the pillar for a person
      for (size_t i = 0; i < p.truth.size(); ++i) p.truth.data()[i] = p.image.depth.data()[i] < 2.6f ? 255 : 0;
      const Silhouettes boxed = boxed_in(world, p);
      EXPECT_GT(judge(boxed.body, p.truth).covered, 0.9) << f;
      EXPECT_LT(judge(without_still(boxed, segmenter.still()).mask, p.truth).covered, 0.02) << f;
    }
    segmenter.commit(world.cam_from_world(f));
  }
}

TEST(MotionSegmenter, FindsTheSameScoresWithEveryInstructionSet) {
  World world;
  world.holes = 0.1;
  std::vector<MotionSegmenter> segmenters;
  std::vector<Simd> kinds{Simd::scalar};
  for (Simd simd : {Simd::avx2, Simd::avx512})
    if (simd <= best_simd()) kinds.push_back(simd);
  for (Simd simd : kinds) segmenters.emplace_back(world.camera, SensorNoise{}, MotionOptions{}, simd);
  for (int f = 0; f < 25; ++f) {
    const Picture p = world.render(f, {box_at(-0.5 + 0.03 * f), box_at(0.4, 0.5)});
    std::vector<MoverMask> masks;
    for (MotionSegmenter& s : segmenters) {
      masks.push_back(segment(s, p.image, world.cam_from_world(f)));
      ASSERT_EQ(masks.back().cells, masks.front().cells) << f;
      ASSERT_EQ(s.score(), segmenters.front().score()) << f;
      s.commit(world.cam_from_world(f));
    }
  }
}

}  // namespace
}  // namespace dkb
