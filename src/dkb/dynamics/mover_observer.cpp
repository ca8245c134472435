// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_observer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "dkb/detection/mask_folder.h"
#include "dkb/features/vectorised.h"
#include "dkb/util/disjoint_sets.h"
#include "dkb/util/errors.h"
#include "dkb/util/quantile.h"

namespace dkb {
namespace {

constexpr int kCell = 4;           // [px] one depth is looked at per square of this size
constexpr size_t kMinCells = 12;   // cells with depth that a boxed object needs
constexpr size_t kMinRegion = 40;  // the same for a region without a box
constexpr double kMargin = 0.1;    // share of a box's size by which its rim reaches; mask there is no object of its own
constexpr float kDepthJump = 0.05f;  // [1] depth step between neighbouring cells of one region, relative to depth
constexpr float kLayer = 0.45f;      // [m] an object reaches so far before and behind its main depth layer
constexpr double kInnerShare = 0.4;  // of a region's cells must have all four neighbours in it: others are rims
constexpr int kGap = 4;              // [cells] regions so near to each other in the image are one ...
constexpr float kMergeAcross = 0.45f, kMergeDepth = 0.25f;  // [m] ... when so near across and in depth
constexpr double kBodySd = 0.18;  // [m] standard deviation of a body's surface around its middle, seen from above
constexpr float kBodyReach = 3;   // times the standard deviation: so far from where it is expected a mover's surface is
constexpr double kToldApart = 0.35;   // [m] movers expected nearer to each other have no regions each
constexpr double kOthersShare = 0.2;  // of what hangs together in depth that somebody else must have, to be told apart
constexpr float kBin = 0.05f;         // [m] of depth histograms
constexpr float kFarthest = 200;      // [m] what lies beyond is in their last bin, however far a camera may tell
constexpr size_t kMaxPoints = 300;    // per object, that its place and size are taken of

size_t bin_of(float depth) {
  return static_cast<size_t>(std::min(depth, kFarthest) / kBin);
}

// What was measured on simulated people: cells on the rim, depth taken at another moment than the picture, and the
// sensor's noise.
double position_sd(double depth) {
  return std::hypot(0.03, 0.01 * depth);
}

}  // namespace

MoverObserver::MoverObserver(const CameraModel& camera)
    : camera_(camera), rays_(camera, kCell), parts_(rays_.width(), rays_.height()) {}

// Cells whose middle lies in the box, widened by a share of its size.
CellBounds MoverObserver::cells_in(const Box& b, double margin) const {
  const auto first = [&](double edge, int n) {
    return static_cast<int>(std::clamp(std::ceil(edge / kCell - 0.5), 0.0, static_cast<double>(n)));
  };
  const double x = static_cast<double>(b.x), y = static_cast<double>(b.y), w = static_cast<double>(b.w),
               h = static_cast<double>(b.h);
  return {first(x - margin * w, rays_.width()), first(y - margin * h, rays_.height()),
          first(x + (1 + margin) * w, rays_.width()), first(y + (1 + margin) * h, rays_.height())};
}

template <class Function>
void MoverObserver::for_each_cell(const CellBounds& r, const Function& function) const {
  for (int y = r.y0; y < r.y1; ++y)
    for (int x = r.x0; x < r.x1; ++x)
      function(static_cast<size_t>(y) * static_cast<size_t>(rays_.width()) + static_cast<size_t>(x), x, y);
}

// Depth in the middle of a cell, or beside it; 0 = none.
float MoverObserver::depth_near(const DepthImage& depth, int x, int y) const {
  const int px = x * kCell + kCell / 2, py = y * kCell + kCell / 2;
  for (const auto& [dx, dy] : {std::array{0, 0}, {-1, 0}, {0, -1}, {-1, -1}})
    if (depth.contains(px + dx, py + dy) && depth(px + dx, py + dy) > 0) return depth(px + dx, py + dy);
  return 0;
}

// Some points of a surface [m], coordinate by coordinate in the camera's axes.
std::array<std::vector<float>, 3> MoverObserver::sample(std::span<const uint32_t> cells) const {
  const size_t stride = (cells.size() + kMaxPoints - 1) / kMaxPoints;
  std::array<std::vector<float>, 3> points;
  for (auto& p : points) p.reserve(cells.size() / stride + 1);
  for (size_t k = 0; k < cells.size(); k += stride) {
    const Eigen::Vector3f p = depth_[cells[k]] * rays_.ray(cells[k]);
    for (size_t i = 0; i < 3; ++i) points[i].push_back(p[static_cast<Eigen::Index>(i)]);
  }
  return points;
}

// What the cells of an object tell of it.
MoverObservation MoverObserver::measure(std::span<const uint32_t> cells) const {
  std::array<std::vector<float>, 3> here = sample(cells), turned = here;
  const Eigen::Matrix3f rotation = world_from_cam_.matrix3().cast<float>();
  for (size_t k = 0; k < here[0].size(); ++k) {
    const Eigen::Vector3f p = rotation * Eigen::Vector3f(here[0][k], here[1][k], here[2][k]);
    for (size_t i = 0; i < 3; ++i) turned[i][k] = p[static_cast<Eigen::Index>(i)];
  }
  MoverObservation o;
  o.position_in_world =
      world_from_cam_.translation +
      Eigen::Vector3f(upper_median(turned[0]), upper_median(turned[1]), upper_median(turned[2])).cast<double>();
  o.position_sd = position_sd(static_cast<double>(upper_median(here[2])));
  // Between the twentieths at either end, which may be of other surfaces.
  for (size_t i = 0; i < 3; ++i) {
    const float high = quantile(here[i], 0.95), low = quantile(here[i], 0.05);
    o.size[static_cast<Eigen::Index>(i)] = high - low;
  }
  o.surface = surface_of(cells);
  o.surface.position_in_world = o.position_in_world;
  return o;
}

MoverSurface MoverObserver::surface_of(std::span<const uint32_t> cells) const {
  MoverSurface surface;
  const double side = kCell / camera_.fx;  // [m] of a cell, 1 m deep
  for (const uint32_t i : cells) surface.area += side * side * static_cast<double>(depth_[i] * depth_[i]);
  const size_t stride = (cells.size() + MoverSurface::kMaxPoints - 1) / MoverSurface::kMaxPoints;
  for (size_t k = 0; k < cells.size(); k += stride) {
    const auto depth = static_cast<double>(depth_[cells[k]]);
    surface.points_in_world.push_back(world_from_cam_ * (depth * rays_.ray(cells[k]).cast<double>()));
  }
  return surface;
}

// Middle of the stretch of depth, twice `layer` long, that holds most of the depths; the nearest of equals.
float MoverObserver::main_layer(const std::vector<float>& depths) const {
  std::vector<int> histogram;
  for (float d : depths) {
    const size_t bin = bin_of(d);
    if (bin >= histogram.size()) histogram.resize(bin + 1, 0);
    ++histogram[bin];
  }
  const size_t window = std::max<size_t>(1, static_cast<size_t>(2 * kLayer / kBin));
  int inside = 0, most = 0;
  size_t end_of_most = 0;
  for (size_t end = 0; end < histogram.size(); ++end) {
    inside += histogram[end];
    if (end >= window) inside -= histogram[end - window];
    if (inside > most) {
      most = inside;
      end_of_most = end;
    }
  }
  std::vector<float> in;
  for (float d : depths)
    if (const size_t bin = bin_of(d); bin <= end_of_most && bin + window > end_of_most) in.push_back(d);
  return upper_median(in);
}

// Depth [m] of the object in each box; 0 = not known. The cells that a box alone has tell it; for a box within others,
// the cells that these do not explain.
std::vector<float> MoverObserver::box_depths(std::span<const Detection> boxes,
                                             const std::vector<CellBounds>& ranges) const {
  std::vector<int> count(depth_.size(), 0);
  for (const CellBounds& r : ranges) for_each_cell(r, [&](size_t i, int, int) { ++count[i]; });
  std::vector<size_t> by_area(boxes.size());
  std::iota(by_area.begin(), by_area.end(), size_t{0});
  std::stable_sort(by_area.begin(), by_area.end(),
                   [&](size_t a, size_t b) { return boxes[a].box.area() < boxes[b].box.area(); });

  std::vector<float> found(boxes.size(), 0), depths;
  std::vector<char> explained(depth_.size(), 0);
  const auto settle = [&](size_t b, const auto& counts) {
    depths.clear();
    for_each_cell(ranges[b], [&](size_t i, int, int) {
      if (depth_[i] > 0 && counts(i)) depths.push_back(depth_[i]);
    });
    if (depths.size() < kMinCells) return;
    const float depth = found[b] = main_layer(depths);
    for_each_cell(ranges[b], [&](size_t i, int, int) { explained[i] |= std::abs(depth_[i] - depth) < kLayer; });
  };
  for (const size_t b : by_area) settle(b, [&](size_t i) { return count[i] == 1; });
  for (const size_t b : by_area)
    if (!(found[b] > 0)) settle(b, [&](size_t i) { return !explained[i]; });
  return found;
}

std::vector<MoverObservation> MoverObserver::observe_boxes(std::span<const Detection> boxes) const {
  if (boxes.empty()) return {};
  std::vector<CellBounds> ranges;
  for (const Detection& d : boxes) ranges.push_back(cells_in(d.box, 0));
  const std::vector<float> depths = box_depths(boxes, ranges);
  // A cell in several boxes goes to the object at whose depth and in whose middle it is.
  std::vector<float> min_cost(depth_.size(), std::numeric_limits<float>::max());
  std::vector<size_t> owner(depth_.size(), boxes.size());
  for (size_t b = 0; b < boxes.size(); ++b) {
    if (!(depths[b] > 0)) continue;
    const float middle = 0.5f * static_cast<float>(ranges[b].x0 + ranges[b].x1 - 1);
    const float across = std::max(1.0f, 0.5f * static_cast<float>(ranges[b].x1 - ranges[b].x0));
    for_each_cell(ranges[b], [&](size_t i, int x, int) {
      const float off = std::abs(depth_[i] - depths[b]) / kLayer, aside = (static_cast<float>(x) - middle) / across;
      const float cost = off + 0.5f * aside * aside;
      if (!(depth_[i] > 0) || off > 1 || cost >= min_cost[i]) return;
      min_cost[i] = cost;
      owner[i] = b;
    });
  }
  std::vector<MoverObservation> observations;
  std::vector<uint32_t> cells;
  for (size_t b = 0; b < boxes.size(); ++b) {
    cells.clear();
    for_each_cell(ranges[b], [&](size_t i, int, int) {
      if (owner[i] == b) cells.push_back(static_cast<uint32_t>(i));
    });
    if (cells.size() >= kMinCells) {
      MoverObservation& o = observations.emplace_back(measure(cells));
      o.class_name = boxes[b].class_name;
      o.box = boxes[b].box;
      o.position_sd = position_sd(static_cast<double>(depths[b]));
    } else if (const Box& box = boxes[b].box; ranges[b].x0 < ranges[b].x1 && ranges[b].y0 < ranges[b].y1) {
      const Eigen::Vector2d middle(0.5 * static_cast<double>(2 * box.x + box.w),
                                   0.5 * static_cast<double>(2 * box.y + box.h));
      const Eigen::Vector3d ray = camera_.unproject(camera_.undistort(middle), 1.0);
      observations.push_back({boxes[b].class_name, box, world_from_cam_ * ray, false, 0, {0, 0, 0}, {}, -1});
    }
  }
  return observations;
}

// Parts of the mask outside all boxes that hang together in depth.
std::vector<MoverObserver::Region> MoverObserver::find_regions(std::span<const Detection> boxes) {
  free_depth_ = depth_;
  for (const Detection& d : boxes)
    for_each_cell(cells_in(d.box, kMargin), [&](size_t i, int, int) { free_depth_[i] = 0; });
  std::vector<Region> regions;
  for (DepthPart& part : parts_.find(free_depth_, kDepthJump)) {
    // The mask's rim lies on what is behind the movers: a ring one or two cells wide is no object, nor are specks.
    if (static_cast<double>(part.inner) < kInnerShare * static_cast<double>(part.cells.size())) continue;
    for (Region& region : divide({part.bounds, std::move(part.cells), -1})) regions.push_back(std::move(region));
  }
  return join(std::move(regions));
}

// Holes of the depth image and arms held out cut bodies into parts.
std::vector<MoverObserver::Region> MoverObserver::join(std::vector<Region> parts) const {
  DisjointSets bodies(parts.size());
  std::vector<Eigen::Vector2f> middles;
  for (const Region& part : parts) {
    auto points = sample(part.cells);
    middles.emplace_back(upper_median(points[0]), upper_median(points[2]));
  }
  const auto of_one_body = [&](size_t a, size_t b) {
    if (parts[a].expected >= 0 || parts[b].expected >= 0) return parts[a].expected == parts[b].expected;
    const CellBounds &p = parts[a].bounds, &q = parts[b].bounds;
    const int gap = std::max({p.x0 - q.x1, q.x0 - p.x1, p.y0 - q.y1, q.y0 - p.y1});
    const Eigen::Vector2f off = (middles[a] - middles[b]).cwiseAbs();
    return gap <= kGap && off.x() <= kMergeAcross && off.y() <= kMergeDepth;
  };
  for (size_t a = 0; a < parts.size(); ++a)
    for (size_t b = a + 1; b < parts.size(); ++b)
      if (of_one_body(a, b)) bodies.join(a, b);
  for (size_t p = 0; p < parts.size(); ++p) {
    const size_t r = bodies.first_of(p);
    if (r == p) continue;
    Region &into = parts[r], &from = parts[p];
    into.cells.insert(into.cells.end(), from.cells.begin(), from.cells.end());
    into.bounds = {std::min(into.bounds.x0, from.bounds.x0), std::min(into.bounds.y0, from.bounds.y0),
                   std::max(into.bounds.x1, from.bounds.x1), std::max(into.bounds.y1, from.bounds.y1)};
  }
  std::vector<Region> regions;
  for (size_t p = 0; p < parts.size(); ++p)
    if (bodies.first_of(p) == p && parts[p].cells.size() >= (parts[p].expected >= 0 ? kMinCells : kMinRegion))
      regions.push_back(std::move(parts[p]));
  return regions;
}

std::vector<MoverObserver::Footprint> MoverObserver::footprints(std::span<const ExpectedMover> expected) const {
  const Rigid3 cam_from_world = world_from_cam_.inverse();
  const Eigen::Matrix3d rotation = cam_from_world.matrix3();
  std::vector<Footprint> result;
  for (const ExpectedMover& e : expected) {
    const Eigen::Vector3d p = cam_from_world * e.position_in_world;
    const Eigen::Matrix3d c = rotation * e.covariance * rotation.transpose();
    Eigen::Matrix2d spread;
    spread << c(0, 0), c(0, 2), c(2, 0), c(2, 2);
    spread.diagonal().array() += kBodySd * kBodySd;
    result.push_back({Eigen::Vector2d(p.x(), p.z()).cast<float>(), spread.inverse().cast<float>(),
                      static_cast<float>(std::log(spread.determinant()))});
  }
  return result;
}

// The expected mover that each cell fits best; their number = none.
std::vector<uint16_t> MoverObserver::owners_of(std::span<const uint32_t> cells) const {
  std::vector<float> across(cells.size()), deep(cells.size()), least(cells.size(), std::numeric_limits<float>::max());
  for (size_t k = 0; k < cells.size(); ++k) {
    deep[k] = depth_[cells[k]];
    across[k] = deep[k] * rays_.ray(cells[k]).x();
  }
  std::vector<uint16_t> owners(cells.size(), static_cast<uint16_t>(footprints_.size()));
  for (size_t e = 0; e < footprints_.size(); ++e)
    run_vectorised(best_simd(), [f = footprints_[e], e = static_cast<uint16_t>(e), n = cells.size(), x = across.data(),
                                 z = deep.data(), least = least.data(), to = owners.data()]() DKB_KERNEL_BODY {
      const float xx = f.information(0, 0), xz = 2 * f.information(0, 1), zz = f.information(1, 1);
      DKB_INDEPENDENT_STEPS
      for (size_t k = 0; k < n; ++k) {
        const float u = x[k] - f.middle.x(), v = z[k] - f.middle.y();
        const float distance = u * u * xx + u * v * xz + v * v * zz, cost = distance + f.width;
        const bool better = (distance <= kBodyReach * kBodyReach) & (cost < least[k]);
        least[k] = better ? cost : least[k];
        to[k] = better ? e : to[k];
      }
    });
  return owners;
}

// A part that hangs together in depth goes to the mover that most of it fits, and is divided where others, or somebody
// not expected, have a good share of it.
std::vector<MoverObserver::Region> MoverObserver::divide(Region part) const {
  std::vector<Region> result;
  if (footprints_.empty()) {
    result.push_back(std::move(part));
    return result;
  }
  const size_t owners = footprints_.size() + 1, nobody = owners - 1;
  std::vector<size_t> count(owners, 0);
  const std::vector<uint16_t> owner = owners_of(part.cells);
  for (const uint16_t o : owner) ++count[o];
  const auto most = static_cast<size_t>(std::max_element(count.begin(), count.end()) - count.begin());
  const double enough =
      std::max(static_cast<double>(kMinRegion), kOthersShare * static_cast<double>(part.cells.size()));
  std::vector<int> region_of(owners, 0);  // in the result; 0 = that of the owner of most
  result.emplace_back();
  const auto expected = [&](size_t o) { return o == nobody ? -1 : static_cast<int>(o); };
  result[0].expected = expected(most);
  for (size_t o = 0; o < owners; ++o) {
    if (o == most || static_cast<double>(count[o]) < enough) continue;
    const bool apart = o == nobody || most == nobody ||
                       (footprints_[o].middle - footprints_[most].middle).norm() > static_cast<float>(kToldApart);
    if (!apart) continue;
    region_of[o] = static_cast<int>(result.size());
    result.emplace_back().expected = expected(o);
  }
  if (result.size() == 1) {
    result[0].bounds = part.bounds;
    result[0].cells = std::move(part.cells);
    return result;
  }
  for (Region& r : result) r.bounds = {rays_.width(), rays_.height(), 0, 0};
  for (size_t k = 0; k < part.cells.size(); ++k) {
    Region& r = result[static_cast<size_t>(region_of[owner[k]])];
    const int x = static_cast<int>(part.cells[k]) % rays_.width(), y = static_cast<int>(part.cells[k]) / rays_.width();
    r.bounds = {std::min(r.bounds.x0, x), std::min(r.bounds.y0, y), std::max(r.bounds.x1, x + 1),
                std::max(r.bounds.y1, y + 1)};
    r.cells.push_back(part.cells[k]);
  }
  return result;
}

// Whether the middle of a cell is in the mask.
bool MoverObserver::is_masked(const MoverMask& mask, int x, int y) const {
  if (mask.cell == kCell && mask.cells.width() == rays_.width() && mask.cells.height() == rays_.height())
    return mask.cells(x, y) != 0;
  const float middle = 0.5f * static_cast<float>(kCell);
  return mask.at(static_cast<float>(x * kCell) + middle, static_cast<float>(y * kCell) + middle);
}

void MoverObserver::take_masked_depth(const DepthImage& depth, const MoverMask& mask) {
  depth_.assign(rays_.all_cells().count, 0.0f);
  for_each_cell({0, 0, rays_.width(), rays_.height()}, [&](size_t i, int x, int y) {
    if (is_masked(mask, x, y)) depth_[i] = depth_near(depth, x, y);
  });
}

// The boxes without those of a mask's regions that are in boxes with a name: a mask beside boxes tells of the same
// people twice. What of such a region is in no box is found as a region.
std::vector<Detection> MoverObserver::named_once(std::span<const Detection> boxes, const MoverMask& mask) const {
  if (boxes.empty()) return {};
  std::vector<char> named(depth_.size(), 0);
  for (const Detection& d : boxes)
    if (d.class_name != kUnnamedRegion) for_each_cell(cells_in(d.box, 0), [&](size_t i, int, int) { named[i] = 1; });
  std::vector<Detection> kept;
  for (const Detection& d : boxes) {
    size_t all = 0, theirs = 0;
    if (d.class_name == kUnnamedRegion)
      for_each_cell(cells_in(d.box, 0), [&](size_t i, int x, int y) {
        if (!is_masked(mask, x, y)) return;
        ++all;
        theirs += named[i] != 0;
      });
    if (2 * theirs <= all) kept.push_back(d);
  }
  return kept;
}

std::vector<MoverObservation> MoverObserver::observe(const DepthImage& depth, const MoverMask& mask,
                                                     std::span<const Detection> all_boxes, const Rigid3& world_from_cam,
                                                     std::span<const ExpectedMover> expected) {
  if (depth.width() != camera_.width || depth.height() != camera_.height)
    throw InputError("depth image is " + std::to_string(depth.width()) + " x " + std::to_string(depth.height()) +
                     " px; it must have the camera's size " + std::to_string(camera_.width) + " x " +
                     std::to_string(camera_.height));
  if (mask.empty()) return {};
  world_from_cam_ = world_from_cam;
  take_masked_depth(depth, mask);
  footprints_ = footprints(expected);
  const std::vector<Detection> boxes = named_once(all_boxes, mask);
  std::vector<MoverObservation> observations = observe_boxes(boxes);
  for (const Region& r : find_regions(boxes)) {
    const auto pixels = [&](int cells) { return static_cast<float>(cells * kCell); };
    const Box bounds{pixels(r.bounds.x0), pixels(r.bounds.y0), pixels(r.bounds.x1 - r.bounds.x0),
                     pixels(r.bounds.y1 - r.bounds.y0)};
    MoverObservation& o = observations.emplace_back(measure(r.cells));
    o.box = clip(bounds, camera_.width, camera_.height);
    o.expected = r.expected;
  }
  return observations;
}

}  // namespace dkb
