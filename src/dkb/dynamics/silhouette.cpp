// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace dkb {
namespace {

constexpr int kMaskCell = 4;       // [px] grid on which depth is looked at
constexpr double kCore = 0.5;      // share of the box's width and height around its centre where the object is sought
constexpr double kMinShare = 0.2;  // of the core's weight that a depth layer needs to be the object
constexpr double kRelativeLayer = 0.15;  // [1] half-width of that layer relative to its depth
constexpr double kHalfDepth = 0.3;       // [m] and no more than half of what a body takes up along the line of sight
constexpr double kMiddle = 0.1;          // share of the box's width and height in which its body is sure to be
constexpr double kWidening = 0.05;       // share of the box's size by which it is widened

struct CellRange {
  int x0, y0, x1, y1;  // half open
};

CellRange cells_of(const Box& box, int cell, int columns, int rows) {
  const auto cut = [](float v, int n) { return std::clamp(static_cast<int>(std::floor(v)), 0, n); };
  const float c = static_cast<float>(cell);
  return {cut(box.x / c, columns), cut(box.y / c, rows), cut((box.x + box.w) / c + 1, columns),
          cut((box.y + box.h) / c + 1, rows)};
}

Box scaled(const Box& b, double factor) {
  const float w = b.w * static_cast<float>(factor), h = b.h * static_cast<float>(factor);
  return {b.x + 0.5f * (b.w - w), b.y + 0.5f * (b.h - h), w, h};
}

// Nearest valid depth in the cell; 0 where there is none.
float cell_depth(const DepthImage& depth, int cx, int cy, int cell) {
  const int x = cx * cell + cell / 2, y = cy * cell + cell / 2;
  for (const auto& [dx, dy] : {std::pair{0, 0}, {-1, 0}, {0, -1}, {1, 0}, {0, 1}, {-1, -1}, {1, 1}}) {
    if (!depth.contains(x + dx, y + dy)) continue;
    if (const float d = depth(x + dx, y + dy); d > 0) return d;
  }
  return 0;
}

// Depth of the nearest layer that fills enough of the core, weighted toward the centre; 0 when the core has no depth.
float object_depth(const Image<float>& grid, const CellRange& core) {
  struct Sample {
    float depth, weight;
  };
  std::vector<Sample> samples;
  const float mx = 0.5f * static_cast<float>(core.x0 + core.x1 - 1),
              my = 0.5f * static_cast<float>(core.y0 + core.y1 - 1);
  const float sx = std::max(1.0f, 0.5f * static_cast<float>(core.x1 - core.x0)),
              sy = std::max(1.0f, 0.5f * static_cast<float>(core.y1 - core.y0));
  float total = 0;
  for (int y = core.y0; y < core.y1; ++y)
    for (int x = core.x0; x < core.x1; ++x) {
      const float d = grid(x, y);
      if (!(d > 0)) continue;
      const float u = (static_cast<float>(x) - mx) / sx, v = (static_cast<float>(y) - my) / sy;
      const float w = std::exp(-(u * u + 0.5f * v * v));
      samples.push_back({d, w});
      total += w;
    }
  if (samples.empty()) return 0;
  std::sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.depth < b.depth; });
  // Slide a window of the layer's width from near to far; the first local maximum that is heavy enough wins.
  const float ratio = static_cast<float>((1 + kRelativeLayer) / (1 - kRelativeLayer));
  const auto far_side = [&](float d) { return std::min(d * ratio, d + static_cast<float>(2 * kHalfDepth)); };
  const float needed = static_cast<float>(kMinShare) * total;
  float weight = 0, best_weight = 0, best_depth = samples[samples.size() / 2].depth;
  size_t end = 0;
  for (size_t begin = 0; begin < samples.size(); ++begin) {
    while (end < samples.size() && samples[end].depth <= far_side(samples[begin].depth))
      weight += samples[end++].weight;
    if (weight > best_weight) {
      best_weight = weight;
      best_depth = 0.5f * (samples[begin].depth + samples[end - 1].depth);
    } else if (best_weight >= needed && samples[begin].depth > best_depth) {
      break;  // past the nearest heavy layer
    }
    weight -= samples[begin].weight;
  }
  return best_depth;
}

struct Cell {
  int x, y;
};

bool is_in(const CellRange& r, int x, int y) {
  return x >= r.x0 && y >= r.y0 && x < r.x1 && y < r.y1;
}

// Whether one surface goes on between two cells of depths `a` and `b`, which allow for the jumps given [m].
bool joined(float a, float b, float jump_a, float jump_b) {
  return std::abs(a - b) <= std::min(jump_a, jump_b);  // that of the nearer one
}

// What hangs together in depth within a range of cells. Each cell is given out once.
class Surfaces {
 public:
  Surfaces(const Image<float>& depth, const Image<float>& jump, const CellRange& cells)
      : range(cells), depth_(depth), jump_(jump), seen_(depth.width(), depth.height()) {}

  // The seeds and all that hangs together with them and is `wanted`.
  std::vector<Cell> grow(std::vector<Cell> cells, const auto& wanted) {
    for (const Cell& c : cells) seen_(c.x, c.y) = 1;
    for (size_t i = 0; i < cells.size(); ++i) {
      const auto [x, y] = cells[i];
      const float d = depth_(x, y), jump = jump_(x, y);
      for (const auto& [dx, dy] : kBeside) {
        const Cell n{x + dx, y + dy};
        if (!inside(n) || seen_(n.x, n.y) || !wanted(n.x, n.y)) continue;
        if (!joined(d, depth_(n.x, n.y), jump, jump_(n.x, n.y))) continue;
        seen_(n.x, n.y) = 1;
        cells.push_back(n);
      }
    }
    return cells;
  }
  bool inside(const Cell& c) const { return is_in(range, c.x, c.y); }
  bool seen(int x, int y) const { return seen_(x, y) != 0; }

  static constexpr std::array<Cell, 4> kBeside{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
  const CellRange range;

 private:
  const Image<float>& depth_;
  const Image<float>& jump_;
  Image<uint8_t> seen_;
};

// A limb stands before or behind the rest, so that depth steps between them. Unlike the background it ends within the
// box: surfaces in reach that lie beside the object and do not go on beyond the box are part of it.
void add_limbs(Surfaces& surfaces, const auto& within_depth, Image<uint8_t>& mine) {
  const CellRange& r = surfaces.range;
  const auto at_side = [&](const Cell& c) {
    return (c.x == r.x0 && c.x > 0) || (c.y == r.y0 && c.y > 0) || (c.x == r.x1 - 1 && c.x < mine.width() - 1) ||
           (c.y == r.y1 - 1 && c.y < mine.height() - 1);
  };
  std::vector<Cell> limbs;
  for (int y = r.y0; y < r.y1; ++y)
    for (int x = r.x0; x < r.x1; ++x) {
      if (surfaces.seen(x, y) || !within_depth(x, y)) continue;
      const std::vector<Cell> surface = surfaces.grow({{x, y}}, within_depth);
      if (std::any_of(surface.begin(), surface.end(), at_side)) continue;
      const bool beside = std::any_of(surface.begin(), surface.end(), [&](const Cell& c) {
        return std::any_of(Surfaces::kBeside.begin(), Surfaces::kBeside.end(), [&](const Cell& d) {
          const Cell n{c.x + d.x, c.y + d.y};
          return surfaces.inside(n) && mine(n.x, n.y);
        });
      });
      if (beside) limbs.insert(limbs.end(), surface.begin(), surface.end());
    }
  for (const Cell& c : limbs) mine(c.x, c.y) = 255;
}

// Cells of `box` that are reached sooner from its middle, along what is `near_layer`, than from the cells around it.
void add_body(const Image<float>& grid, const Image<float>& jump, const CellRange& box, const CellRange& middle,
              const auto& near_layer, Image<uint8_t>& body) {
  enum Owner : uint8_t { nobody, object, surroundings, no_depth };
  const int width = box.x1 - box.x0 + 2, height = box.y1 - box.y0 + 2;  // with a ring around the box
  std::vector<uint8_t> owners(static_cast<size_t>(width) * static_cast<size_t>(height), no_depth);
  std::vector<float> depths(owners.size()), jumps(owners.size());
  std::vector<int> reached;
  int waiting = 0;  // cells of the object among them that are still to be gone on from
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const int x = box.x0 + u - 1, y = box.y0 + v - 1, i = v * width + u;
      if (!grid.contains(x, y) || !(grid(x, y) > 0)) continue;
      uint8_t& owner = owners[static_cast<size_t>(i)];
      depths[static_cast<size_t>(i)] = grid(x, y);
      jumps[static_cast<size_t>(i)] = jump(x, y);
      owner = !is_in(box, x, y) ? surroundings : is_in(middle, x, y) && near_layer(grid(x, y)) ? object : nobody;
      if (owner != nobody) reached.push_back(i);
      waiting += owner == object ? 1 : 0;
    }
  const std::array<int, 4> beside{-1, 1, -width, width};
  for (size_t k = 0; waiting > 0; ++k) {
    const int i = reached[k];
    const auto here = static_cast<size_t>(i);
    const uint8_t owner = owners[here];
    if (owner == object) --waiting, body(box.x0 + i % width - 1, box.y0 + i / width - 1) = 255;
    for (const int step : beside) {
      // A step to the left or right out of the ring ends in the ring, whose cells are given out.
      if (i + step < 0 || i + step >= width * height) continue;
      const auto n = static_cast<size_t>(i + step);
      if (owners[n] != nobody || !joined(depths[here], depths[n], jumps[here], jumps[n])) continue;
      if (owner == object && !near_layer(depths[n])) continue;
      owners[n] = owner;
      reached.push_back(static_cast<int>(n));
      waiting += owner == object ? 1 : 0;
    }
  }
}

// Holes of the depth image: a cell without depth belongs to the object unless most of its known neighbours do not. What
// is too near for the camera has no depth at all, and in a box that is the object.
void add_holes(const Image<float>& grid, const Image<uint8_t>& mine, const CellRange& range, Image<uint8_t>& mask) {
  constexpr int kAround = 3;  // [cells] to all sides that a hole's neighbours lie
  // Known cells of each column around the row at work: those of the object less the others.
  std::vector<int> sides(static_cast<size_t>(range.x1 - range.x0) + 2 * kAround);
  const auto add_row = [&](int v, int sign) {
    if (v < range.y0 || v >= range.y1) return;
    int* const side = sides.data() + kAround;
    const float* const known = grid.row(v) + range.x0;
    const uint8_t* const object = mine.row(v) + range.x0;
    for (int k = 0; k < range.x1 - range.x0; ++k) side[k] += known[k] > 0 ? (object[k] != 0 ? sign : -sign) : 0;
  };
  for (int v = range.y0; v < range.y0 + kAround; ++v) add_row(v, 1);
  for (int y = range.y0; y < range.y1; ++y) {
    add_row(y + kAround, 1);
    add_row(y - kAround - 1, -1);
    for (int x = range.x0; x < range.x1; ++x) {
      if (grid(x, y) > 0 || mine(x, y)) continue;
      const int* const first = sides.data() + (x - range.x0);
      if (std::accumulate(first, first + 2 * kAround + 1, 0) >= 0) mask(x, y) = 255;
    }
  }
}

}  // namespace

Silhouettes silhouettes(const DepthImage& depth, std::span<const Detection> boxes, const Camera& camera,
                        const SensorNoise& noise, const SilhouetteOptions& options) {
  Silhouettes made;
  MoverMask& mask = made.mask;
  mask.cell = made.body.cell = kMaskCell;
  if (boxes.empty()) return made;
  const int columns = (depth.width() + kMaskCell - 1) / kMaskCell, rows = (depth.height() + kMaskCell - 1) / kMaskCell;
  mask.cells = made.body.cells = Image<uint8_t>(columns, rows);
  constexpr float kNotLookedAt = -1;
  Image<float> grid(columns, rows, kNotLookedAt), jump(columns, rows);
  for (const Detection& detection : boxes) {
    const CellRange range = cells_of(scaled(detection.box, 1 + 2 * kWidening), kMaskCell, columns, rows);
    const CellRange core = cells_of(scaled(detection.box, kCore), kMaskCell, columns, rows);
    for (int y = std::max(range.y0 - 1, 0); y < std::min(range.y1 + 1, rows); ++y)
      for (int x = std::max(range.x0 - 1, 0); x < std::min(range.x1 + 1, columns); ++x)
        if (grid(x, y) == kNotLookedAt) {
          grid(x, y) = cell_depth(depth, x, y, kMaskCell);
          jump(x, y) = static_cast<float>(noise.max_depth_jump(grid(x, y), kMaskCell, camera.fx));
        }
    const float layer = object_depth(grid, core);
    if (!(layer > 0)) {
      for (int y = range.y0; y < range.y1; ++y)
        for (int x = range.x0; x < range.x1; ++x) mask.cells(x, y) = 255;
      continue;
    }
    Image<uint8_t> mine(columns, rows);
    Surfaces surfaces{grid, jump, range};
    const auto near_layer = [&](float z, double tolerance) {
      return z > 0 && std::fabs(z - layer) <= static_cast<float>(tolerance);
    };
    const auto within_depth = [&](int x, int y) { return near_layer(grid(x, y), options.max_depth_offset); };
    std::vector<Cell> seeds;
    for (int y = core.y0; y < core.y1; ++y)
      for (int x = core.x0; x < core.x1; ++x)
        if (near_layer(grid(x, y), std::min(kRelativeLayer * layer, kHalfDepth))) seeds.push_back({x, y});
    for (const Cell& c : surfaces.grow(std::move(seeds), within_depth)) mine(c.x, c.y) = 255;
    add_limbs(surfaces, within_depth, mine);
    const double half_depth = std::min(kHalfDepth, options.max_depth_offset);
    add_body(
        grid, jump, cells_of(detection.box, kMaskCell, columns, rows),
        cells_of(scaled(detection.box, kMiddle), kMaskCell, columns, rows),
        [&](float z) { return near_layer(z, half_depth); }, made.body.cells);
    add_holes(grid, mine, range, mask.cells);
    for (int y = range.y0; y < range.y1; ++y)
      for (int x = range.x0; x < range.x1; ++x)
        if (mine(x, y) || made.body.cells(x, y)) mask.cells(x, y) = 255;
  }
  dilate(mask, options.rim);
  return made;
}

}  // namespace dkb
