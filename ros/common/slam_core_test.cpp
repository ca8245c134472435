// SPDX-License-Identifier: Apache-2.0
// The node without a middleware, on a short simulated sequence.
#include "slam_core_test_tools.h"

#include <algorithm>
#include <filesystem>

namespace dkb_ros {
namespace {

TEST_F(SlamCoreTest, TracksAndPublishesPosesOfTheBase) {
  const auto core = start({{"grid_period", 0.2}, {"map_period", 0.2}});
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 30);
  const Rigid3 first = out.odometry[0].pose.pose;
  EXPECT_LT(first.translation.norm(), 1e-6);
  EXPECT_LT(first.rotation.angularDistance(Eigen::Quaterniond::Identity()), 1e-6);
  ASSERT_TRUE(out.wait([&] { return out.transforms.size() == 30 && !out.clouds.empty() && !out.paths.empty(); }));
  for (size_t i = 0; i < 30; ++i) {
    ASSERT_EQ(out.transforms[i].size(), 2u);
    const TransformOutput &base = out.transforms[i][0], &odom = out.transforms[i][1];
    EXPECT_EQ(base.parent + base.child + odom.parent + odom.child, "odombase_linkmapodom");
    const Rigid3 error = out.poses[i].pose.inverse() * (odom.parent_from_child * base.parent_from_child);
    EXPECT_LT(error.translation.norm(), 1e-9);
    EXPECT_EQ(out.odometry[i].pose.stamp_ns, frames()[i].stamp_ns());
    EXPECT_GT(out.odometry[i].pose.covariance(0, 0), 0);
    if (i == 0) continue;
    // The twist leads from each pose to the next.
    const double dt = 1e-9 * static_cast<double>(frames()[i].stamp_ns() - frames()[i - 1].stamp_ns());
    const Rigid3 motion = out.odometry[i - 1].pose.pose.inverse() * out.odometry[i].pose.pose;
    EXPECT_NEAR(out.odometry[i].twist.head<3>().norm(), motion.translation.norm() / dt, 0.02);
  }
  ASSERT_TRUE(out.wait([&] { return !out.grids.empty(); }));
  EXPECT_NEAR(out.grids.back().cell, 0.05, 1e-6);
  EXPECT_GT(std::count(out.grids.back().cells.begin(), out.grids.back().cells.end(), 0), 100);
  EXPECT_GT(out.clouds.back().points.size(), 100u);
  EXPECT_EQ(out.images.back().width, source_camera().width);
  ASSERT_TRUE(out.wait([&] { return out.last_value("frames") == "30"; }));
  EXPECT_EQ(out.last_value("tracked"), "30");
  EXPECT_EQ(out.last_value("dropped"), "0");
}

TEST_F(SlamCoreTest, WaitsForTheCameraAndItsMountAndSaysSo) {
  const auto core = make_core({}, out);
  feed(*core, 0);
  ASSERT_TRUE(out.wait([&] { return out.logged.size() == 1; }));
  EXPECT_NE(out.logged[0].find("rgb/camera_info"), std::string::npos);
  core->camera_info(info_of(source_camera()));
  feed(*core, 1);
  ASSERT_TRUE(out.wait([&] { return out.logged.size() == 2; }));
  EXPECT_NE(out.logged[1].find("base_link to camera_optical"), std::string::npos);
  {
    const std::lock_guard lock(out.mutex);
    out.known_transforms["base_link camera_optical"] = optical();
  }
  feed_all(*core, 2, 3);
  ASSERT_TRUE(out.wait([&] { return out.last_value("waiting") == "2"; }));
}

TEST_F(SlamCoreTest, AStartThatFailedIsNotRepeatedForEachPair) {
  const std::string file = testing::TempDir() + "dkb_ros_core_test_late.dkb";
  std::filesystem::remove(file);
  const auto core = start({{"load_map", file}});
  core->camera_info(info_of(source_camera()));
  feed(*core, 0);
  ASSERT_TRUE(out.wait([&] { return !out.logged.empty(); }));
  EXPECT_NE(out.logged[0].find(file), std::string::npos);
  EXPECT_NE(out.logged[0].find("start the node anew"), std::string::npos);
  dkb::Slam mapper(source_camera());
  for (size_t i = 0; i < 3; ++i) mapper.process(frames().at(i));
  mapper.finish();
  mapper.save_map(file);  // which it does not look at again
  feed(*core, 1);
  ASSERT_TRUE(out.wait([&] { return out.last_value("rejected") == "2"; }));
  EXPECT_EQ(out.last_value("state"), "waiting");
  std::filesystem::remove(file);
}

TEST_F(SlamCoreTest, WhatTheMiddlewareThrowsEndsNoThread) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  out.broken = true;
  feed(*core, 0);
  const auto is_told = [&] {
    return std::count(out.logged.begin(), out.logged.end(), "the context is shut down") == 1;
  };
  ASSERT_TRUE(out.wait(is_told));
  out.broken = false;
  feed_all(*core, 1, 2);
  ASSERT_TRUE(out.wait([&] { return out.last_value("rejected") == "1"; }));
}

TEST_F(SlamCoreTest, GoesOnAfterBadImages) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 2);
  const auto complaint = [&](ImageMessage colour, size_t frame) {
    const size_t before = out.logged.size();
    core->colour(std::move(colour));
    core->depth(message_of(frames()[frame], true));
    EXPECT_TRUE(out.wait([&] { return out.logged.size() > before; }));
    return out.logged.back();
  };
  ImageMessage bayer = message_of(frames()[2], false), cut = message_of(frames()[3], false),
               small = message_of(frames()[4], false);
  bayer.encoding = "bayer_rggb8";
  EXPECT_NE(complaint(bayer, 2).find("\"bayer_rggb8\" is not read"), std::string::npos);
  cut.size /= 2;
  EXPECT_NE(complaint(cut, 3).find("fewer than its width"), std::string::npos);
  small.height /= 2;
  EXPECT_NE(complaint(small, 4), "");
  feed_all(*core, 5, 2);
  ASSERT_TRUE(out.wait([&] { return out.last_value("rejected") == "3"; }));
}

TEST_F(SlamCoreTest, ServicesAreAnsweredBetweenFrames) {
  const std::string file = testing::TempDir() + "dkb_ros_core_test.dkb";
  const auto core = start();
  EXPECT_FALSE(answer_of([&](auto done) { core->save_map(file, done); }).success);  // nothing has come yet
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 10);
  EXPECT_TRUE(answer_of([&](auto done) { core->save_map(file, done); }).success);
  EXPECT_GT(std::filesystem::file_size(file), 1000u);
  EXPECT_FALSE(answer_of([&](auto done) { core->save_map("/nowhere/map.dkb", done); }).success);
  EXPECT_FALSE(answer_of([&](auto done) { core->load_map("/nowhere/map.dkb", done); }).success);
  feed_all(*core, 10, 1);  // a failed service harms nothing
  EXPECT_TRUE(answer_of([&](auto done) { core->reset(done); }).success);
  feed_all(*core, 0, 2);  // a new clock as well
  EXPECT_LT(out.odometry[11].pose.pose.translation.norm(), 1e-6);
  EXPECT_TRUE(answer_of([&](auto done) { core->load_map(file, done); }).success);
  EXPECT_TRUE(answer_of([&](auto done) { core->localize_only(true, done); }).success);
  PoseMessage there;
  there.pose.translation.setZero();
  there.covariance.diagonal().setConstant(0.01);
  core->initial_pose(there);
  feed_all(*core, 5, 3);  // found in the map
  EXPECT_TRUE(answer_of([&](auto done) { core->pause(true, done); }).success);
  feed(*core, 8);
  ASSERT_TRUE(out.wait([&] { return out.last_value("state") == "paused"; }));
  EXPECT_EQ(out.odometry.size(), 16u);
  std::filesystem::remove(file);
}

TEST_F(SlamCoreTest, PairsThatWaitedAreNoPartOfTheWorldThatAResetBegins) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  feed_at(*core, 0, 100'000'000'000);
  ASSERT_TRUE(out.wait([&] { return out.odometry.size() == 1; }));
  std::promise<void> held, go_on;
  core->pause(false, [&](const Answer&) {
    held.set_value();
    go_on.get_future().wait();
  });
  held.get_future().wait();
  for (size_t i = 1; i <= 3; ++i) feed_at(*core, i, 100'000'000'000);
  std::promise<Answer> begun;
  core->reset([&](const Answer& answer) { begun.set_value(answer); });
  go_on.set_value();
  EXPECT_TRUE(begun.get_future().get().success);
  for (size_t i = 0; i < 3; ++i) feed(*core, i);  // the recording again, from its beginning
  ASSERT_TRUE(out.wait([&] { return out.odometry.back().pose.stamp_ns == frames()[2].stamp_ns(); }));
  EXPECT_EQ(out.odometry.size(), 4U);
  ASSERT_TRUE(out.wait([&] { return out.last_value("dropped") == "3"; }));
  const std::lock_guard lock(out.mutex);
  EXPECT_EQ(out.last_value("rejected"), "0");
  for (const DiagnosticsOutput& d : out.diagnostics) EXPECT_EQ(d.message.find("too slow"), std::string::npos);
}

TEST_F(SlamCoreTest, WhilePausedOnThePageItSaysSoAndTheMapStaysWhereItIs) {
  const auto core = start({{"viewer_port", int64_t{0}}});
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 3);
  const int port = port_of_the_page();
  ASSERT_GT(port, 0);
  ASSERT_EQ(order_of_a_visitor(port, "pause"), "HTTP/1.1 200 OK");
  feed(*core, 3);
  ASSERT_TRUE(out.wait([&] { return out.last_value("paused") == "1"; }));
  {
    const std::lock_guard lock(out.mutex);
    EXPECT_EQ(out.last_value("state"), "paused");
    EXPECT_EQ(out.diagnostics.back().message, "paused on the page");
    EXPECT_EQ(out.diagnostics.back().level, DiagnosticsOutput::Level::warning);
    ASSERT_EQ(out.transforms.size(), 4U);
    ASSERT_EQ(out.transforms[3].size(), 1U);
    EXPECT_EQ(out.transforms[3][0].child, "odom");
    EXPECT_EQ(out.transforms[3][0].stamp_ns, frames()[3].stamp_ns());
    EXPECT_EQ(out.odometry.size(), 3U);
  }
  // A pause of many frames' time: the clock has not leapt.
  int64_t later_ns = 0;
  for (int i = 2; i <= 6; ++i) feed_at(*core, 3, later_ns += 900'000'000);
  ASSERT_TRUE(out.wait([&] { return out.last_value("paused") == "6"; }));
  ASSERT_EQ(order_of_a_visitor(port, "resume"), "HTTP/1.1 200 OK");
  feed_at(*core, 4, later_ns);
  ASSERT_TRUE(out.wait([&] { return out.odometry.size() == 4; }));
  ASSERT_TRUE(out.wait([&] { return out.last_value("state") == "tracking"; }));
  const std::lock_guard lock(out.mutex);
  for (const std::string& line : out.logged) EXPECT_EQ(line.find("leapt"), std::string::npos) << line;
}

// A pause of the service outlasts that of a visitor.
TEST_F(SlamCoreTest, AVisitorsPauseLeavesThatOfTheService) {
  const auto core = start({{"viewer_port", int64_t{0}}});
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 2);
  const int port = port_of_the_page();
  ASSERT_GT(port, 0);
  EXPECT_TRUE(answer_of([&](auto done) { core->pause(true, done); }).success);
  ASSERT_EQ(order_of_a_visitor(port, "pause"), "HTTP/1.1 200 OK");
  feed(*core, 2);
  ASSERT_TRUE(out.wait([&] { return out.last_value("paused") == "1"; }));
  ASSERT_EQ(order_of_a_visitor(port, "resume"), "HTTP/1.1 200 OK");
  feed(*core, 3);
  ASSERT_TRUE(out.wait([&] { return out.last_value("paused") == "2"; }));
  EXPECT_TRUE(answer_of([&](auto done) { core->pause(false, done); }).success);
  feed_all(*core, 4, 1);
}

TEST_F(SlamCoreTest, ImagesWithoutAPartnerAreNoLife) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 2);
  int64_t stamp_ns = frames()[1].stamp_ns();
  const auto told_while_fed = [&](bool depth_too, const std::string& text) {
    const auto told = [&] {
      const std::lock_guard lock(out.mutex);
      return !out.diagnostics.empty() && out.diagnostics.back().level == DiagnosticsOutput::Level::error &&
             out.diagnostics.back().message.starts_with(text);
    };
    for (int i = 0; i < 1000 && !told(); ++i) {
      ImageMessage colour = message_of(frames()[2], false), depth = message_of(frames()[2], true);
      colour.stamp_ns = stamp_ns += 100'000'000;
      depth.stamp_ns = stamp_ns + 50'000'000;
      core->colour(std::move(colour));
      if (depth_too) core->depth(std::move(depth));
      std::this_thread::sleep_for(100ms);
    }
    EXPECT_TRUE(told());
    const std::lock_guard lock(out.mutex);
    EXPECT_EQ(std::count_if(out.logged.begin(), out.logged.end(),
                            [&](const std::string& line) { return line.starts_with(text); }),
              1);
  };
  told_while_fed(false, "no depth image for ");
  told_while_fed(true, "images come, but none within sync_tolerance (");
  feed_at(*core, 2, stamp_ns + 500'000'000 - frames()[2].stamp_ns());
  ASSERT_TRUE(out.wait([&] { return out.diagnostics.back().level != DiagnosticsOutput::Level::error; }));
}

TEST_F(SlamCoreTest, AStreamThatNeverComesIsTold) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  const auto told = [&] {
    const std::lock_guard lock(out.mutex);
    return !out.diagnostics.empty() && out.diagnostics.back().message == "no depth image has come";
  };
  for (size_t i = 0; i < 1000 && !told(); ++i) {
    ImageMessage colour = message_of(frames()[0], false);
    colour.stamp_ns += static_cast<int64_t>(i) * 100'000'000;
    core->colour(std::move(colour));
    std::this_thread::sleep_for(100ms);
  }
  EXPECT_TRUE(told());
}

TEST_F(SlamCoreTest, AcrossAPoseThatWasSetTheTwistIsNotKnown) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 10);
  EXPECT_LT(out.odometry.back().twist_covariance(0, 0), 1);
  PoseMessage here;
  here.pose = out.odometry.back().pose.pose;  // nothing has moved the map yet
  here.covariance.diagonal().setConstant(0.01);
  core->initial_pose(here);
  feed_all(*core, 10, 2);
  ASSERT_EQ(out.odometry.size(), 12U);
  EXPECT_EQ(out.odometry[10].pose.stamp_ns, frames()[10].stamp_ns()) << "found at once";
  EXPECT_LT((out.odometry[9].pose.pose.translation - out.odometry[10].pose.pose.translation).norm(), 1e-9)
      << "odometry is held, which tells of no motion";
  EXPECT_EQ(out.odometry[10].twist_covariance(0, 0), 1e6);
  EXPECT_LT(out.odometry[11].twist_covariance(0, 0), 1);
}

TEST_F(SlamCoreTest, AMapBegunBesideALoadedOneTellsNoPoseInIt) {
  const std::string file = testing::TempDir() + "dkb_ros_beside_test.dkb";
  {
    const auto core = start();
    core->camera_info(info_of(source_camera()));
    feed_all(*core, 0, 10);
    EXPECT_TRUE(answer_of([&](auto done) { core->save_map(file, done); }).success);
  }
  {
    const std::lock_guard lock(out.mutex);
    out.odometry.clear(), out.poses.clear(), out.transforms.clear(), out.movers.clear();
  }
  const auto core = start({{"load_map", file}, {"tracking.new_map_after", 0.1}, {"grid_period", 0.05}});
  core->camera_info(info_of(source_camera()));
  for (size_t i = 0; i < 12; ++i) {  // what the camera sees in a mirror is another place
    ImageMessage colour = message_of(frames()[i], false), depth = message_of(frames()[i], true);
    for (ImageMessage* image : {&colour, &depth}) {
      const int bytes = image->step / image->width;
      const auto mirrored = std::make_shared<std::vector<uint8_t>>(image->size);
      for (int p = 0; p < image->width * image->height; ++p) {
        const int x = p % image->width;
        std::copy_n(image->data + static_cast<ptrdiff_t>(p) * bytes, bytes,
                    mirrored->data() + static_cast<ptrdiff_t>(p - x + image->width - 1 - x) * bytes);
      }
      show_instead(mirrored, image);
    }
    core->colour(std::move(colour));
    core->depth(std::move(depth));
    ASSERT_TRUE(out.wait([&] { return out.movers.size() == i + 1; }));
  }
  const std::string no_grid = "no grid: the map that was begun beside the loaded one has no place in it yet";
  EXPECT_TRUE(out.wait([&] { return std::count(out.logged.begin(), out.logged.end(), no_grid) == 1; }));
  const std::lock_guard lock(out.mutex);
  EXPECT_EQ(std::count(out.logged.begin(), out.logged.end(), ""), 0);
  EXPECT_GT(out.odometry.size(), 4U) << "where it moves is known";
  EXPECT_TRUE(out.poses.empty()) << "where it is, is not";
  for (const auto& sent : out.transforms)
    for (const TransformOutput& t : sent) EXPECT_EQ(t.parent, "odom");
  std::filesystem::remove(file);
}

TEST_F(SlamCoreTest, LocalizeOnlySaysWhyThereIsNoGrid) {
  const auto core = start({{"localize_only", true}, {"grid_period", 0.05}});
  ASSERT_TRUE(out.wait([&] { return !out.logged.empty(); }));
  {
    const std::lock_guard lock(out.mutex);
    EXPECT_NE(out.logged[0].find("map_server"), std::string::npos) << out.logged[0];
  }
  core->camera_info(info_of(source_camera()));
  const auto said = [&](const char* text) {
    return std::any_of(out.logged.begin(), out.logged.end(),
                       [&](const std::string& line) { return line.find(text) != std::string::npos; });
  };
  feed(*core, 0);
  ASSERT_TRUE(out.wait([&] { return said("no grid: "); }));
  const std::lock_guard lock(out.mutex);
  EXPECT_TRUE(said("localize_only makes no keyframes"));
  EXPECT_FALSE(said("the floor has not been seen"));
}

TEST_F(SlamCoreTest, AFullQueueDropsTheOldestAndCounts) {
  const auto core = start({{"queue_size", int64_t{4}}});
  core->camera_info(info_of(source_camera()));
  feed_all(*core, 0, 1);
  std::promise<void> held, go_on;
  core->pause(false, [&](const Answer&) {
    held.set_value();
    go_on.get_future().wait();
  });
  held.get_future().wait();
  for (size_t i = 1; i <= 10; ++i) feed(*core, i);
  go_on.set_value();
  ASSERT_TRUE(out.wait([&] { return out.odometry.size() == 5; }));
  EXPECT_EQ(out.odometry[1].pose.stamp_ns, frames()[7].stamp_ns());
  ASSERT_TRUE(out.wait([&] { return out.last_value("dropped") == "6"; }));
}

TEST_F(SlamCoreTest, MapToOdomGoesOnTopOfTheRobotsOdometry) {
  const auto core = start({{"publish_odom_tf", false}});
  core->camera_info(info_of(source_camera()));
  const Rigid3 odom_from_base(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), {3, 1, 0});
  out.known_transforms["odom base_link"] = odom_from_base;
  for (size_t i = 0; i < 3; ++i) {
    feed(*core, i);
    ASSERT_TRUE(out.wait([&] { return out.transforms.size() == i + 1; }));
  }
  ASSERT_EQ(out.transforms.back().size(), 1u);
  EXPECT_EQ(out.transforms.back()[0].child, "odom");
  const Rigid3 error = out.poses.back().pose.inverse() * (out.transforms.back()[0].parent_from_child * odom_from_base);
  EXPECT_LT(error.translation.norm(), 1e-9);
  EXPECT_TRUE(out.odometry.empty()) << "that is the robot's";
}

TEST_F(SlamCoreTest, StampsThatGoBackBeginANewWorld) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  for (size_t i = 0; i < 5; ++i) feed_at(*core, i, 100'000'000'000);
  ASSERT_TRUE(out.wait([&] { return out.odometry.size() == 5; }));
  for (size_t i = 0; i < 8; ++i) feed_at(*core, i, 0);
  ASSERT_TRUE(out.wait([&] { return out.odometry.size() >= 10; }));
  EXPECT_LT(out.odometry[5].pose.pose.translation.norm(), 1e-6);
}

TEST_F(SlamCoreTest, StampsThatGoBackKeepAMapThatWasLoaded) {
  const std::string file = testing::TempDir() + "dkb_ros_core_test_jump.dkb";
  {
    const auto mapping = start();
    mapping->camera_info(info_of(source_camera()));
    feed_all(*mapping, 0, 10);
    ASSERT_TRUE(answer_of([&](auto done) { mapping->save_map(file, done); }).success);
  }
  const auto core = start({{"load_map", file}, {"localize_only", true}, {"queue_size", int64_t{100}}});
  core->camera_info(info_of(source_camera()));
  const auto found_after = [&](int64_t offset_ns) {
    return out.wait([&] {
      return !out.odometry.empty() && out.odometry.back().pose.stamp_ns >= frames()[3].stamp_ns() + offset_ns &&
             out.odometry.back().pose.stamp_ns <= frames()[9].stamp_ns() + offset_ns;
    });
  };
  out.odometry.clear();
  for (size_t i = 0; i < 10; ++i) feed_at(*core, i, 100'000'000'000);
  ASSERT_TRUE(found_after(100'000'000'000));
  for (size_t i = 0; i < 10; ++i) feed_at(*core, i, 0);
  ASSERT_TRUE(found_after(0));
  const std::lock_guard lock(out.mutex);
  EXPECT_TRUE(std::any_of(out.logged.begin(), out.logged.end(),
                          [&](const std::string& line) { return line.find("again in " + file) != std::string::npos; }));
  std::filesystem::remove(file);
}

TEST_F(SlamCoreTest, WheelOdometryBecomesThePriorOfTheFrames) {
  const auto core = start();
  core->camera_info(info_of(source_camera()));
  for (size_t i = 0; i < 6; ++i) {
    OdometryMessage odometry;
    odometry.stamp_ns = frames()[i].stamp_ns();
    odometry.child_frame_id = "base_link";
    core->odometry(odometry);
    feed_all(*core, i, 1);
  }
  ASSERT_TRUE(out.wait([&] { return out.last_value("with prior") == "5"; }));
}

TEST_F(SlamCoreTest, MotionThatIsLeftOutIsToldOnce) {
  const auto core = start();
  ImuMessage without;
  without.covariance(0, 0) = -1;
  OdometryMessage same;
  for (int i = 0; i < 3; ++i) core->imu(without), core->odometry(same);
  const std::lock_guard lock(out.mutex);
  ASSERT_EQ(out.logged.size(), 2U);
  EXPECT_TRUE(out.logged[0].starts_with("imu: a message was left out"));
  EXPECT_TRUE(out.logged[1].starts_with("odom_prior: a message was left out"));
}

// The library joins what is told of the frames that are skipped.
TEST_F(SlamCoreTest, MotionsOfPausedFramesCountOnce) {
  const auto core = start({{"queue_size", int64_t{20}}});
  core->camera_info(info_of(source_camera()));
  const auto drive_to = [&](size_t i, double x) {
    OdometryMessage odometry;
    odometry.stamp_ns = frames()[i].stamp_ns();
    odometry.child_frame_id = "base_link";
    odometry.pose.translation.x() = x;
    core->odometry(odometry);
  };
  for (size_t i = 0; i < 4; ++i) {
    drive_to(i, 0);
    feed_all(*core, i, 1);
  }
  const Rigid3 before = out.odometry.back().pose.pose;
  EXPECT_TRUE(answer_of([&](auto done) { core->pause(true, done); }).success);
  for (size_t i = 4; i < 10; ++i) {
    drive_to(i, 0.02 * static_cast<double>(i - 3));
    feed(*core, i);
  }
  ASSERT_TRUE(out.wait([&] { return out.last_value("frames") == "10"; }));
  EXPECT_TRUE(answer_of([&](auto done) { core->pause(false, done); }).success);
  drive_to(10, 0.14);
  ImageMessage colour = message_of(frames()[10], false), depth = message_of(frames()[10], true);
  for (ImageMessage* dark : {&colour, &depth}) show_instead(std::make_shared<std::vector<uint8_t>>(dark->size), dark);
  core->colour(std::move(colour));
  core->depth(std::move(depth));
  ASSERT_TRUE(out.wait([&] { return out.odometry.size() == 5; }));
  EXPECT_NEAR((out.odometry.back().pose.pose.translation - before.translation).norm(), 0.14, 0.02);
}

}  // namespace
}  // namespace dkb_ros
