// SPDX-License-Identifier: Apache-2.0
#include <exception>

#include "dkb/viewer/page_files.h"
#include "dkb/viewer/page_server.h"
#include "dkb/viewer/replay.h"
#include "dkb/viewer/replay_service.h"

namespace dkb {
namespace {

class ServedReplay final : public Replay, private HttpService {
 public:
  explicit ServedReplay(const ReplayOptions& options)
      : sessions_(options.files), server_(options.host, options.port, *this) {
    server_.start();
  }
  std::string url() const override { return server_.url(); }

 private:
  HttpAnswer answer(const HttpRequest& request) override {
    const PageFile* file = page_file(request.path == "/index.html" ? "/" : request.path);
    if (file == nullptr || request.method != "GET") return sessions_.answer(request);
    HttpAnswer answer;
    answer.type = file->type;
    answer.body = file->bytes;
    return answer;
  }
  void tick(size_t) override {}

  ReplayService sessions_;
  PageServer server_;
};

}  // namespace
}  // namespace dkb

extern "C" __attribute__((visibility("default"))) dkb::Replay* dkb_open_replay_1(const dkb::ReplayOptions& options,
                                                                                 std::string* error) {
  try {
    return new dkb::ServedReplay(options);
  } catch (const std::exception& e) {
    *error = e.what();
  }
  return nullptr;
}
