// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/static_transforms.h"

#include <algorithm>
#include <cmath>

namespace dkb {

std::string frame_name(const std::string& frame_id) {
  const std::string name = frame_id.substr(std::min(frame_id.find_first_not_of('/'), frame_id.size()));
  return name == "0" ? "" : name;
}

void StaticTransforms::add(const TransformsMessage& transforms) {
  constexpr size_t kMaxFrames = 10'000;
  for (const TransformMessage& t : transforms) {
    const std::string parent = frame_name(t.header.frame_id), child = frame_name(t.child_frame_id);
    const double norm = t.transform.orientation.norm();
    const bool sound = t.transform.position.allFinite() && std::abs(norm - 1) < 0.01 && parent != child;
    if (!sound || (parents_.size() >= kMaxFrames && !parents_.contains(child))) continue;
    parents_[child] = {parent, {t.transform.orientation.normalized(), t.transform.position}};
  }
}

std::map<std::string, Rigid3> StaticTransforms::ancestors(const std::string& frame) const {
  std::map<std::string, Rigid3> found{{frame, {}}};
  Rigid3 at;
  for (auto link = parents_.find(frame); link != parents_.end(); link = parents_.find(link->second.parent)) {
    at = link->second.parent_from_child * at;
    if (!found.emplace(link->second.parent, at).second) break;  // a circle
  }
  return found;
}

std::optional<Rigid3> StaticTransforms::find(const std::string& to, const std::string& from) const {
  const std::string a = frame_name(to), b = frame_name(from);
  if (a.empty() || b.empty()) return std::nullopt;
  if (a == b) return Rigid3();
  const std::map<std::string, Rigid3> above_a = ancestors(a);
  // Of the ancestors that both have, the way through any gives the same, up to rounding.
  for (const auto& [name, ancestor_from_b] : ancestors(b))
    if (const auto common = above_a.find(name); common != above_a.end())
      return common->second.inverse() * ancestor_from_b;
  return std::nullopt;
}

}  // namespace dkb
