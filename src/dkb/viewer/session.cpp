// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>

#include "dkb/map/map.h"
#include "dkb/util/thread_priority.h"
#include "dkb/viewer/page_files.h"
#include "dkb/viewer/reduced_image.h"

namespace dkb {
namespace {

using Json = nlohmann::json;

constexpr size_t kPointBudget = 1 << 20;  // [bytes] of points in one part of a stream
constexpr size_t kMaxHandedOver = 4096;   // facts and events that wait for the server's thread

AccessRules rules_of(const ViewerOptions& options) {
  AccessRules rules;
  if (is_loopback_name(options.host)) return rules;
  rules.any_address = options.host == "0.0.0.0" || options.host == "::";
  std::string name = options.host;
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  rules.host_names = {name.find(':') == std::string::npos ? name : "[" + name + "]"};
  rules.token = random_token();
  return rules;
}

double rounded(double value) {
  return std::isfinite(value) ? std::round(value * 1e5) / 1e5 : 0;
}
Json json_of(const Eigen::Vector3d& v) {
  return {rounded(v.x()), rounded(v.y()), rounded(v.z())};
}
Json json_of(const Rigid3& pose) {
  const Eigen::Vector4d q = pose.rotation.coeffs();
  return {rounded(q[0]),
          rounded(q[1]),
          rounded(q[2]),
          rounded(q[3]),
          rounded(pose.translation.x()),
          rounded(pose.translation.y()),
          rounded(pose.translation.z())};
}
Json json_of(const Box& box) {
  return {rounded(box.x), rounded(box.y), rounded(box.w), rounded(box.h)};
}
std::string text_of(const Json& json) {
  // Names that are no UTF-8 come from users' files.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

HttpAnswer json_answer(int status, const Json& json) {
  HttpAnswer answer;
  answer.status = status;
  answer.type = "application/json";
  answer.own_body = text_of(json);
  return answer;
}

FrameFact fact_of(const FrameResult& result, const MapSnapshot& map) {
  FrameFact fact;
  fact.frame = result.frame;
  fact.stamp_ns = result.stamp_ns;
  fact.tracking_ms = static_cast<float>(result.tracking_ms);
  fact.waiting_ms = static_cast<float>(result.waiting_ms);
  fact.inliers = static_cast<uint16_t>(std::clamp(result.inliers, 0, 65535));
  fact.state = result.state;
  fact.made_keyframe = result.keyframe;
  if (!result.world_from_cam || map.map() == nullptr || map.map()->keyframe_count() == 0) return fact;
  // The newest keyframes are not in the snapshot yet.
  fact.host = std::clamp(result.reference_keyframe, 0, map.map()->keyframe_count() - 1);
  fact.position_in_host = map.map()->cam_from_world(fact.host) * result.world_from_cam->translation;
  return fact;
}

void put_features(StreamWriter& m, const FrameResult& result) {
  m.put(static_cast<uint32_t>(result.features.size()));
  for (const FeatureReport& f : result.features) {
    const auto sixteenths = [](float v) { return static_cast<uint16_t>(std::clamp(v * 16, 0.0F, 65535.0F)); };
    m.put(sixteenths(f.image_x));
    m.put(sixteenths(f.image_y));
    m.put(static_cast<uint8_t>(f.state));
    m.put(static_cast<uint8_t>(f.reason));
    m.put<uint16_t>(0);
  }
}

void put_mask(StreamWriter& m, const MoverMask& mask) {
  m.put(static_cast<uint32_t>(mask.cell));
  m.put(static_cast<uint32_t>(mask.cells.width()));
  m.put(static_cast<uint32_t>(mask.cells.height()));
  std::string bits((mask.cells.size() + 7) / 8, '\0');
  for (size_t i = 0; i < mask.cells.size(); ++i)
    if (mask.cells.data()[i] != 0) bits[i / 8] = static_cast<char>(bits[i / 8] | (1 << (i % 8)));
  m.put_bytes(bits);
  m.pad();
}

}  // namespace

// One client's stream: what it knows, and whether it wants pictures.
class Session::Stream final : public HttpStream {
 public:
  Stream(Session& session, bool images, bool depth) : session_(session), images_(images), depth_(depth) {}

  std::string next() override {
    StreamWriter out;
    if (session_.map_.begun_anew(map_)) {
      history_ = {};
      frame_ = 0;
      out.message(StreamMessage::hello, [&](StreamWriter& m) { m.put_bytes(session_.hello()); });
      out.message(StreamMessage::truth, [&](StreamWriter& m) {
        const auto& truth = session_.options_.truth;
        const size_t step = std::max<size_t>(1, truth.size() / 5000);
        for (size_t i = 0; i < truth.size(); i += step) {
          m.put(static_cast<float>(static_cast<double>(truth[i].stamp_ns - truth[0].stamp_ns) * 1e-9));
          for (int k = 0; k < 3; ++k) m.put(static_cast<float>(truth[i].position[k]));
        }
      });
    }
    session_.map_.write(map_, out, kPointBudget);
    session_.history_.write(history_, out);
    if (frame_ != session_.shown_number_) {
      frame_ = session_.shown_number_;
      out.put_bytes(session_.frame_message());
      if (images_) out.put_bytes(session_.image_message(false));
      if (depth_) out.put_bytes(session_.image_message(true));
    }
    const auto now = std::chrono::steady_clock::now();
    if (out.size() == 0 && now - last_ > std::chrono::seconds(1)) out.empty_message(StreamMessage::heartbeat);
    if (out.size() > 0) last_ = now;
    return std::move(out.bytes());
  }

 private:
  Session& session_;
  const bool images_, depth_;
  uint64_t frame_ = 0;
  MapDeltas::Client map_;
  SessionHistory::Client history_;
  std::chrono::steady_clock::time_point last_{};
};

Session::Session(ViewerOptions options)
    : options_(std::move(options)),
      rules_(rules_of(options_)),
      map_(options_.camera.depth_max > 30 ? 0.01 : 0.001),
      server_(options_.host, options_.port, rules_, *this),
      thread_([this] {
        set_thread_priority(ThreadPriority::background);
        try {
          server_.run();
        } catch (const std::exception&) {
          // Out of memory, most likely: the page ends, the run goes on.
        }
      }) {}

Session::~Session() {
  server_.stop();
  thread_.join();
}

std::string Session::url() const {
  std::string host = options_.host;
  if (is_loopback_name(host))
    host = host == "::1" ? "[::1]" : host == "localhost" ? host : "127.0.0.1";
  else if (host.find(':') != std::string::npos)
    host = "[" + host + "]";
  return fmt::format("http://{}:{}/{}", host, server_.port(), rules_.token.empty() ? "" : "#token=" + rules_.token);
}

void Session::show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) {
  const FrameFact fact = fact_of(result, map);
  auto latest = std::make_shared<const ShownFrame>(ShownFrame{std::move(result), std::move(frame), std::move(map)});
  {
    const std::lock_guard lock(mutex_);
    handover_.latest.swap(latest);  // the one before it is let go of outside of the lock
    handover_.offered = fact.frame + 1;
    handover_.tracked += handover_.latest->result.tracked() ? 1 : 0;
    handover_.lost += fact.state == TrackingState::lost ? 1 : 0;
    if (handover_.facts.size() < kMaxHandedOver) handover_.facts.push_back(fact);
    for (Event& e : events)
      if (handover_.events.size() < kMaxHandedOver)
        handover_.events.push_back({name_of(e.kind),
                                    e.kind == Event::Kind::keyframe && e.text.empty()
                                        ? handover_.latest->result.keyframe_explanation
                                        : std::move(e.text),
                                    e.frame});
  }
  server_.wake();
}

void Session::say(const std::string& line) {
  {
    const std::lock_guard lock(mutex_);
    if (handover_.events.size() < kMaxHandedOver) handover_.events.push_back({"note", line, handover_.offered - 1});
  }
  server_.wake();
}

void Session::ended() {
  {
    const std::lock_guard lock(mutex_);
    handover_.ended = true;
    paused_ = false;
    handover_.events.push_back({"note", "the run has ended", handover_.offered - 1});
  }
  server_.wake();
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
  const auto refused = [](int status, const std::string& why) { return json_answer(status, {{"error", why}}); };
  const bool get = request.method == "GET";
  if (request.path == "/api/command") return get ? refused(405, "POST it") : obey(request.body);
  if (!get) return refused(405, "GET it");
  if (request.path == "/api/state") {
    take_handover();
    return json_answer(200, state());
  }
  HttpAnswer answer;
  if (request.path == "/api/stream") {
    answer.type = "application/octet-stream";
    answer.stream = std::make_unique<Stream>(*this, request.asks_for("images"), request.asks_for("depth"));
    return answer;
  }
  const PageFile* file = page_file(request.path == "/index.html" ? "/" : request.path);
  if (file == nullptr) return refused(404, "there is no such page");
  answer.type = file->type;
  answer.body = file->bytes;
  return answer;
}

HttpAnswer Session::obey(const std::string& body) {
  const Json order = Json::parse(body, nullptr, false);
  const auto what = order.is_object() ? order.find("do") : order.end();
  if (!order.is_object() || what == order.end() || !what->is_string())
    return json_answer(400, {{"error", "expected {\"do\": \"pause\"}"}});
  const std::string& word = what->get_ref<const std::string&>();
  {
    const std::lock_guard lock(mutex_);
    if (word == "pause" || word == "step") {
      if (!handover_.ended) paused_ = true;
      if (word == "step" && !handover_.ended) steps_ = std::min(steps_ + 1, 100);
    } else if (word == "resume") {
      paused_ = false;
      steps_ = 0;
    } else if (word == "save_map") {
      save_ordered_ = true;
    } else {
      return json_answer(400, {{"error", "do what? pause, resume, step or save_map"}});
    }
  }
  turn_.notify_all();
  server_.wake();
  return json_answer(200, {{"ok", true}});
}

void Session::take_handover() {
  Handover taken;
  bool paused = false;
  {
    const std::lock_guard lock(mutex_);
    taken.facts.swap(handover_.facts);
    taken.events.swap(handover_.events);
    taken.latest = handover_.latest;
    taken.offered = handover_.offered;
    taken.tracked = handover_.tracked;
    taken.lost = handover_.lost;
    taken.ended = handover_.ended;
    paused = paused_;
  }
  for (const FrameFact& fact : taken.facts) history_.add(fact);
  for (SessionEvent& event : taken.events) history_.add(std::move(event));
  if (taken.latest != shown_ || taken.ended != ended_ || paused != was_paused_) {
    shown_ = std::move(taken.latest);
    ++shown_number_;
    frame_message_.clear();
    for (std::string& message : image_messages_) message.clear();
  }
  offered_ = taken.offered;
  tracked_ = taken.tracked;
  lost_ = taken.lost;
  ended_ = taken.ended;
  was_paused_ = paused;
}

void Session::tick(size_t streams) {
  take_handover();
  const auto now = std::chrono::steady_clock::now();
  if (streams == 0 || shown_ == nullptr || now < next_map_update_) return;
  map_.update(shown_->map);
  // A tenth of this thread's time at most: a large map takes a while to compare.
  next_map_update_ = now + 10 * (std::chrono::steady_clock::now() - now);
}

Json Session::state() const {
  const FrameResult none;
  const FrameResult& result = shown_ == nullptr ? none : shown_->result;
  const Map* map = shown_ == nullptr ? nullptr : shown_->map.map().get();
  return {{"frame", shown_ == nullptr ? -1 : result.frame},
          {"frames", options_.frames ? std::max(static_cast<int>(*options_.frames), offered_) : offered_},
          {"tracked", tracked_},
          {"lost", lost_},
          {"state", name_of(result.state)},
          {"inliers", result.inliers},
          {"keyframes", map == nullptr ? 0 : map->live_keyframe_count()},
          {"map_points", map == nullptr ? 0 : map->point_count()},
          {"loops", shown_ == nullptr ? 0 : shown_->map.loops().size()},
          {"movers", result.movers.size()},
          {"tracking_ms", rounded(result.tracking_ms)},
          {"paused", was_paused_},
          {"ended", ended_}};
}

std::string Session::hello() const {
  const Camera& c = options_.camera;
  return text_of(
      {{"protocol", 1},
       {"version", DKB_SLAM_VERSION},
       {"source", options_.description},
       {"realtime", options_.realtime},
       {"budget_ms", rounded(options_.budget_ms)},
       {"unit", map_.unit()},
       {"camera", {{"width", c.width}, {"height", c.height}, {"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}}}});
}

const std::string& Session::frame_message() {
  if (!frame_message_.empty() || shown_ == nullptr) return frame_message_;
  const FrameResult& result = shown_->result;
  Json json = {{"state", state()}, {"explanation", result.keyframe_explanation}};
  if (result.world_from_cam) json["camera"] = json_of(*result.world_from_cam);
  json["movers"] = Json::array();
  for (const Mover& m : result.movers)
    json["movers"].push_back({{"id", m.id},
                              {"class", m.class_name},
                              {"position", json_of(m.position_in_world)},
                              {"velocity", json_of(m.velocity_in_world)},
                              {"size", json_of(m.size)},
                              {"box", json_of(m.box)}});
  json["boxes"] = Json::array();
  for (const Detection& d : result.detections)
    json["boxes"].push_back({{"class", d.class_name}, {"box", json_of(d.box)}});
  if (!options_.truth.empty() && shown_->map.map() != nullptr) {
    // It settles soon, and a long path takes a while.
    if (!world_from_truth_ || history_.path_size() > aligned_at_ + aligned_at_ / 50 + 10) {
      world_from_truth_ = history_.world_from_truth(*shown_->map.map(), options_.truth);
      aligned_at_ = history_.path_size();
    }
    if (world_from_truth_) json["world_from_truth"] = json_of(*world_from_truth_);
  }
  std::string text = text_of(json);
  text.append((4 - text.size() % 4) % 4, ' ');
  StreamWriter out;
  out.message(StreamMessage::frame, [&](StreamWriter& m) {
    m.put(static_cast<uint32_t>(text.size()));
    m.put_bytes(text);
    put_features(m, result);
    put_mask(m, result.mask);
  });
  return frame_message_ = std::move(out.bytes());
}

const std::string& Session::image_message(bool depth) {
  std::string& message = image_messages_[depth ? 1 : 0];
  if (!message.empty() || shown_ == nullptr) return message;
  const std::string jpeg = depth ? reduced_depth(shown_->frame) : reduced_picture(shown_->frame);
  StreamWriter out;
  out.message(StreamMessage::image, [&](StreamWriter& m) {
    m.put(static_cast<uint32_t>(shown_->result.frame));
    m.put<uint32_t>(depth ? 1 : 0);
    m.put_bytes(jpeg);
  });
  return message = std::move(out.bytes());
}

}  // namespace dkb

extern "C" __attribute__((visibility("default"))) dkb::Viewer* dkb_open_viewer_1(const dkb::ViewerOptions& options,
                                                                                 std::string* error) {
  try {
    return new dkb::Session(options);
  } catch (const std::exception& e) {
    *error = e.what();
  }
  return nullptr;
}
