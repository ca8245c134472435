// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/replay_service.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "dkb/viewer/page_server.h"

namespace dkb {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

// By the run's folder.
std::string name_of(const fs::path& file) {
  const fs::path whole = fs::absolute(file).lexically_normal();
  return file.filename() == "session.dkbs" ? whole.parent_path().filename().string() : file.stem().string();
}

}  // namespace

ReplayService::Recording::Recording(const fs::path& path) : name(name_of(path)), file(path) {}

ReplayService::ReplayService(const std::vector<fs::path>& files) {
  for (const fs::path& file : files) recordings_.emplace_back(file);
}

HttpAnswer ReplayService::answer(const HttpRequest& request) {
  if (request.method != "GET") return refusal_answer(405, "GET it");
  for (Recording& r : recordings_) r.file.update();
  if (request.path == "/api/state") return json_answer(200, state());
  if (request.path == "/api/sessions") return json_answer(200, list());
  if (request.path == "/api/session") return range(request);
  return refusal_answer(404, "there is no such page");
}

std::string ReplayService::state() {
  const SessionFile& file = recordings_.front().file;
  return Json({{"replay", true},
               {"sessions", recordings_.size()},
               {"frame", file.frame()},
               {"frames", file.frames()},
               {"ended", file.ended()}})
      .dump();
}

std::string ReplayService::list() {
  Json list = Json::array();
  for (const Recording& r : recordings_) {
    Json entries = Json::array();
    for (const SessionFile::Entry& e : r.file.entries()) entries.push_back({e.seconds, e.frame, e.offset});
    list.push_back({{"name", r.name},
                    {"seconds", r.file.seconds()},
                    {"frames", r.file.frames()},
                    {"size", r.file.size()},
                    {"ended", r.file.ended()},
                    {"damaged", r.file.damaged()},
                    {"entries", std::move(entries)}});
  }
  return list.dump(-1, ' ', false, Json::error_handler_t::replace);
}

HttpAnswer ReplayService::range(const HttpRequest& request) {
  const auto n = request.number("n"), from = request.number("from"), to = request.number("to");
  if (!n || !from || !to || *n >= recordings_.size() || *from > *to)
    return refusal_answer(400, "expected n=SESSION&from=BYTE&to=BYTE");
  HttpAnswer answer;
  answer.type = "application/octet-stream";
  answer.own_body = recordings_[*n].file.read(*from, *from + std::min(*to - *from, kMaxRange));
  return answer;
}

}  // namespace dkb
