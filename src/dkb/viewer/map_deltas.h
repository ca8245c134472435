// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/map/map.h"
#include "dkb_slam/map.h"

namespace dkb {

// Kinds of messages of the page's stream. A message: uint32 length of what follows the header, uint8 kind, three zero
// bytes, then that many bytes. All numbers are little-endian.
enum class StreamMessage : uint8_t {
  heartbeat = 0,     // empty
  hello = 1,         // JSON: the session. What the client knew before is void
  keyframes = 2,     // {int32 id, root; uint32 culled; float32 q[x y z w], t[3]} world_from_cam, each; maps
                     // that are not joined have roots and worlds of their own
  points = 3,        // {uint32 keyframe, n; n x {uint16 index; int16 x y z; uint8 r g b, observations}}: in the axes of
                     // the keyframe that they were born at, in units of the hello's; observations 0 = gone
  covisibility = 4,  // {uint32 keyframe, n; n x uint32 earlier keyframe}: all edges to earlier ones
  loops = 5,         // {int32 keyframe, earlier}: the whole list
  path = 6,          // {uint32 frame; int32 keyframe; float32 x y z}: camera positions in a keyframe's axes
  facts = 7,         // {uint32 frame; float32 tracking_ms, time; uint16 inliers; uint8 state, keyframe}
  events = 8,        // JSON array
  frame = 9,         // uint32 length of JSON, JSON padded to 4; uint32 n, n x {uint16 x, y in units of the hello's;
                     // uint8 state, reason}; uint32 cell, width, height of the mask, its bits by rows
  image = 10,        // uint32 0 colour or 1 depth, JPEG; none where the frame has no images
  truth = 11,        // {float32 x, y, z}: the whole of it
  path_reset = 12,   // empty: the path comes anew
  moment = 13,       // of files: "DKBS"; uint32 flags (session_file.h); float64 seconds since the first frame; int32
                     // frame; uint32 bytes of the messages that follow and belong to it
  stage_names = 14,  // JSON array: the whole list
  stages = 15,       // {uint32 frame, n; n x {uint16 stage, time in 1/50 ms}}
  surface = 16,      // int32 root of its map; float32 x y z, unit; uint32 vertices v, triangles t; v x int16 x y z in
                     // units from x y z, padded to 4; v x uint8 r g b 0; t x uint16 a b c: of the dense map, the whole
                     // of it
  grid = 17,         // int32 root of its map; float32 cell, x, y; float32 q[x y z w], t[3] floor_from_world; uint32
                     // width, height; {uint16 n, value}: n cells of that value, by rows from the top
};

// Of all this, as the hello tells it. Raised with every change, so that a page refuses what it would misread.
inline constexpr int kStreamProtocol = 2;

// Appends numbers as they lie in memory, which is little-endian on all machines this runs on.
class StreamWriter {
 public:
  template <class T>
  void put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void put_bytes(std::string_view bytes) { bytes_.append(bytes); }
  void pad() { bytes_.append((4 - bytes_.size() % 4) % 4, '\0'); }
  size_t size() const { return bytes_.size(); }
  std::string& bytes() { return bytes_; }
  // A message around what `write` puts; none when it puts nothing.
  template <class Write>
  void message(StreamMessage kind, const Write& write) {
    const size_t start = bytes_.size();
    put<uint32_t>(0);
    put<uint32_t>(static_cast<uint32_t>(kind));
    write(*this);
    const auto size = static_cast<uint32_t>(bytes_.size() - start - 8);
    if (size == 0) {
      bytes_.resize(start);
      return;
    }
    bytes_.replace(start, 4, reinterpret_cast<const char*>(&size), 4);
  }
  void empty_message(StreamMessage kind) {
    put<uint32_t>(0);
    put<uint32_t>(static_cast<uint32_t>(kind));
  }

 private:
  std::string bytes_;
};

// The map as clients were or will be told it, with a version of every part, so that each client is sent what changed
// since it last had room. Points hang on the keyframe that they were born at and move with it: a correction of the map
// changes keyframes alone, unless a point moves within its keyframe by more than the unit.
class MapDeltas {
 public:
  explicit MapDeltas(double unit) : unit_(unit) {}

  // Takes in what differs from the snapshot before it. One of another world, which has fewer keyframes or begins with
  // another one, begins anew as after clear().
  void update(const MapSnapshot& snapshot);
  // The snapshot is of another world: clients have to begin anew.
  void clear();

  // What one client knows.
  struct Client {
    uint64_t world = 0;  // 0 = nothing yet
    uint64_t keyframes = 0, loops = 0;
    size_t next_block = 0;
    std::vector<uint64_t> blocks;
  };
  bool begun_anew(const Client& client) const { return client.world != world_; }
  // Writes what the client does not know; of points some `budget` bytes at most, the rest by the next calls.
  void write(Client& client, StreamWriter& out, size_t budget) const;

  // Updates that moved more keyframes at once than a local adjustment does.
  uint64_t corrections() const { return corrections_; }

  double unit() const { return unit_; }  // [m]
  int keyframe_count() const { return static_cast<int>(keyframes_.size()); }
  uint64_t world() const { return world_; }  // its number: another one after clear()

 private:
  struct Keyframe {
    uint64_t version = 0, covisibility_version = 0;
    int frame = 0;
    KeyframeId root = kNoKeyframe;
    double timestamp = 0;
    bool culled = false;
    Rigid3 world_from_cam;
    std::vector<uint32_t> covisible;
  };
  struct Point {
    int16_t x = 0, y = 0, z = 0;
    Rgb colour;
    uint8_t observations = 0;
    uint16_t index = 0;
    uint64_t version = 0, seen = 0;
  };
  struct Block {
    uint64_t version = 0;
    std::vector<Point> points;  // by index
  };

  bool begins_otherwise(const Map& map) const;
  void update_keyframes(const Map& map);
  void update_points(const Map& map);

  const double unit_;  // [m]
  uint64_t world_ = 1, version_ = 0, loops_version_ = 0, corrections_ = 0;
  std::vector<Keyframe> keyframes_;
  std::vector<Block> blocks_;
  std::vector<LoopInfo> loops_;
  std::shared_ptr<const Map> last_;
};

}  // namespace dkb
