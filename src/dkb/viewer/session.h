// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <thread>

#include "dkb/viewer/http_server.h"
#include "dkb/viewer/map_deltas.h"
#include "dkb/viewer/session_history.h"
#include "dkb/viewer/viewer.h"

namespace dkb {

// What the feeding thread has last handed over.
struct ShownFrame {
  FrameResult result;
  Frame frame;
  MapSnapshot map;
};

// The session behind the page: takes what it is shown, answers requests and feeds the streams, all on one thread but
// for what Viewer's functions hand over.
class Session final : public Viewer, private HttpService {
 public:
  explicit Session(ViewerOptions options);
  ~Session() override;

  std::string url() const override;
  void show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) override;
  void say(const std::string& line) override;
  void ended() override;
  bool wait_turn(std::chrono::milliseconds patience) override;
  bool paused() const override;
  bool take_save_order() override;
  void wait_order(std::chrono::milliseconds patience) override;

 private:
  class Stream;
  struct Handover {  // what the feeding thread has left since the last look
    std::shared_ptr<const ShownFrame> latest;
    std::vector<FrameFact> facts;
    std::vector<SessionEvent> events;
    int offered = 0, tracked = 0, lost = 0;
    bool ended = false;
  };

  HttpAnswer answer(const HttpRequest& request) override;
  void tick(size_t streams) override;
  HttpAnswer obey(const std::string& body);
  void take_handover();
  nlohmann::json state() const;
  std::string hello() const;
  const std::string& frame_message();
  const std::string& image_message(bool depth);

  const ViewerOptions options_;
  const AccessRules rules_;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable turn_;
  Handover handover_;
  bool paused_ = false, save_ordered_ = false;
  int steps_ = 0;

  // The server thread's own.
  std::shared_ptr<const ShownFrame> shown_;
  uint64_t shown_number_ = 0;
  int offered_ = 0, tracked_ = 0, lost_ = 0;
  bool ended_ = false, was_paused_ = false;
  MapDeltas map_;
  std::chrono::steady_clock::time_point next_map_update_{};
  SessionHistory history_;
  std::optional<Rigid3> world_from_truth_;
  size_t aligned_at_ = 0;  // points of the path when it was computed
  std::string frame_message_, image_messages_[2];
  HttpServer server_;
  std::thread thread_;
};

}  // namespace dkb
