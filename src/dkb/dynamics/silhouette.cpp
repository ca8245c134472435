// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "dkb/dynamics/depth_parts.h"
#include "dkb/features/vectorised.h"
#include "dkb/geometry/camera.h"
#include "dkb/util/radix_sort.h"

namespace dkb {
namespace {

constexpr double kCore = 0.5;      // share of the box's width and height around its centre where the object is sought
constexpr double kMinShare = 0.2;  // of the core's weight that a depth layer needs to be the object
constexpr double kRelativeLayer = 0.15;  // [1] half-width of that layer relative to its depth
constexpr float kHalfDepth = 0.3f;       // [m] and no more than half of what a body takes up along the line of sight
constexpr float kPartsReach = 0.6f;      // [m] parts of the object lie at most so far before or behind its layer
constexpr double kMiddle = 0.1;          // share of the box's width and height in which its body is sure to be
constexpr double kWidening = 0.05;       // share of the box's size by which it is widened

CellBounds cells_of(const Box& box, int cell, int columns, int rows) {
  const auto cut = [](float v, int n) { return std::clamp(static_cast<int>(std::floor(v)), 0, n); };
  const float c = static_cast<float>(cell);
  return {cut(box.x / c, columns), cut(box.y / c, rows), cut((box.x + box.w) / c + 1, columns),
          cut((box.y + box.h) / c + 1, rows)};
}

Box scaled(const Box& b, double factor) {
  const float w = b.w * static_cast<float>(factor), h = b.h * static_cast<float>(factor);
  return {b.x + 0.5f * (b.w - w), b.y + 0.5f * (b.h - h), w, h};
}

bool is_in(const CellBounds& r, int x, int y) {
  return x >= r.x0 && y >= r.y0 && x < r.x1 && y < r.y1;
}

// Nearest valid depth in the middle of the cell; 0 where there is none.
float cell_depth(const DepthImage& depth, int cell, int cx, int cy) {
  const int x = cx * cell + cell / 2, y = cy * cell + cell / 2;
  for (const auto& [dx, dy] : {std::pair{0, 0}, {-1, 0}, {0, -1}, {1, 0}, {0, 1}, {-1, -1}, {1, 1}}) {
    if (!depth.contains(x + dx, y + dy)) continue;
    if (const float d = depth(x + dx, y + dy); d > 0) return d;
  }
  return 0;
}

// The cells of a widened box and a ring around them, row by row. What lies outside the image has no depth.
struct Window {
  int image_columns, image_rows;
  CellBounds range;                  // without the ring, in the image
  int columns, rows;                 // with it
  std::vector<float> depth, jump;    // [m] and what that of a neighbour on one surface may differ by
  std::vector<uint8_t> right, down;  // 1 = on one surface with the neighbour there

  size_t at(int x, int y) const {
    return static_cast<size_t>(y - range.y0 + 1) * static_cast<size_t>(columns) + static_cast<size_t>(x - range.x0 + 1);
  }
};

Window window_around(const CellBounds& range, int image_columns, int image_rows, const DepthImage& depth,
                     const Camera& camera, const SensorNoise& noise) {
  Window w{image_columns, image_rows, range, range.x1 - range.x0 + 2, range.y1 - range.y0 + 2, {}, {}, {}, {}};
  const int cell = depth_cell(camera);
  const size_t count = static_cast<size_t>(w.columns) * static_cast<size_t>(w.rows);
  w.depth.resize(count);
  w.jump.resize(count);
  w.right.resize(count);
  w.down.resize(count);
  for (int y = std::max(range.y0 - 1, 0); y < std::min(range.y1 + 1, image_rows); ++y)
    for (int x = std::max(range.x0 - 1, 0); x < std::min(range.x1 + 1, image_columns); ++x)
      w.depth[w.at(x, y)] = cell_depth(depth, cell, x, y);
  run_vectorised(best_simd(),
                 [noise, count, cell, f = camera.fx, from = w.depth.data(), to = w.jump.data()]() DKB_KERNEL_BODY {
                   DKB_INDEPENDENT_STEPS
                   for (size_t i = 0; i < count; ++i)
                     to[i] = static_cast<float>(noise.max_depth_jump(static_cast<double>(from[i]), cell, f));
                 });
  link_cells(w.depth, w.jump, 1, w.right.data());
  link_cells(w.depth, w.jump, static_cast<size_t>(w.columns), w.down.data());
  return w;
}

// Depth of the nearest layer that fills enough of the core, weighted toward the centre; 0 when the core has no depth.
float object_depth(const Window& window, const CellBounds& core) {
  // Samples as whole numbers: the depth in millimetres and, in the lower half, its weight.
  constexpr uint32_t kOne = 0xffff;
  std::vector<uint32_t> samples;
  samples.reserve(static_cast<size_t>(std::max(0, core.x1 - core.x0)) *
                  static_cast<size_t>(std::max(0, core.y1 - core.y0)));
  const auto weights = [](int first, int last, float factor) {
    const float middle = 0.5f * static_cast<float>(first + last - 1),
                half = std::max(1.0f, 0.5f * static_cast<float>(last - first));
    std::vector<float> result;
    for (int i = first; i < last; ++i) {
      const float off = (static_cast<float>(i) - middle) / half;
      result.push_back(std::exp(-factor * off * off));
    }
    return result;
  };
  const std::vector<float> across = weights(core.x0, core.x1, 1), along = weights(core.y0, core.y1, 0.5f);
  uint64_t total = 0;
  for (int y = core.y0; y < core.y1; ++y) {
    const float* const depth = window.depth.data() + window.at(core.x0, y);
    const float weight = along[static_cast<size_t>(y - core.y0)] * static_cast<float>(kOne);
    for (size_t k = 0; k < across.size(); ++k) {
      if (!(depth[k] > 0)) continue;
      const auto w = static_cast<uint32_t>(weight * across[k]);
      const auto millimetres = static_cast<uint32_t>(std::min(1000 * depth[k] + 0.5f, static_cast<float>(kOne)));
      samples.push_back(millimetres << 16 | w);
      total += w;
    }
  }
  if (samples.empty()) return 0;
  radix_sort(samples);
  const auto depth_of = [&](size_t k) { return 0.001f * static_cast<float>(samples[k] >> 16); };
  // Slide a window of the layer's width from near to far; the first local maximum that is heavy enough wins.
  const float ratio = static_cast<float>((1 + kRelativeLayer) / (1 - kRelativeLayer));
  const auto far_side = [&](float d) { return std::min(d * ratio, d + 2 * kHalfDepth); };
  const double needed = kMinShare * static_cast<double>(total);
  uint64_t weight = 0, best_weight = 0;
  float best_depth = depth_of(samples.size() / 2);
  size_t end = 0;
  for (size_t begin = 0; begin < samples.size(); ++begin) {
    const float nearest = depth_of(begin), farthest = far_side(nearest);
    while (end < samples.size() && depth_of(end) <= farthest) weight += samples[end++] & kOne;
    if (weight > best_weight) {
      best_weight = weight;
      best_depth = 0.5f * (nearest + depth_of(end - 1));
    } else if (static_cast<double>(best_weight) >= needed && nearest > best_depth) {
      break;  // past the nearest heavy layer
    }
    weight -= samples[begin] & kOne;
  }
  return best_depth;
}

// Per cell of the window, 255: the surfaces within kPartsReach of the layer that have a cell of it in the core, and
// limbs. A limb stands before or behind the rest, so that depth steps between them. Unlike the background it ends
// within the box: surfaces in reach that lie beside the object and do not go on beyond the box are part of it.
std::vector<uint8_t> find_object(const Window& window, const CellBounds& core, float layer, float half_layer) {
  const CellBounds& range = window.range;
  std::vector<float> within(window.depth.size());
  for (int y = range.y0; y < range.y1; ++y)
    for (size_t i = window.at(range.x0, y), last = window.at(range.x1, y); i < last; ++i)
      within[i] = std::fabs(window.depth[i] - layer) <= kPartsReach ? window.depth[i] : 0;
  const std::vector<DepthPart> parts = DepthParts(window.columns, window.rows).find(within, window.jump);
  std::vector<uint8_t> mine(window.depth.size());
  const auto take = [&](const DepthPart& part) {
    for (const uint32_t i : part.cells) mine[i] = 255;
  };
  std::vector<const DepthPart*> others;
  for (const DepthPart& part : parts) {
    const bool in_core = std::any_of(part.cells.begin(), part.cells.end(), [&](uint32_t i) {
      return std::fabs(window.depth[i] - layer) <= half_layer &&
             is_in(core, static_cast<int>(i) % window.columns + range.x0 - 1,
                   static_cast<int>(i) / window.columns + range.y0 - 1);
    });
    if (in_core)
      take(part);
    else
      others.push_back(&part);
  }
  std::erase_if(others, [&](const DepthPart* part) {
    const CellBounds& b = part->bounds;
    const bool at_side = (b.x0 == 1 && range.x0 > 0) || (b.y0 == 1 && range.y0 > 0) ||
                         (b.x1 == window.columns - 1 && range.x1 < window.image_columns) ||
                         (b.y1 == window.rows - 1 && range.y1 < window.image_rows);
    if (at_side) return true;
    return std::none_of(part->cells.begin(), part->cells.end(), [&](uint32_t i) {
      return mine[i - 1] || mine[i + 1] || mine[i - static_cast<uint32_t>(window.columns)] ||
             mine[i + static_cast<uint32_t>(window.columns)];
    });
  });
  for (const DepthPart* part : others) take(*part);
  return mine;
}

// Marks the cells of `box` that are reached sooner from its middle, along what is within kHalfDepth of the layer,
// than from the cells around it.
void find_body(const Window& window, const CellBounds& box, const CellBounds& middle, float layer,
               std::vector<uint8_t>& body) {
  enum Owner : uint8_t { nobody, object, surroundings, no_depth };
  std::vector<uint8_t> owners(window.depth.size(), no_depth);
  std::vector<int> reached;
  reached.reserve(owners.size());
  int waiting = 0;  // cells of the object among them that are still to be gone on from
  const auto near_layer = [&](size_t i) { return std::fabs(window.depth[i] - layer) <= kHalfDepth; };
  for (int y = box.y0 - 1; y <= box.y1; ++y)
    for (int x = box.x0 - 1; x <= box.x1; ++x) {
      const size_t i = window.at(x, y);
      if (!(window.depth[i] > 0)) continue;
      owners[i] = !is_in(box, x, y) ? surroundings : is_in(middle, x, y) && near_layer(i) ? object : nobody;
      if (owners[i] == nobody) continue;
      reached.push_back(static_cast<int>(i));
      waiting += owners[i] == object ? 1 : 0;
    }
  for (size_t k = 0; waiting > 0; ++k) {
    const int i = reached[k];
    const auto here = static_cast<size_t>(i);
    const uint8_t owner = owners[here];
    if (owner == object) --waiting, body[here] = 255;
    const auto go_on = [&](int step, bool linked) {
      const auto n = static_cast<size_t>(i + step);
      if (!linked || owners[n] != nobody || (owner == object && !near_layer(n))) return;
      owners[n] = owner;
      reached.push_back(static_cast<int>(n));
      waiting += owner == object ? 1 : 0;
    };
    // Cells outside the image are linked to none, and those of the ring to cells that are given out.
    const auto row = static_cast<size_t>(window.columns);
    go_on(-1, here >= 1 && window.right[here - 1]);
    go_on(1, window.right[here]);
    go_on(-window.columns, here >= row && window.down[here - row]);
    go_on(window.columns, window.down[here]);
  }
}

// Holes of the depth image: a cell without depth belongs to the object unless most of its known neighbours do not. What
// is too near for the camera has no depth at all, and in a box that is the object.
void add_holes(const Window& window, const std::vector<uint8_t>& mine, Image<uint8_t>& mask) {
  constexpr int kAround = 3;  // [cells] to all sides that a hole's neighbours lie
  const CellBounds& range = window.range;
  // Known cells of each column around the row at work: those of the object less the others.
  std::vector<int> sides(static_cast<size_t>(range.x1 - range.x0) + 2 * kAround);
  const auto add_row = [&](int v, int sign) {
    if (v < range.y0 || v >= range.y1) return;
    int* const side = sides.data() + kAround;
    const float* const known = window.depth.data() + window.at(range.x0, v);
    const uint8_t* const object = mine.data() + window.at(range.x0, v);
    for (int k = 0; k < range.x1 - range.x0; ++k) side[k] += known[k] > 0 ? (object[k] != 0 ? sign : -sign) : 0;
  };
  for (int v = range.y0; v < range.y0 + kAround; ++v) add_row(v, 1);
  for (int y = range.y0; y < range.y1; ++y) {
    add_row(y + kAround, 1);
    add_row(y - kAround - 1, -1);
    const float* const known = window.depth.data() + window.at(range.x0, y);
    for (int k = 0; k < range.x1 - range.x0; ++k) {
      if (known[k] > 0) continue;
      const int* const first = sides.data() + k;
      if (std::accumulate(first, first + 2 * kAround + 1, 0) >= 0) mask(range.x0 + k, y) = 255;
    }
  }
}

}  // namespace

Silhouettes silhouettes(const DepthImage& depth, std::span<const Detection> boxes, const Camera& camera,
                        const SensorNoise& noise) {
  Silhouettes made;
  MoverMask& mask = made.mask;
  const int cell = mask.cell = made.body.cell = depth_cell(camera);
  if (boxes.empty()) return made;
  const int columns = (depth.width() + cell - 1) / cell, rows = (depth.height() + cell - 1) / cell;
  mask.cells = made.body.cells = Image<uint8_t>(columns, rows);
  for (const Detection& detection : boxes) {
    const auto part_of_box = [&](double share) { return cells_of(scaled(detection.box, share), cell, columns, rows); };
    const CellBounds range = part_of_box(1 + 2 * kWidening), core = part_of_box(kCore);
    const Window window = window_around(range, columns, rows, depth, camera, noise);
    const float layer = object_depth(window, core);
    if (!(layer > 0)) {
      for (int y = range.y0; y < range.y1; ++y)
        std::fill(mask.cells.row(y) + range.x0, mask.cells.row(y) + range.x1, 255);
      continue;
    }
    const float half_layer = std::min(static_cast<float>(kRelativeLayer) * layer, kHalfDepth);
    const std::vector<uint8_t> mine = find_object(window, core, layer, half_layer);
    add_holes(window, mine, mask.cells);
    std::vector<uint8_t> body(mine.size());
    find_body(window, part_of_box(1), part_of_box(kMiddle), layer, body);
    for (int y = range.y0; y < range.y1; ++y) {
      const size_t first = window.at(range.x0, y);
      for (int k = 0; k < range.x1 - range.x0; ++k) {
        const size_t i = first + static_cast<size_t>(k);
        uint8_t& of_body = made.body.cells.row(y)[range.x0 + k];
        of_body |= body[i];
        mask.cells.row(y)[range.x0 + k] |= static_cast<uint8_t>(mine[i] | of_body);
      }
    }
  }
  dilate(mask, kSilhouetteRim);
  return made;
}

Silhouettes without_still(Silhouettes boxed, const StillCells& still) {
  MoverMask& mask = boxed.mask;
  const std::vector<int> columns = rows_at_middle(mask.cells.width(), mask.cell, still.cell);
  for (int y = 0; y < mask.cells.height(); ++y) {
    const int v = row_at_middle(y, mask.cell, still.cell);
    if (v >= still.kinds.height()) break;
    uint8_t* const marked = mask.cells.row(y);
    uint8_t* const body = boxed.body.cells.row(y);
    const uint8_t* const kinds = still.kinds.row(v);
    for (size_t x = 0; x < columns.size(); ++x) {
      if (marked[x] == 0 || columns[x] >= still.kinds.width()) continue;
      if (kinds[columns[x]] >= (body[x] != 0 ? StillCells::witnessed : StillCells::unrefuted)) marked[x] = body[x] = 0;
    }
  }
  return boxed;
}

}  // namespace dkb
