// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/map_deltas.h"

#include <algorithm>
#include <cmath>

namespace dkb {
namespace {

constexpr size_t kEdges = 6;             // of a keyframe to earlier ones: more are a tangle
constexpr int kSharedPoints = 20;        // of an edge that is shown
constexpr int kMovedLocally = 12;        // keyframes that a local adjustment moves; the page counts alike
constexpr double kPoseTolerance = 1e-5;  // [m], [rad]

bool same_pose(const Rigid3& a, const Rigid3& b) {
  return (a.translation - b.translation).norm() < kPoseTolerance &&
         (a.rotation.coeffs() - b.rotation.coeffs()).norm() < kPoseTolerance;
}

}  // namespace

void MapDeltas::clear() {
  ++world_;
  keyframes_.clear();
  blocks_.clear();
  loops_.clear();
  loops_version_ = 0;
  last_ = nullptr;
}

void MapDeltas::update(const MapSnapshot& snapshot) {
  const std::shared_ptr<const Map>& map = snapshot.map();
  if (map == nullptr || map == last_) return;
  if (static_cast<size_t>(map->keyframe_count()) < keyframes_.size() || begins_otherwise(*map)) clear();
  ++version_;
  update_keyframes(*map);
  update_points(*map);
  if (snapshot.loops().size() != loops_.size()) {
    loops_ = snapshot.loops();
    loops_version_ = version_;
  }
  last_ = map;
}

// A map that was loaded has frames before 0, and other stamps unless it was made in this session.
bool MapDeltas::begins_otherwise(const Map& map) const {
  if (keyframes_.empty()) return false;
  const dkb::Keyframe* first = map.keyframe(0);
  const Keyframe& known = keyframes_.front();
  return first != nullptr && known.version > 0 && (first->frame != known.frame || first->timestamp != known.timestamp);
}

void MapDeltas::update_keyframes(const Map& map) {
  keyframes_.resize(static_cast<size_t>(map.keyframe_count()));
  const std::vector<KeyframeId> roots = map.root_of_each();
  int moved = 0;
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    const dkb::Keyframe* given = map.keyframe(id);
    if (given == nullptr) continue;
    Keyframe& known = keyframes_[static_cast<size_t>(id)];
    const Rigid3 pose = map.cam_from_world(id).inverse();
    const KeyframeId root = roots[static_cast<size_t>(id)];
    if (known.version == 0 || known.culled != given->culled || known.root != root ||
        !same_pose(known.world_from_cam, pose)) {
      moved += known.version > 0 ? 1 : 0;
      known.version = version_;
      known.frame = given->frame;
      known.timestamp = given->timestamp;
      known.culled = given->culled;
      known.world_from_cam = pose;
      known.root = root;
    }
    if (last_ != nullptr && last_->keyframe(id) == given) continue;
    std::vector<uint32_t> edges;
    if (!given->culled)
      for (const Covisible& c : given->covisible)
        if (c.keyframe < id && c.shared_points >= kSharedPoints && edges.size() < kEdges)
          edges.push_back(static_cast<uint32_t>(c.keyframe));
    if (edges == known.covisible) continue;
    known.covisible = std::move(edges);
    known.covisibility_version = version_;
  }
  corrections_ += moved > kMovedLocally ? 1 : 0;
}

void MapDeltas::update_points(const Map& map) {
  blocks_.resize(static_cast<size_t>(map.keyframe_count()));
  KeyframeId birth = kNoKeyframe;
  Rigid3 cam_from_world;
  for (const PointId id : map.live_points()) {
    const MapPoint* point = map.point(id);
    if (birth_keyframe(id) != birth) {
      birth = birth_keyframe(id);
      cam_from_world = keyframes_[static_cast<size_t>(birth)].world_from_cam.inverse();
    }
    Block& block = blocks_[static_cast<size_t>(birth)];
    const auto index = static_cast<uint16_t>(birth_feature(id));
    auto known = std::lower_bound(block.points.begin(), block.points.end(), index,
                                  [](const Point& p, uint16_t i) { return p.index < i; });
    const bool fresh = known == block.points.end() || known->index != index;
    if (fresh) {
      known = block.points.insert(known, Point{});
      known->index = index;
    }
    known->seen = version_;
    const Eigen::Vector3d p = cam_from_world * point->position / unit_;
    const auto rounded = [](double v) { return static_cast<int16_t>(std::lround(std::clamp(v, -32767.0, 32767.0))); };
    const auto moved = [](int16_t a, double b) { return std::abs(a - std::clamp(b, -32767.0, 32767.0)) > 1.5; };
    if (!fresh && known->observations > 0 && !moved(known->x, p.x()) && !moved(known->y, p.y()) &&
        !moved(known->z, p.z()))
      continue;
    known->x = rounded(p.x());
    known->y = rounded(p.y());
    known->z = rounded(p.z());
    known->colour = point->colour;
    known->observations = static_cast<uint8_t>(std::clamp<size_t>(point->observations.size(), 1, 255));
    known->version = block.version = version_;
  }
  for (Block& block : blocks_) {
    for (Point& point : block.points) {
      if (point.seen == version_ || point.observations == 0) continue;
      point.observations = 0;
      point.version = block.version = version_;
    }
  }
}

void MapDeltas::write(Client& client, StreamWriter& out, size_t budget) const {
  if (begun_anew(client)) {
    client = {};
    client.world = world_;
  }
  out.message(StreamMessage::keyframes, [&](StreamWriter& m) {
    for (size_t id = 0; id < keyframes_.size(); ++id) {
      const Keyframe& k = keyframes_[id];
      if (k.version <= client.keyframes) continue;
      m.put(static_cast<int32_t>(id));
      m.put<int32_t>(k.root);
      m.put<uint32_t>(k.culled ? 1 : 0);
      for (int i = 0; i < 4; ++i) m.put(static_cast<float>(k.world_from_cam.rotation.coeffs()[i]));
      for (int i = 0; i < 3; ++i) m.put(static_cast<float>(k.world_from_cam.translation[i]));
    }
  });
  out.message(StreamMessage::covisibility, [&](StreamWriter& m) {
    for (size_t id = 0; id < keyframes_.size(); ++id) {
      const Keyframe& k = keyframes_[id];
      if (k.covisibility_version <= client.keyframes) continue;
      m.put(static_cast<uint32_t>(id));
      m.put(static_cast<uint32_t>(k.covisible.size()));
      for (const uint32_t other : k.covisible) m.put(other);
    }
  });
  client.keyframes = version_;
  if (loops_version_ > client.loops) {
    out.message(StreamMessage::loops, [&](StreamWriter& m) {
      for (const LoopInfo& loop : loops_) {
        m.put<int32_t>(loop.keyframe);
        m.put<int32_t>(loop.earlier_keyframe);
      }
    });
    client.loops = loops_version_;
  }
  client.blocks.resize(blocks_.size(), 0);
  // Goes round: a client with little room gets every block in turn.
  const size_t start = out.size();
  out.message(StreamMessage::points, [&](StreamWriter& m) {
    for (size_t n = 0; n < blocks_.size(); ++n) {
      const size_t at = (client.next_block + n) % blocks_.size();
      const Block& block = blocks_[at];
      uint64_t& known = client.blocks[at];
      if (block.version <= known) continue;
      if (m.size() - start > budget) {
        client.next_block = at;
        return;
      }
      const auto news = [&](const Point& p) { return p.version > known && (p.observations > 0 || known > 0); };
      const auto count = static_cast<uint32_t>(std::count_if(block.points.begin(), block.points.end(), news));
      if (count > 0) {
        m.put(static_cast<uint32_t>(at));
        m.put(count);
        for (const Point& p : block.points) {
          if (!news(p)) continue;
          m.put(p.index);
          for (const int16_t v : {p.x, p.y, p.z}) m.put(v);
          for (const uint8_t v : {p.colour.r, p.colour.g, p.colour.b, p.observations}) m.put(v);
        }
      }
      known = block.version;
    }
  });
}

}  // namespace dkb
