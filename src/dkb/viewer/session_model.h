// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dkb/viewer/map_deltas.h"
#include "dkb/viewer/session_history.h"
#include "dkb_slam/viewer.h"

namespace dkb {

// What is known of a session, and how it is told to any number of clients. One thread feeds and is never kept waiting;
// those who tell the clients take turns by hold().
class SessionModel {
 public:
  explicit SessionModel(const ViewerOptions& options);

  // --- The feeding thread.
  void show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events);
  void skipped(size_t frames);  // of the source, so far
  void say(const std::string& line);
  void end(MapSnapshot map);

  // --- Any thread.
  void set_paused(bool paused);
  uint64_t world() const { return world_; }  // the number of the world that clients are told of

  // --- Any thread that holds the lock.
  [[nodiscard]] std::unique_lock<std::mutex> hold() { return std::unique_lock(mutex_); }

  // Takes in what has been fed since the last time.
  void take_in();
  // Takes in the newest map, but not before `rest` times as long has passed as it took the last time: a large map takes
  // a while to compare.
  void take_in_map(int rest);

  // dense_messages.h; nothing of a world that is over.
  void take_dense(std::string messages, uint64_t world);

  struct Client {
    bool images = false, depth = false;  // wanted
    uint64_t frame = 0, dense = 0;
    MapDeltas::Client map = {};
    SessionHistory::Client history = {};
  };
  // Writes what the client does not know; of points some `budget` bytes at most.
  void write(Client& client, StreamWriter& out, size_t budget);

  int frame() const { return shown_ == nullptr ? -1 : shown_->result.frame; }  // the newest; -1 = none yet
  // The root of the map of this number, as FrameResult::map has it; none where the newest snapshot has no such map.
  KeyframeId root_of(int number) const;
  double seconds() const;  // of it, since the first
  bool ended() const { return ended_; }
  nlohmann::json state() const;

 private:
  struct Shown {
    FrameResult result;
    Frame frame;
    MapSnapshot map;
  };
  struct Handover {  // what the feeding thread has left since the last look
    std::shared_ptr<const Shown> latest;
    std::vector<FrameFact> facts;
    std::vector<SessionEvent> events;
    int offered = 0, tracked = 0, lost = 0;
    size_t skipped = 0;
    int64_t stamp_ns = 0;
    bool ended = false, paused = false;
  };

  void forget_world();
  KeyframeId root_of_frame() const;
  std::string hello() const;
  void write_truth(StreamWriter& out) const;
  void align_truth(const Map& map);
  const std::string& frame_message();
  const std::string& image_message(bool depth);

  const ViewerOptions options_;

  std::mutex handover_mutex_;  // guards the next
  Handover handover_;

  std::mutex mutex_;  // guards what follows
  std::shared_ptr<const Shown> shown_;
  uint64_t shown_number_ = 0;
  int offered_ = 0, tracked_ = 0, lost_ = 0;
  size_t skipped_ = 0;
  bool ended_ = false, paused_ = false;
  MapDeltas map_;
  std::atomic<uint64_t> world_;  // map_.world(), for those who do not hold the lock
  std::chrono::steady_clock::time_point map_taken_{};
  std::chrono::steady_clock::duration map_cost_{};
  SessionHistory history_;
  std::optional<Rigid3> world_from_truth_;
  // Of what it was computed: points of the path, the root of their map, corrections of it.
  size_t aligned_at_ = 0;
  KeyframeId aligned_root_ = kNoKeyframe;
  uint64_t aligned_corrections_ = 0;
  std::string dense_;
  uint64_t dense_number_ = 0;
  std::string frame_message_, image_messages_[2];
};

}  // namespace dkb
