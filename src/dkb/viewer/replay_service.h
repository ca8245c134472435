// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include "dkb/viewer/http_server.h"
#include "dkb/viewer/session_file.h"

namespace dkb {

// Answers what the page asks of recorded sessions; the page itself plays them.
//   GET /api/sessions                    JSON: what there is, and where one may begin
//   GET /api/session?n=0&from=0&to=1000  bytes of session n's file
class ReplayService {
 public:
  static constexpr uint64_t kMaxRange = 4 << 20;  // [bytes] of an answer; the rest of what was asked for is left out

  explicit ReplayService(const std::vector<std::filesystem::path>& files);  // throws InputError

  HttpAnswer answer(const HttpRequest& request);  // status 404 where it knows nothing of the path

 private:
  std::string state();
  std::string list();
  HttpAnswer range(const HttpRequest& request);

  struct Recording {
    explicit Recording(const std::filesystem::path& path);
    std::string name;  // of its run
    SessionFile file;
  };
  std::deque<Recording> recordings_;
};

}  // namespace dkb
