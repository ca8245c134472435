// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/visibility.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nanoflann.hpp>

namespace dkb {
namespace {

// What nanoflann asks of a cloud.
struct Cloud {
  const std::vector<Eigen::Vector3d>& points;
  size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(size_t i, size_t axis) const { return points[i][static_cast<Eigen::Index>(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3, uint32_t>;

// The nearest points by (distance, index): the library's own result set leaves ties to the tree's shape.
class NearestSet {
 public:
  explicit NearestSet(uint32_t self) : self_(self) {}
  bool addPoint(double squared_distance, uint32_t index) {
    if (index == self_) return true;
    const Entry entry{squared_distance, index};
    if (size_ == kNormalNeighbours && !(entry < entries_[size_ - 1])) return true;
    size_t at = size_ < kNormalNeighbours ? size_++ : size_ - 1;
    for (; at > 0 && entry < entries_[at - 1]; --at) entries_[at] = entries_[at - 1];
    entries_[at] = entry;
    return true;
  }
  // A little more than the worst: the search must offer ties and not lose any to rounding.
  double worstDist() const {
    return full() ? entries_[size_ - 1].squared_distance * (1 + 1e-12) + std::numeric_limits<double>::min()
                  : std::numeric_limits<double>::max();
  }
  bool full() const { return size_ == kNormalNeighbours; }
  size_t size() const { return size_; }
  std::vector<int> indices() const {
    std::vector<int> result;
    result.reserve(size_);
    for (size_t i = 0; i < size_; ++i) result.push_back(static_cast<int>(entries_[i].index));
    return result;
  }

 private:
  struct Entry {
    double squared_distance;
    uint32_t index;
    bool operator<(const Entry& o) const {
      return squared_distance != o.squared_distance ? squared_distance < o.squared_distance : index < o.index;
    }
  };
  uint32_t self_;
  std::array<Entry, kNormalNeighbours> entries_{};
  size_t size_ = 0;
};

}  // namespace

std::vector<std::vector<int>> nearest_neighbours(const std::vector<Eigen::Vector3d>& cloud, std::span<const int> of) {
  std::vector<std::vector<int>> result;
  if (of.empty()) return result;
  const Cloud adaptor{cloud};
  const Tree tree(3, adaptor);
  result.reserve(of.size());
  for (int i : of) {
    NearestSet nearest(static_cast<uint32_t>(i));
    tree.findNeighbors(nearest, cloud[static_cast<size_t>(i)].data(), {});
    result.push_back(nearest.indices());
  }
  return result;
}

std::optional<Eigen::Vector3d> surface_normal(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> neighbours,
                                              const Eigen::Vector3d& first_camera_centre, NormalSum sum) {
  if (neighbours.size() < kNormalNeighbours) return std::nullopt;
  const Eigen::Vector3d to_camera = first_camera_centre - point;
  Eigen::Vector3d s = Eigen::Vector3d::Zero();
  double largest = 0;
  for (size_t k = 0; k + 1 < kNormalNeighbours; ++k)
    for (size_t t = k + 1; t < kNormalNeighbours; ++t) {
      const Eigen::Vector3d v_k = neighbours[k] - point, v_t = neighbours[t] - point;
      const Eigen::Vector3d product = v_k.cross(v_t);
      const bool away = sum == NormalSum::oriented && product.dot(to_camera) < 0;
      s += away ? Eigen::Vector3d(-product) : product;
      largest += v_k.norm() * v_t.norm();
    }
  if (s.norm() <= 1e-3 * largest) return std::nullopt;
  if (sum == NormalSum::plain && s.dot(to_camera) < 0) s = -s;
  return s.normalized();
}

std::vector<std::optional<Eigen::Vector3d>> surface_normals(const Map& map, const std::vector<PointId>& of,
                                                            const std::vector<PointId>& cloud, NormalSum sum) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(cloud.size());
  for (PointId id : cloud) positions.push_back(map.point(id)->position);
  std::vector<int> indices;
  indices.reserve(of.size());
  for (PointId id : of)
    indices.push_back(static_cast<int>(std::lower_bound(cloud.begin(), cloud.end(), id) - cloud.begin()));
  const auto neighbours = nearest_neighbours(positions, indices);

  std::map<KeyframeId, Eigen::Vector3d> centres;
  std::vector<std::optional<Eigen::Vector3d>> normals;
  normals.reserve(of.size());
  std::vector<Eigen::Vector3d> around;
  for (size_t i = 0; i < of.size(); ++i) {
    const KeyframeId birth = birth_keyframe(of[i]);
    auto centre = centres.find(birth);
    if (centre == centres.end()) centre = centres.emplace(birth, centre_in_world(map.cam_from_world(birth))).first;
    around.clear();
    for (int n : neighbours[i]) around.push_back(positions[static_cast<size_t>(n)]);
    normals.push_back(surface_normal(positions[static_cast<size_t>(indices[i])], around, centre->second, sum));
  }
  return normals;
}

double view_angle_deg(const Eigen::Vector3d& normal, const Eigen::Vector3d& camera_from_point) {
  return std::atan2(normal.cross(camera_from_point).norm(), normal.dot(camera_from_point)) * 180 / M_PI;
}

int visibility_level(double angle_deg, int levels) {
  int level = 1;
  while (level < levels && angle_deg > 10 * level) ++level;
  return level;
}

}  // namespace dkb
