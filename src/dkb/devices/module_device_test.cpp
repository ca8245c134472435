// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/module_device.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

TEST(DeviceModules, WhatWasNotBuiltInSaysSoWithTheRemedy) {
  const DeviceModule module{"nonesuch", "libdkb_nonesuch.so", "Nonesuch", "install it and build again"};
  const std::string why =
      "this build has no Nonesuch (libdkb_nonesuch.so is not installed beside it); install it and "
      "build again";
  EXPECT_EQ(why_no_module(module), why);
  EXPECT_EQ(test::input_error_of([&] { open_module_device(module, "nonesuch:1", {}); }), "nonesuch:1: " + why);
}

// What each frame shows: the first letter of its camera's name, ! where the camera was gone, ? where it does not fit.
std::string play_scripted(const char* cameras) {
  ::setenv("DKB_TEST_CAMERAS", cameras, 1);
  const DeviceModule module{"scripted", "libdkb_scripted_device.so", "", ""};
  devices_of(module);  // the script begins
  SourceOptions options;
  options.max_frames = 4;
  const auto source = open_module_device(module, "scripted", options);
  std::string shown;
  for (SourceFrame f = source->next(); f.state != SourceState::ended; f = source->next())
    shown += f.state == SourceState::unplugged ? '!'
             : f.state == SourceState::frame   ? static_cast<char>(*f.frame.grey().row(0))
                                               : '?';
  return shown;
}

TEST(DeviceModules, TheFirstCameraIsWaitedForWhenItIsUnplugged) {
  EXPECT_EQ(play_scripted("a/32 b/32"), "aa!aa") << "not another one, which is the first now";
}

TEST(DeviceModules, WithoutASerialNumberACameraThatTellsOtherNumbersIsAnother) {
  EXPECT_EQ(play_scripted("/32 /16 /32"), "xx!xx");
}

// Debian's OpenNI 2 brings a driver that draws two moving discs.
TEST(DeviceModules, OpenNi2PlaysItsDummy) {
  if (const std::string why = why_no_module(openni2_module()); !why.empty()) GTEST_SKIP() << "skipped: " << why;
  EXPECT_NO_THROW(devices_of(openni2_module()));
  EXPECT_NE(test::input_error_of([] {
              open_module_device(openni2_module(), "openni2:/no/such/camera", {});
            }).find("openni2:/no/such/camera: OpenNI 2 finds no such camera"),
            std::string::npos);
  const std::string error = test::input_error_of([] { open_module_device(openni2_module(), "openni2:Dummy", {}); });
  if (error.find("finds no such camera") != std::string::npos) GTEST_SKIP() << "skipped: no dummy driver";
  EXPECT_EQ(error, "openni2:Dummy: does not tell its camera; give --camera FILE");
  SourceOptions options;
  options.fallback_camera.emplace();
  options.fallback_camera->width = 320, options.fallback_camera->height = 240,
  options.fallback_camera->depth_factor = 1000;
  options.max_frames = 10;
  const auto source = open_module_device(openni2_module(), "openni2:Dummy", options);
  int frames = 0;
  int64_t last = 0;
  for (SourceFrame f = source->next(); f.state != SourceState::ended; f = source->next()) {
    ASSERT_EQ(f.state, SourceState::frame) << f.note;
    EXPECT_GT(f.frame.stamp_ns(), last);
    last = f.frame.stamp_ns();
    EXPECT_EQ(static_cast<const float*>(f.frame.depth().data)[5], 2.0F) << "its top row is at 2 m";
    ++frames;
  }
  EXPECT_EQ(frames, 10);
}

}  // namespace
}  // namespace dkb
