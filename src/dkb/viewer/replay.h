// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dkb {

struct ReplayOptions {
  std::string host = "127.0.0.1";            // as of ViewerOptions
  int port = 8090;                           // 0 = any free one
  std::vector<std::filesystem::path> files;  // one or two, that a recorder has written or still writes
};

// The page of recorded sessions, served as long as it lives.
class Replay {
 public:
  virtual ~Replay() = default;
  virtual std::string url() const = 0;
};

// Looked up in the viewer's module, as OpenViewer is.
using OpenReplay = Replay* (*)(const ReplayOptions& options, std::string* error);
inline constexpr const char* kOpenReplaySymbol = "dkb_open_replay_1";

}  // namespace dkb
