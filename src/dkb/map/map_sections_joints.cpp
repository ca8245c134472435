// SPDX-License-Identifier: Apache-2.0
// Sections MOTN and PLAN: what holds keyframes together beside the points that they share.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "dkb/geometry/decompositions.h"
#include "dkb/map/byte_stream.h"
#include "dkb/map/entropy_coder.h"
#include "dkb/map/map_sections.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr size_t kMinMotionBytes = 3 + (7 + 36) * 8;
constexpr size_t kMinPlanesBytes = 3;
constexpr size_t kPatchBytes = (3 + 9 + 3) * 8 + 1;

// That of noise, up to what rounding makes of it: an adjustment takes its inverse.
template <class Matrix>
bool is_covariance(const Matrix& m) {
  return m.allFinite() && m.trace() >= 0 && (m - m.transpose()).norm() <= 1e-9 * m.norm() &&
         spectrum(m).values[0] >= -1e-9 * m.trace();
}

// The only kind: a rotation alone would be adjusted by as if its translation were known.
constexpr uint8_t kWholeMotion = 0;

bool sound(const MotionPrior& motion) {
  return !motion.rotation_only && sound(motion.previous_from_current) && is_covariance(motion.covariance);
}

bool sound(const PlanePatch& patch) {
  return patch.over_distance.allFinite() && patch.over_distance.squaredNorm() > 0 && std::isfinite(patch.distance()) &&
         patch.centre.allFinite() && is_covariance(patch.covariance);
}

bool sound(const PlaneView& planes, const CameraModel& camera) {
  for (const PlanePatch& patch : planes.patches)
    if (!sound(patch)) return false;
  if (planes.patch_at.width() != camera.width / PlaneView::kBlock ||
      planes.patch_at.height() != camera.height / PlaneView::kBlock)
    return false;
  for (size_t i = 0; i < planes.patch_at.size(); ++i)
    if (planes.patch_at.data()[i] > planes.patches.size()) return false;
  return true;
}

// All of it: sums of covariances are symmetric but for the last bits, and a loaded map goes on as the saved one would.
template <class Matrix>
void write_matrix(ByteWriter& out, const Matrix& m) {
  for (Eigen::Index i = 0; i < m.size(); ++i) out.f64(m.data()[i]);
}

template <class Matrix>
void read_matrix(ByteReader& in, Matrix& m) {
  for (Eigen::Index i = 0; i < m.size(); ++i) m.data()[i] = in.f64();
}

KeyframeId next_live_keyframe(ByteReader& in, KeyframeId before, const std::vector<Keyframe>& keyframes) {
  const uint64_t step = in.varint();
  if (step == 0 || step >= keyframes.size() - static_cast<size_t>(before)) in.fail("has keyframes out of order");
  const KeyframeId id = before + static_cast<KeyframeId>(step);
  if (keyframes[static_cast<size_t>(id)].culled) in.fail("tells of a keyframe that is culled");
  return id;
}

}  // namespace

std::string motion_section(const Map& map) {
  std::vector<KeyframeId> told;
  for (KeyframeId id : map.live_keyframes())
    if (const auto& motion = map.keyframe(id)->motion;
        motion && motion->previous < id && map.live_keyframe(motion->previous) != nullptr && sound(motion->since))
      told.push_back(id);
  ByteWriter out;
  out.varint(told.size());
  KeyframeId before = -1;
  for (KeyframeId id : told) {
    const KeyframeMotion& motion = *map.keyframe(id)->motion;
    out.varint(static_cast<uint64_t>(id - before));
    before = id;
    out.varint(static_cast<uint64_t>(id - motion.previous));
    out.u8(kWholeMotion);
    write_pose(out, motion.since.previous_from_current);
    write_matrix(out, motion.since.covariance);
  }
  return out.bytes();
}

void read_motion_section(std::string_view bytes, std::vector<Keyframe>& keyframes) {
  ByteReader in(bytes, "section MOTN");
  KeyframeId id = -1;
  for (size_t left = in.count(in.varint(), kMinMotionBytes); left > 0; --left) {
    id = next_live_keyframe(in, id, keyframes);
    const uint64_t back = in.varint();
    if (back == 0 || back > static_cast<uint64_t>(id)) in.fail("tells of a motion from a keyframe that is not there");
    KeyframeMotion motion;
    motion.previous = id - static_cast<KeyframeId>(back);
    if (keyframes[static_cast<size_t>(motion.previous)].culled) in.fail("tells of a motion from a culled keyframe");
    if (in.u8() != kWholeMotion) in.fail("has a motion of an unknown kind");
    motion.since.previous_from_current = read_pose(in);
    read_matrix(in, motion.since.covariance);
    if (!sound(motion.since)) in.fail("has an impossible motion to keyframe " + std::to_string(id));
    keyframes[static_cast<size_t>(id)].motion = std::make_shared<const KeyframeMotion>(motion);
  }
  in.expect_end();
}

std::string plane_section(const Map& map, const CameraModel& camera) {
  std::vector<KeyframeId> told;
  for (KeyframeId id : map.live_keyframes()) {
    const Keyframe& k = *map.keyframe(id);
    if (k.planes && k.plane_of_patch.size() == k.planes->patches.size() && sound(*k.planes, camera)) told.push_back(id);
  }
  ByteWriter out;
  out.varint(told.size());
  KeyframeId before = -1;
  std::map<PlaneId, uint64_t> numbers;  // planes that turned out to be the same have one
  for (KeyframeId id : told) {
    const Keyframe& k = *map.keyframe(id);
    out.varint(static_cast<uint64_t>(id - before));
    before = id;
    out.varint(k.planes->patches.size());
    for (size_t p = 0; p < k.planes->patches.size(); ++p) {
      const PlanePatch& patch = k.planes->patches[p];
      out.varint(numbers.emplace(map.plane(k.plane_of_patch[p]), numbers.size()).first->second);
      write_matrix(out, patch.over_distance);
      write_matrix(out, patch.covariance);
      write_matrix(out, patch.centre);
    }
    write_packed(out, {reinterpret_cast<const char*>(k.planes->patch_at.data()), k.planes->patch_at.size()});
  }
  return out.bytes();
}

void read_plane_section(std::string_view bytes, const CameraModel& camera, std::vector<Keyframe>& keyframes) {
  ByteReader in(bytes, "section PLAN");
  size_t planes = 0;
  KeyframeId id = -1;
  for (size_t left = in.count(in.varint(), kMinPlanesBytes); left > 0; --left) {
    id = next_live_keyframe(in, id, keyframes);
    auto view = std::make_shared<PlaneView>();
    view->patches.resize(in.count(in.varint(), kPatchBytes));
    for (PlanePatch& patch : view->patches) {
      const uint64_t plane = in.varint();
      if (plane > planes) in.fail("has planes out of order");
      planes += plane == planes;
      keyframes[static_cast<size_t>(id)].plane_of_patch.push_back(static_cast<PlaneId>(plane));
      read_matrix(in, patch.over_distance);
      read_matrix(in, patch.covariance);
      read_matrix(in, patch.centre);
    }
    view->patch_at = Image<uint8_t>(camera.width / PlaneView::kBlock, camera.height / PlaneView::kBlock);
    const std::string blocks = read_packed(in, view->patch_at.size());
    std::copy(blocks.begin(), blocks.end(), view->patch_at.data());
    if (!sound(*view, camera)) in.fail("has impossible planes in keyframe " + std::to_string(id));
    keyframes[static_cast<size_t>(id)].planes = std::move(view);
  }
  in.expect_end();
}

}  // namespace dkb
