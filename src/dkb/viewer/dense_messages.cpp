// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/dense_messages.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "dkb/viewer/map_deltas.h"

namespace dkb {
namespace {

constexpr size_t kMaxVertices = 60000;  // numbered by 16 bits
constexpr float kFirstCell = 0.03F;     // [m]

SurfaceMesh clustered(const SurfaceMesh& mesh, float cell) {
  struct Sum {
    int32_t index = 0;
    int count = 0;
    Eigen::Vector3f position = Eigen::Vector3f::Zero();
    std::array<int, 3> colour{};
  };
  std::map<std::array<int, 3>, Sum> cells;
  std::vector<const Sum*> of_vertex;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f at = mesh.vertices[i] / cell;
    const auto floor = [](float v) { return static_cast<int>(std::floor(v)); };
    Sum& sum = cells[{floor(at.x()), floor(at.y()), floor(at.z())}];
    if (sum.count++ == 0) sum.index = static_cast<int32_t>(cells.size()) - 1;
    sum.position += mesh.vertices[i];
    const Rgb c = mesh.colours[i];
    sum.colour = {sum.colour[0] + c.r, sum.colour[1] + c.g, sum.colour[2] + c.b};
    of_vertex.push_back(&sum);
  }
  SurfaceMesh result;
  result.vertices.resize(cells.size());
  result.colours.resize(cells.size());
  for (const auto& [place, sum] : cells) {
    const auto i = static_cast<size_t>(sum.index);
    result.vertices[i] = sum.position / static_cast<float>(sum.count);
    const auto mean = [n = sum.count](int v) { return static_cast<uint8_t>(v / n); };
    result.colours[i] = {mean(sum.colour[0]), mean(sum.colour[1]), mean(sum.colour[2])};
  }
  std::set<std::array<int32_t, 3>> triangles;
  for (const std::array<int32_t, 3>& t : mesh.triangles) {
    std::array<int32_t, 3> corners{};
    for (size_t k = 0; k < 3; ++k) corners[k] = of_vertex[static_cast<size_t>(t[k])]->index;
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    triangles.insert(corners);
  }
  result.triangles.assign(triangles.begin(), triangles.end());
  return result;
}

void put_surface(StreamWriter& m, const SurfaceMesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& v : mesh.vertices) box.extend(v);
  const Eigen::Vector3f middle = box.center();
  const float unit = std::max(0.001F, box.sizes().maxCoeff() / 2 / 32000);
  for (int k = 0; k < 3; ++k) m.put(middle[k]);
  m.put(unit);
  m.put(static_cast<uint32_t>(mesh.vertices.size()));
  m.put(static_cast<uint32_t>(mesh.triangles.size()));
  for (const Eigen::Vector3f& v : mesh.vertices)
    for (int k = 0; k < 3; ++k) m.put(static_cast<int16_t>(std::lround((v[k] - middle[k]) / unit)));
  m.pad();
  for (const Rgb& c : mesh.colours)
    for (const uint8_t v : {c.r, c.g, c.b, uint8_t{0}}) m.put(v);
  for (const auto& t : mesh.triangles)
    for (const int32_t corner : t) m.put(static_cast<uint16_t>(corner));
}

void put_grid(StreamWriter& m, const OccupancyGrid& grid) {
  for (const double v : {grid.cell, grid.origin_x, grid.origin_y}) m.put(static_cast<float>(v));
  for (int i = 0; i < 4; ++i) m.put(static_cast<float>(grid.floor_from_world.rotation.coeffs()[i]));
  for (int i = 0; i < 3; ++i) m.put(static_cast<float>(grid.floor_from_world.translation[i]));
  m.put(static_cast<uint32_t>(grid.cells.width()));
  m.put(static_cast<uint32_t>(grid.cells.height()));
  const uint8_t* cells = grid.cells.data();
  for (size_t i = 0; i < grid.cells.size();) {
    size_t end = i + 1;
    while (end < grid.cells.size() && cells[end] == cells[i] && end - i < 65535) ++end;
    m.put(static_cast<uint16_t>(end - i));
    m.put<uint16_t>(cells[i]);
    i = end;
  }
}

}  // namespace

SurfaceMesh coarser(const SurfaceMesh& mesh, size_t max_vertices) {
  if (mesh.vertices.size() <= max_vertices) return mesh;
  for (float cell = kFirstCell;; cell *= 1.4F) {
    SurfaceMesh result = clustered(mesh, cell);
    if (result.vertices.size() <= max_vertices) return result;
  }
}

std::string dense_messages(const DenseMap& map, int root) {
  StreamWriter out;
  if (!map.mesh.vertices.empty())
    out.message(StreamMessage::surface, [&](StreamWriter& m) {
      m.put<int32_t>(root);
      put_surface(m, coarser(map.mesh, kMaxVertices));
    });
  if (map.grid)
    out.message(StreamMessage::grid, [&](StreamWriter& m) {
      m.put<int32_t>(root);
      put_grid(m, *map.grid);
    });
  return std::move(out.bytes());
}

}  // namespace dkb
