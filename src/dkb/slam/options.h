// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "dkb/dense/dense_options.h"
#include "dkb/features/orb_extractor.h"
#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/keyframes/adaptive_policy.h"
#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/mapping/local_mapper.h"
#include "dkb/slam/loop_stage.h"
#include "dkb/slam/scene_stage.h"
#include "dkb/tracking/tracker.h"
#include "dkb_slam/options.h"

namespace dkb {

// How the stages run. None of it changes a dataset run's result, except mapper_latency.
struct PipelineOptions {
  bool threaded = true;         // mapping on its own thread; false: the same bytes from one thread
  bool realtime = false;        // never wait for mapping; take its results when they are there
  double mapper_latency = 0.1;  // [s] after which mapping becomes visible to tracking, in whole frames, > 0
  int mapper_queue = 4;         // [keyframes] waiting for mapping at most in a real-time run, >= 1
};

// What the stages are made from.
struct SlamOptions {
  OrbOptions features{.count = 900, .levels = 7};
  DepthOptions depth;
  SensorNoise noise;
  TrackingOptions tracking;
  KeyframePolicyKind keyframe_policy = KeyframePolicyKind::adaptive;
  AdaptiveKeyframeOptions adaptive_keyframes;
  MappingOptions mapping;
  LoopStageOptions loop_closing;
  bool estimate_timing = true;    // readout and depth_time_offset, where the camera's file does not tell them
  bool final_ba = false;          // adjust the whole map once more at the end
  bool smooth_trajectory = true;  // let the poses of the final trajectory smooth each other
  DynamicsOptions dynamics;
  DenseOptions dense;
  bool dense_map = false;  // keep what the dense map is made of
  PipelineOptions pipeline;
  uint64_t seed = 1;     // of every source of randomness in the run
  Rigid3 base_from_cam;  // mount: the world is the robot's base at the first tracked frame
};

// The stages' options: those of the preset, then the settings, then the experiments.
SlamOptions expand(const Options& options);

// Every setting as a row of docs/settings.md.
std::string settings_table();

}  // namespace dkb
