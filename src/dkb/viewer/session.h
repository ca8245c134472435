// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>

#include "dkb/viewer/page_server.h"
#include "dkb/viewer/session_model.h"
#include "dkb/viewer/session_recorder.h"
#include "dkb/viewer/viewer.h"

namespace dkb {

// A running session: told to the visitors of a page, to a file, or to both, each on a thread of its own.
class Session final : public Viewer, private HttpService {
 public:
  explicit Session(const ViewerOptions& options);

  std::string url() const override;
  void show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) override;
  void say(const std::string& line) override;
  void ended(MapSnapshot map) override;
  bool wait_turn(std::chrono::milliseconds patience) override;
  bool paused() const override;
  bool take_save_order() override;
  void wait_order(std::chrono::milliseconds patience) override;

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

  std::optional<SessionRecorder> recorder_;
  std::optional<PageServer> page_;
};

}  // namespace dkb
