// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session.h"

#include <algorithm>
#include <exception>
#include <nlohmann/json.hpp>

#include "dkb/slam/viewer_module.h"
#include "dkb/util/errors.h"
#include "dkb/util/thread_priority.h"
#include "dkb/viewer/dense_messages.h"
#include "dkb/viewer/page_files.h"

namespace dkb {
namespace {

constexpr size_t kPointBudget = 1 << 20;  // [bytes] of points in one part of a stream
constexpr int kRest = 10;                 // a tenth of the thread's time may go into comparing maps

}  // namespace

// One client's stream.
class Session::Stream final : public HttpStream {
 public:
  Stream(SessionModel& model, bool images, bool depth) : model_(model) {
    client_.images = images;
    client_.depth = depth;
  }

  std::string next() override {
    StreamWriter out;
    {
      const auto lock = model_.hold();
      model_.write(client_, out, kPointBudget);
    }
    const auto now = std::chrono::steady_clock::now();
    if (out.size() == 0 && now - last_ > std::chrono::seconds(1)) out.empty_message(StreamMessage::heartbeat);
    if (out.size() > 0) last_ = now;
    return std::move(out.bytes());
  }

 private:
  SessionModel& model_;
  SessionModel::Client client_;
  std::chrono::steady_clock::time_point last_{};
};

Session::Session(const ViewerOptions& options) : realtime_(options.realtime), model_(options) {
  HttpService& service = *this;
  // The port first: where it is taken, an earlier recording is not emptied. Visitors come last, since they call into
  // the recorder.
  if (options.port) page_.emplace(options.host, *options.port, service);
  if (!options.record.empty()) recorder_.emplace(model_, options.record, options.realtime);
  if (page_) page_->start();
}

Session::~Session() {
  if (dense_.joinable()) dense_.join();
}

std::string Session::url() const {
  return page_ ? page_->url() : std::string();
}

void Session::wake() {
  if (recorder_) recorder_->wake();
  if (page_) page_->wake();
}

void Session::show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) {
  // Every frame of a dataset is recorded; a camera does not wait.
  if (recorder_ && !realtime_) recorder_->wait_taken();
  model_.show(std::move(result), std::move(frame), std::move(map), std::move(events));
  wake();
}

void Session::skipped(size_t frames) {
  model_.skipped(frames);
}

void Session::say(const std::string& line) {
  model_.say(line);
  wake();
}

void Session::ended(MapSnapshot map) {
  if (dense_.joinable()) dense_.join();  // so that a recording holds it
  {
    const std::lock_guard lock(mutex_);
    paused_ = false;
    over_ = true;
  }
  if (recorder_) recorder_->wait_taken();
  model_.set_paused(false);
  model_.end(std::move(map));
  wake();
  if (recorder_) recorder_->wait_taken();  // so that the last of what take_warnings() tells is known
}

std::vector<std::string> Session::take_warnings() {
  std::vector<std::string> warnings = recorder_ ? recorder_->take_warnings() : std::vector<std::string>();
  if (page_)
    for (std::string& line : page_->take_warnings()) warnings.push_back(std::move(line));
  return warnings;
}

bool Session::wants_dense_map() const {
  const std::lock_guard lock(dense_mutex_);
  return !making_dense_ && std::chrono::steady_clock::now() >= next_dense_;
}

void Session::show_dense_map(std::function<DenseMap()> task) {
  if (dense_.joinable()) dense_.join();
  {
    const std::lock_guard lock(dense_mutex_);
    making_dense_ = true;
  }
  // It is left out where that world ends meanwhile.
  dense_ = std::thread([this, task = std::move(task), world = model_.world()] {
    set_thread_priority(ThreadPriority::background);
    const auto start = std::chrono::steady_clock::now();
    try {
      const DenseMap map = task();
      KeyframeId root = kNoKeyframe;
      {
        const auto lock = model_.hold();
        model_.take_in();
        root = model_.root_of(map.map);
      }
      std::string messages = dense_messages(map, root);
      const auto lock = model_.hold();
      model_.take_dense(std::move(messages), world);
    } catch (const std::exception& e) {
      model_.say(std::string("no dense map: ") + e.what());
    }
    const auto end = std::chrono::steady_clock::now();
    {
      const std::lock_guard lock(dense_mutex_);
      making_dense_ = false;
      next_dense_ = end + std::max<std::chrono::steady_clock::duration>(10 * (end - start), std::chrono::seconds(1));
    }
    wake();
  });
}

bool Session::wait_turn(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  turn_.wait_for(lock, patience, [&] { return !paused_ || steps_ > 0 || save_ordered_; });
  if (!paused_) return true;
  if (steps_ == 0) return false;
  --steps_;
  return true;
}

bool Session::paused() const {
  const std::lock_guard lock(mutex_);
  return paused_;
}

bool Session::take_save_order() {
  const std::lock_guard lock(mutex_);
  return std::exchange(save_ordered_, false);
}

void Session::wait_order(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  turn_.wait_for(lock, patience, [&] { return save_ordered_; });
}

HttpAnswer Session::answer(const HttpRequest& request) {
  const bool get = request.method == "GET";
  if (request.path == "/api/command") return get ? refusal_answer(405, "POST it") : obey(request.body);
  if (!get) return refusal_answer(405, "GET it");
  if (request.path == "/api/state") {
    const auto lock = model_.hold();
    model_.take_in();
    return json_answer(200, model_.state().dump());
  }
  HttpAnswer answer;
  if (request.path == "/api/stream") {
    answer.type = "application/octet-stream";
    answer.stream = std::make_unique<Stream>(model_, request.asks_for("images"), request.asks_for("depth"));
    return answer;
  }
  const PageFile* file = page_file(request.path == "/index.html" ? "/" : request.path);
  if (file == nullptr) return refusal_answer(404, "there is no such page");
  answer.type = file->type;
  answer.body = file->bytes;
  return answer;
}

HttpAnswer Session::obey(const std::string& body) {
  const nlohmann::json order = nlohmann::json::parse(body, nullptr, false);
  const auto what = order.is_object() ? order.find("do") : order.end();
  if (!order.is_object() || what == order.end() || !what->is_string())
    return refusal_answer(400, "expected {\"do\": \"pause\"}");
  const std::string& word = what->get_ref<const std::string&>();
  {
    const std::lock_guard lock(mutex_);
    if (word == "pause" || word == "step") {
      if (!over_) paused_ = true;
      if (word == "step" && !over_) steps_ = std::min(steps_ + 1, 100);
    } else if (word == "resume") {
      paused_ = false;
      steps_ = 0;
    } else if (word == "save_map") {
      save_ordered_ = true;
    } else {
      return refusal_answer(400, "do what? pause, resume, step or save_map");
    }
    model_.set_paused(paused_);
  }
  turn_.notify_all();
  wake();
  return json_answer(200, R"({"ok":true})");
}

void Session::tick(size_t streams) {
  const auto lock = model_.hold();
  model_.take_in();
  if (streams > 0) model_.take_in_map(kRest);
}

}  // namespace dkb

extern "C" __attribute__((visibility("default"))) dkb::Viewer* dkb_open_viewer_5(const dkb::ViewerOptions& options,
                                                                                 dkb::ViewerRefusal* refusal) {
  try {
    return new dkb::Session(options);
  } catch (const dkb::OutputError& e) {
    *refusal = {e.what(), true};
  } catch (const std::exception& e) {
    *refusal = {e.what(), false};
  }
  return nullptr;
}
