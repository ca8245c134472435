// SPDX-License-Identifier: Apache-2.0
/// \file
/// Watching a session: a live page in the browser, and files of sessions to be watched later.
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

/// What is shown, and to whom.
struct ViewerOptions {
  std::string host = "127.0.0.1";  ///< to bind; anything but a loopback name asks every visitor for a token
  std::optional<int> port = 8090;  ///< 0 = any free one; nothing = no page
  std::filesystem::path record;    ///< file to write the session to, which `dkb-slam view` replays; empty = none
  std::string description;         ///< of what is shown, one line
  Camera camera;                   ///< of the frames
  std::optional<size_t> frames;    ///< of the source, where it knows
  double budget_ms = 1000.0 / 30;  ///< [ms] that tracking may take for a frame
  bool realtime = false;           ///< as Options::realtime: a recording then never keeps show() waiting
  /// Where the camera truly was.
  struct TruePosition {
    int64_t stamp_ns = 0;               ///< of the position
    Eigen::Vector3d position{0, 0, 0};  ///< [m] in a world of its own
  };
  std::vector<TruePosition> truth;  ///< by stamp; may be empty
};

/// A live page in the browser, a recording of the session, or both, each on a thread of its own, told every frame's
/// result. It lives in a module, libdkb_viewer.so, that is loaded when it is asked for. One thread feeds:
///
///     const auto viewer = dkb::open_viewer(options);
///     ...
///     const auto save_if_asked = [&] {
///       if (viewer->take_save_order()) slam.save_map("map.dkb");
///     };
///     while (!viewer->wait_turn(std::chrono::seconds(1))) save_if_asked();  // a visitor has paused
///     save_if_asked();
///     dkb::FrameResult result = slam.process(frame);
///     viewer->show(result, frame, slam.map(), slam.take_events());
///
/// The results of Slam do not depend on it.
class DKB_SLAM_API Viewer {
 public:
  virtual ~Viewer() = default;
  virtual std::string url() const = 0;  ///< to open; holds the token where one is asked for; empty without a page

  /// A frame of the source, and what came of it. Hands over and returns: of frames that come faster than clients take
  /// them, the newest is shown. Only a recording that is not in real time takes every frame, and may keep this waiting.
  virtual void show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) = 0;
  /// Of the source's frames so far, those that there is no result of: unreadable or dropped ones.
  virtual void skipped(size_t frames) = 0;
  virtual void say(const std::string& line) = 0;  ///< one line for the list of events
  virtual void ended(MapSnapshot map) = 0;        ///< there will be no further frame; the map as it is at the end

  /// Whether the dense map on the page is due: Slam::dense_map_task() is wanted. Seldom enough that a tenth of one
  /// thread's time goes into it.
  virtual bool wants_dense_map() const = 0;
  /// Runs the task on a thread of its own. Who does not ask wants_dense_map() first waits for the task before.
  virtual void show_dense_map(std::function<DenseMap()> task) = 0;

  /// What visitors ask for. The feeding thread calls this before each frame: true when it may go on; false when the
  /// session is still paused after `patience`, or somebody wants the map saved: at once, until take_save_order() is
  /// called.
  virtual bool wait_turn(std::chrono::milliseconds patience) = 0;
  virtual bool paused() const = 0;                                  ///< a visitor has paused it
  virtual bool take_save_order() = 0;                               ///< somebody wants the map saved; once each time
  virtual void wait_order(std::chrono::milliseconds patience) = 0;  ///< until there is such an order

  /// What people should know since the last call, a line each: that the recording has ended before the session.
  virtual std::vector<std::string> take_warnings() = 0;
};

/// Throws InputError when the module is not installed, the port is taken or the file cannot be written.
DKB_SLAM_API std::unique_ptr<Viewer> open_viewer(const ViewerOptions& options);

}  // namespace dkb
