// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "dkb/viewer/page_server.h"
#include "dkb/viewer/session_model.h"
#include "dkb/viewer/session_recorder.h"
#include "dkb_slam/viewer.h"

namespace dkb {

// A running session: told to the visitors of a page, to a file, or to both, each on a thread of its own.
class Session final : public Viewer, private HttpService {
 public:
  explicit Session(const ViewerOptions& options);
  ~Session() override;

  std::string url() const override;
  void show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) override;
  void skipped(size_t frames) override;
  void say(const std::string& line) override;
  void ended(MapSnapshot map) override;
  bool wants_dense_map() const override;
  void show_dense_map(std::function<DenseMap()> task) override;
  bool wait_turn(std::chrono::milliseconds patience) override;
  bool paused() const override;
  bool take_save_order() override;
  void wait_order(std::chrono::milliseconds patience) override;
  std::vector<std::string> take_warnings() override;

 private:
  class Stream;

  HttpAnswer answer(const HttpRequest& request) override;
  void tick(size_t streams) override;
  HttpAnswer obey(const std::string& body);
  void wake();

  const bool realtime_;
  SessionModel model_;

  mutable std::mutex mutex_;  // guards what visitors ask for
  std::condition_variable turn_;
  bool paused_ = false, save_ordered_ = false, over_ = false;
  int steps_ = 0;

  mutable std::mutex dense_mutex_;  // guards the next two
  bool making_dense_ = false;
  std::chrono::steady_clock::time_point next_dense_{};
  std::thread dense_;

  std::optional<SessionRecorder> recorder_;
  std::optional<PageServer> page_;
};

}  // namespace dkb
