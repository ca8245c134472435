// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_model.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "dkb/map/map.h"
#include "dkb/viewer/reduced_image.h"

namespace dkb {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxHandedOver = 4096;  // facts and events that nobody has taken in yet

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

FrameFact fact_of(const FrameResult& result, const MapSnapshot& map) {
  FrameFact fact;
  fact.frame = result.frame;
  fact.stamp_ns = result.stamp_ns;
  fact.tracking_ms = static_cast<float>(result.tracking_ms);
  fact.inliers = static_cast<uint16_t>(std::clamp(result.inliers, 0, 65535));
  fact.state = result.state;
  fact.made_keyframe = result.keyframe;
  fact.stages = result.stages;
  if (!result.world_from_cam || map.map() == nullptr || map.map()->keyframe_count() == 0) return fact;
  // The newest keyframes are not in the snapshot yet.
  fact.host = std::clamp(result.reference_keyframe, 0, map.map()->keyframe_count() - 1);
  // Nor is the first one of a new map, and keyframes of the map before lie in another world.
  if (fact.host != result.reference_keyframe &&
      map_number(map.map()->roots(), map.map()->root(fact.host)) != result.map) {
    fact.host = kNoKeyframe;
    return fact;
  }
  fact.position_in_host = map.map()->cam_from_world(fact.host) * result.world_from_cam->translation;
  return fact;
}

// [px] In which features are told: 16 bits reach over the image, however large.
double feature_unit(const Camera& camera) {
  return std::max({camera.width, camera.height, 1}) / 65536.0;
}

void put_features(StreamWriter& m, const FrameResult& result, double unit) {
  m.put(static_cast<uint32_t>(result.features.size()));
  const auto in_units = [&](float v) { return static_cast<uint16_t>(std::clamp(v / unit, 0.0, 65535.0)); };
  for (const FeatureReport& f : result.features) {
    m.put(in_units(f.image_x));
    m.put(in_units(f.image_y));
    m.put(static_cast<uint8_t>(f.state));
    m.put(static_cast<uint8_t>(f.reason));
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

SessionModel::SessionModel(const ViewerOptions& options)
    : options_(options), map_(options_.camera.depth_max > 30 ? 0.01 : 0.001), world_(map_.world()) {}

void SessionModel::show(FrameResult result, Frame frame, MapSnapshot map, std::vector<Event> events) {
  const FrameFact fact = fact_of(result, map);
  auto latest = std::make_shared<const Shown>(Shown{std::move(result), std::move(frame), std::move(map)});
  const std::lock_guard lock(handover_mutex_);
  handover_.latest.swap(latest);
  handover_.offered = fact.frame + 1;
  handover_.stamp_ns = fact.stamp_ns;
  handover_.tracked += handover_.latest->result.tracked() ? 1 : 0;
  handover_.lost += fact.state == TrackingState::lost ? 1 : 0;
  if (handover_.facts.size() < kMaxHandedOver) handover_.facts.push_back(fact);
  for (Event& e : events)
    if (handover_.events.size() < kMaxHandedOver)
      handover_.events.push_back({name_of(e.kind),
                                  e.kind == Event::Kind::keyframe && e.text.empty()
                                      ? handover_.latest->result.keyframe_explanation
                                      : std::move(e.text),
                                  e.frame, e.stamp_ns});
}

void SessionModel::skipped(size_t frames) {
  const std::lock_guard lock(handover_mutex_);
  handover_.skipped = frames;
}

void SessionModel::say(const std::string& line) {
  const std::lock_guard lock(handover_mutex_);
  if (handover_.events.size() < kMaxHandedOver)
    handover_.events.push_back({"note", line, handover_.offered - 1, handover_.stamp_ns});
}

void SessionModel::end(MapSnapshot map) {
  const std::lock_guard lock(handover_mutex_);
  if (handover_.latest != nullptr) {
    Shown last = *handover_.latest;
    last.map = std::move(map);
    handover_.latest = std::make_shared<const Shown>(std::move(last));
  }
  handover_.ended = true;
  handover_.events.push_back({"note", "the run has ended", handover_.offered - 1, handover_.stamp_ns});
}

void SessionModel::set_paused(bool paused) {
  const std::lock_guard lock(handover_mutex_);
  handover_.paused = paused;
}

void SessionModel::take_in() {
  Handover taken;
  {
    const std::lock_guard lock(handover_mutex_);
    taken = handover_;
    handover_.facts.clear();
    handover_.events.clear();
  }
  for (FrameFact& fact : taken.facts) history_.add(std::move(fact));
  for (SessionEvent& event : taken.events) history_.add(std::move(event));
  if (taken.latest != shown_ || taken.ended != ended_ || taken.paused != paused_) {
    // The pictures are still those of a frame that was only told to be paused.
    if (taken.latest == nullptr || shown_ == nullptr || taken.latest->result.frame != shown_->result.frame)
      for (std::string& message : image_messages_) message.clear();
    shown_ = std::move(taken.latest);
    ++shown_number_;
    frame_message_.clear();
  }
  offered_ = taken.offered;
  skipped_ = taken.skipped;
  tracked_ = taken.tracked;
  lost_ = taken.lost;
  ended_ = taken.ended;
  paused_ = taken.paused;
}

void SessionModel::take_in_map(int rest) {
  const auto now = std::chrono::steady_clock::now();
  if (shown_ == nullptr || (!ended_ && now < map_taken_ + rest * map_cost_)) return;
  map_.update(shown_->map);
  if (map_.world() != world_) forget_world();
  map_taken_ = std::chrono::steady_clock::now();
  map_cost_ = map_taken_ - now;
}

// What hung on the keyframes of the world before, or lay in it.
void SessionModel::forget_world() {
  world_ = map_.world();
  history_.clear_path();
  world_from_truth_.reset();
  aligned_at_ = 0;
  frame_message_.clear();
  dense_.clear();
  ++dense_number_;
}

double SessionModel::seconds() const {
  return shown_ == nullptr ? 0 : history_.seconds_of(shown_->result.stamp_ns);
}

void SessionModel::write(Client& client, StreamWriter& out, size_t budget) {
  if (map_.begun_anew(client.map)) {
    client.history = {};
    client.frame = client.dense = 0;
    out.message(StreamMessage::hello, [&](StreamWriter& m) { m.put_bytes(hello()); });
    write_truth(out);
  }
  map_.write(client.map, out, budget);
  history_.write(client.history, out, map_.keyframe_count());
  if (client.dense != dense_number_) out.put_bytes(dense_);
  client.dense = dense_number_;
  if (client.frame == shown_number_) return;
  client.frame = shown_number_;
  out.put_bytes(frame_message());
  if (client.images) out.put_bytes(image_message(false));
  if (client.depth) out.put_bytes(image_message(true));
}

void SessionModel::take_dense(std::string messages, uint64_t world) {
  if (world != world_) return;
  dense_ = std::move(messages);
  ++dense_number_;
}

void SessionModel::write_truth(StreamWriter& out) const {
  out.message(StreamMessage::truth, [&](StreamWriter& m) {
    const auto& truth = options_.truth;
    const size_t step = std::max<size_t>(1, truth.size() / 5000);
    for (size_t i = 0; i < truth.size(); i += step) {
      for (int k = 0; k < 3; ++k) m.put(static_cast<float>(truth[i].position[k]));
    }
  });
}

Json SessionModel::state() const {
  const FrameResult none;
  const FrameResult& result = shown_ == nullptr ? none : shown_->result;
  const Map* map = shown_ == nullptr ? nullptr : shown_->map.map().get();
  // Frames are counted as the system is given them: of the source's those that it was never given are taken off.
  const int expected = static_cast<int>(options_.frames.value_or(0)) - static_cast<int>(skipped_);
  return {{"frame", shown_ == nullptr ? -1 : result.frame},
          {"frames", std::max(expected, offered_)},
          {"tracked", tracked_},
          {"lost", lost_},
          {"state", name_of(result.state)},
          {"inliers", result.inliers},
          {"keyframes", map == nullptr ? 0 : map->live_keyframe_count()},
          {"map_points", map == nullptr ? 0 : map->point_count()},
          {"loops", shown_ == nullptr ? 0 : shown_->map.loops().size()},
          {"movers", result.movers.size()},
          {"tracking_ms", rounded(result.tracking_ms)},
          {"paused", paused_},
          {"ended", ended_}};
}

std::string SessionModel::hello() const {
  const Camera& c = options_.camera;
  return text_of(
      {{"protocol", kStreamProtocol},
       {"source", options_.description},
       {"budget_ms", rounded(options_.budget_ms)},
       {"unit", map_.unit()},
       {"feature_unit", feature_unit(c)},
       {"camera", {{"width", c.width}, {"height", c.height}, {"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}}}});
}

void SessionModel::align_truth(const Map& map) {
  const size_t points = history_.path_size();
  const KeyframeId root = history_.current_root(map);
  // It settles soon, and a long path takes a while. A path that was thinned has fewer points than before.
  const bool holds = world_from_truth_ && !ended_ && aligned_root_ == root &&
                     aligned_corrections_ == map_.corrections() && points >= aligned_at_ &&
                     points <= aligned_at_ + aligned_at_ / 50 + 10;
  if (holds) return;
  world_from_truth_ = history_.world_from_truth(map, options_.truth);
  aligned_at_ = points;
  aligned_root_ = root;
  aligned_corrections_ = map_.corrections();
}

KeyframeId SessionModel::root_of(int number) const {
  const Map* map = shown_ == nullptr ? nullptr : shown_->map.map().get();
  if (map == nullptr || number < 0 || static_cast<size_t>(number) >= map->roots().size()) return kNoKeyframe;
  return map->roots()[static_cast<size_t>(number)];
}

// A new map's first keyframe, its root, is not in the snapshot at first.
KeyframeId SessionModel::root_of_frame() const {
  const FrameResult& result = shown_->result;
  if (!result.world_from_cam) return kNoKeyframe;
  const KeyframeId known = root_of(result.map);
  return known == kNoKeyframe ? result.reference_keyframe : known;
}

const std::string& SessionModel::frame_message() {
  if (!frame_message_.empty() || shown_ == nullptr) return frame_message_;
  const FrameResult& result = shown_->result;
  Json json = {{"state", state()}, {"explanation", result.keyframe_explanation}, {"map", root_of_frame()}};
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
    align_truth(*shown_->map.map());
    if (world_from_truth_) json["world_from_truth"] = json_of(*world_from_truth_);
  }
  std::string text = text_of(json);
  text.append((4 - text.size() % 4) % 4, ' ');
  StreamWriter out;
  out.message(StreamMessage::frame, [&](StreamWriter& m) {
    m.put(static_cast<uint32_t>(text.size()));
    m.put_bytes(text);
    put_features(m, result, feature_unit(options_.camera));
    put_mask(m, result.mask);
  });
  return frame_message_ = std::move(out.bytes());
}

const std::string& SessionModel::image_message(bool depth) {
  std::string& message = image_messages_[depth ? 1 : 0];
  if (!message.empty() || shown_ == nullptr) return message;
  const std::string jpeg = depth ? reduced_depth(shown_->frame) : reduced_picture(shown_->frame);
  StreamWriter out;
  out.message(StreamMessage::image, [&](StreamWriter& m) {
    m.put<uint32_t>(depth ? 1 : 0);
    m.put_bytes(jpeg);
  });
  return message = std::move(out.bytes());
}

}  // namespace dkb
