// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/frame.h"
#include "dkb_slam/map.h"
#include "dkb_slam/slam.h"

namespace dkb {

struct ViewerOptions {
  std::string host = "127.0.0.1";  // to bind; anything but a loopback name asks every visitor for a token
  std::optional<int> port = 8090;  // 0 = any free one; nothing = no page
  std::filesystem::path record;    // file to write the session to; empty = none
  std::string description;         // of what is shown, one line
  Camera camera;
  std::optional<size_t> frames;    // of the source, where it knows
  double budget_ms = 1000.0 / 30;  // [ms] that tracking may take for a frame
  bool realtime = false;
  struct TruePosition {
    int64_t stamp_ns = 0;
    Eigen::Vector3d position{0, 0, 0};  // [m] in a world of its own
  };
  std::vector<TruePosition> truth;  // by stamp; may be empty
};

// A live page in the browser, a recording of the session, or both, each on a thread of its own, told every frame's
// result. It lives in a module, libdkb_viewer.so, that a run without it never loads. One thread feeds.
class Viewer {
 public:
  virtual ~Viewer() = default;
  virtual std::string url() const = 0;  // to open; holds the token where one is asked for; empty without a page

  // A frame of the source, and what came of it. Hands over and returns: of frames that come faster than clients take
  // them, the newest is shown. Only a recording that is not in real time takes every frame, and may keep this waiting.
  virtual void show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) = 0;
  virtual void say(const std::string& line) = 0;  // one line for the list of events
  virtual void ended(MapSnapshot map) = 0;        // there will be no further frame; the map as it is at the end

  // What visitors ask for. The feeding thread calls wait_turn() before each frame: true when it may go on; false when
  // the session is still paused after `patience`.
  virtual bool wait_turn(std::chrono::milliseconds patience) = 0;
  virtual bool paused() const = 0;
  virtual bool take_save_order() = 0;                               // somebody wants the map saved; once for each time
  virtual void wait_order(std::chrono::milliseconds patience) = 0;  // until there is one
};

// The one symbol looked up in the module; the number changes with this header. Throws nothing: when it returns null,
// `error` says why.
using OpenViewer = Viewer* (*)(const ViewerOptions& options, std::string* error);
inline constexpr const char* kOpenViewerSymbol = "dkb_open_viewer_1";

}  // namespace dkb
