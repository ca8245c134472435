// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "dkb/viewer/session_model.h"

namespace dkb {

// Writes a session to a file (session_file.h) on a thread of its own, as a client who wants all. When the disk is
// nearly full the recording ends with the last whole chunk, and the session goes on.
class SessionRecorder {
 public:
  // Throws OutputError. In real time the newest frame is written, else the map is looked at more often. `left_free`:
  // [bytes] of the disk that are not written to, since others need them.
  SessionRecorder(SessionModel& model, const std::filesystem::path& file, bool realtime,
                  uintmax_t left_free = uintmax_t{256} << 20);
  ~SessionRecorder();  // writes what is left

  void wake();                               // there is something new
  void wait_taken();                         // until all that there was at the last wake() has been taken
  std::vector<std::string> take_warnings();  // why the recording has ended, once

 private:
  using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

  void run();
  bool write_news(bool last);  // false: there will be no more
  void write(const std::string& chunk);
  void require_room(size_t bytes) const;

  SessionModel& model_;
  const std::filesystem::path path_;
  const bool realtime_;
  const uintmax_t left_free_;
  File file_;
  SessionModel::Client client_;
  double seconds_ = 0;
  uint64_t whole_ = 0;  // [bytes] of the file's whole chunks
  size_t since_checkpoint_ = 0, checkpoint_size_ = 0;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  uint64_t woken_ = 1, taken_ = 0;
  bool stopping_ = false, over_ = false;
  std::vector<std::string> warnings_;
  std::thread thread_;
};

}  // namespace dkb
