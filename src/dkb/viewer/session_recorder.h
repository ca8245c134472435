// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <thread>

#include "dkb/viewer/session_model.h"

namespace dkb {

// Writes a session to a file (session_file.h) on a thread of its own, as a client who wants all.
class SessionRecorder {
 public:
  // Throws OutputError. In real time the newest frame is written, else the map is looked at more often.
  SessionRecorder(SessionModel& model, const std::filesystem::path& file, bool realtime);
  ~SessionRecorder();  // writes what is left

  void wake();        // there is something new
  void wait_taken();  // until all that there was at the last wake() has been taken

 private:
  using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

  void run();
  bool write_news(bool last);  // false: there will be no more
  void write(const std::string& chunk);

  SessionModel& model_;
  const std::filesystem::path path_;
  const bool realtime_;
  File file_;
  SessionModel::Client client_;
  double seconds_ = 0;
  size_t since_checkpoint_ = 0, checkpoint_size_ = 0;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  uint64_t woken_ = 1, taken_ = 0;
  bool stopping_ = false, over_ = false;
  std::thread thread_;
};

}  // namespace dkb
