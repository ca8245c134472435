// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/surface_mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include "dkb/map/byte_stream.h"
#include "dkb/util/disjoint_sets.h"

namespace dkb {
namespace {

constexpr int kSide = VoxelBlock::kSide;
constexpr int kPadded = kSide + 1;
constexpr int32_t kNoVertex = -1;

// A block's voxels and the first ones of the blocks after it.
class PaddedBlock {
 public:
  PaddedBlock(const TsdfVolume& volume, const VoxelBlock& block) {
    for (int corner = 0; corner < 8; ++corner) {
      const int dx = corner & 1, dy = corner >> 1 & 1, dz = corner >> 2;
      const int at = corner == 0 ? -2 : volume.find({block.index.x + dx, block.index.y + dy, block.index.z + dz});
      const VoxelBlock* source = corner == 0 ? &block : at < 0 ? nullptr : &volume.blocks()[static_cast<size_t>(at)];
      for (int z = dz * kSide; z < kSide + dz; ++z)
        for (int y = dy * kSide; y < kSide + dy; ++y)
          for (int x = dx * kSide; x < kSide + dx; ++x)
            slot(x, y, z) = source == nullptr
                                ? nullptr
                                : &source->voxels[static_cast<size_t>(VoxelBlock::at(x % kSide, y % kSide, z % kSide))];
    }
  }
  // Null when it is not known.
  const Voxel* known(int x, int y, int z) const {
    const Voxel* v = voxels_[index(x, y, z)];
    return v != nullptr && v->known ? v : nullptr;
  }

 private:
  static size_t index(int x, int y, int z) { return static_cast<size_t>((z * kPadded + y) * kPadded + x); }
  const Voxel*& slot(int x, int y, int z) { return voxels_[index(x, y, z)]; }
  std::array<const Voxel*, kPadded * kPadded * kPadded> voxels_{};
};

using CellVertices = std::array<int32_t, VoxelBlock::kVoxels>;  // of the cells whose first corner is in a block

// The vertex of a cell that the surface cuts.
bool cell_vertex(const PaddedBlock& block, int x, int y, int z, Eigen::Vector3f* position, Rgb* colour) {
  std::array<const Voxel*, 8> corners;
  int inside = 0;
  for (int c = 0; c < 8; ++c) {
    const Voxel* v = block.known(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
    if (v == nullptr) return false;
    corners[static_cast<size_t>(c)] = v;
    inside += v->distance < 0 ? 1 : 0;
  }
  if (inside == 0 || inside == 8) return false;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  int cuts = 0;
  for (int a = 0; a < 8; ++a)
    for (int axis = 0; axis < 3; ++axis) {
      const int b = a | 1 << axis;
      if (b == a) continue;
      const float da = corners[static_cast<size_t>(a)]->distance, db = corners[static_cast<size_t>(b)]->distance;
      if ((da < 0) == (db < 0)) continue;
      Eigen::Vector3f cut(static_cast<float>(a & 1), static_cast<float>(a >> 1 & 1), static_cast<float>(a >> 2));
      cut[axis] = da / (da - db);
      sum += cut;
      ++cuts;
    }
  *position = sum / static_cast<float>(cuts);
  int r = 4, g = 4, b = 4;
  for (const Voxel* v : corners) r += v->colour.r, g += v->colour.g, b += v->colour.b;
  *colour = {static_cast<uint8_t>(r / 8), static_cast<uint8_t>(g / 8), static_cast<uint8_t>(b / 8)};
  return true;
}

// Looks up vertices of cells that may lie one before a block.
class CellLookup {
 public:
  CellLookup(const TsdfVolume& volume, const std::vector<CellVertices>& vertices, size_t block) : vertices_(vertices) {
    const VoxelIndex& i = volume.blocks()[block].index;
    for (int n = 0; n < 8; ++n)
      blocks_[static_cast<size_t>(n)] =
          n == 0 ? static_cast<int>(block) : volume.find({i.x - (n & 1), i.y - (n >> 1 & 1), i.z - (n >> 2)});
  }
  int32_t operator()(int x, int y, int z) const {
    const int n = (x < 0 ? 1 : 0) | (y < 0 ? 2 : 0) | (z < 0 ? 4 : 0);
    const int block = blocks_[static_cast<size_t>(n)];
    if (block < 0) return kNoVertex;
    const int at = VoxelBlock::at((x + kSide) % kSide, (y + kSide) % kSide, (z + kSide) % kSide);
    return vertices_[static_cast<size_t>(block)][static_cast<size_t>(at)];
  }

 private:
  const std::vector<CellVertices>& vertices_;
  std::array<int, 8> blocks_{};
};

void add_quad(const std::array<int32_t, 4>& q, bool flip, SurfaceMesh* mesh) {
  const auto at = [&](size_t i) -> const Eigen::Vector3f& { return mesh->vertices[static_cast<size_t>(q[i])]; };
  const auto add = [&](size_t a, size_t b, size_t c) {
    mesh->triangles.push_back(flip ? std::array{q[a], q[c], q[b]} : std::array{q[a], q[b], q[c]});
  };
  // Along the shorter diagonal.
  if ((at(0) - at(2)).squaredNorm() <= (at(1) - at(3)).squaredNorm()) {
    add(0, 1, 2);
    add(0, 2, 3);
  } else {
    add(0, 1, 3);
    add(1, 2, 3);
  }
}

}  // namespace

SurfaceMesh extract_surface(const TsdfVolume& volume) {
  SurfaceMesh mesh;
  const auto& blocks = volume.blocks();
  std::vector<CellVertices> vertices(blocks.size());
  const auto voxel = static_cast<float>(volume.voxel());
  for (size_t b = 0; b < blocks.size(); ++b) {
    vertices[b].fill(kNoVertex);
    const PaddedBlock padded(volume, blocks[b]);
    const VoxelIndex& index = blocks[b].index;
    for (int z = 0; z < kSide; ++z)
      for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
          Eigen::Vector3f in_cell;
          Rgb colour;
          if (!cell_vertex(padded, x, y, z, &in_cell, &colour)) continue;
          vertices[b][static_cast<size_t>(VoxelBlock::at(x, y, z))] = static_cast<int32_t>(mesh.vertices.size());
          const Eigen::Vector3f cell(static_cast<float>(index.x * kSide + x), static_cast<float>(index.y * kSide + y),
                                     static_cast<float>(index.z * kSide + z));
          mesh.vertices.push_back(voxel * (cell + in_cell));
          mesh.colours.push_back(colour);
        }
  }
  for (size_t b = 0; b < blocks.size(); ++b) {
    const PaddedBlock padded(volume, blocks[b]);
    const CellLookup cell(volume, vertices, b);
    for (int z = 0; z < kSide; ++z)
      for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
          const Voxel* from = padded.known(x, y, z);
          if (from == nullptr) continue;
          for (int axis = 0; axis < 3; ++axis) {
            const int dx = axis == 0, dy = axis == 1, dz = axis == 2;
            const Voxel* to = padded.known(x + dx, y + dy, z + dz);
            if (to == nullptr || (from->distance < 0) == (to->distance < 0)) continue;
            // The cells around this edge, counter-clockwise as seen from its end.
            const int px = axis == 2, py = axis == 0, pz = axis == 1;  // next axis
            const int qx = axis == 1, qy = axis == 2, qz = axis == 0;  // the one after
            const std::array<int32_t, 4> quad{cell(x - px - qx, y - py - qy, z - pz - qz), cell(x - qx, y - qy, z - qz),
                                              cell(x, y, z), cell(x - px, y - py, z - pz)};
            if (quad[0] < 0 || quad[1] < 0 || quad[2] < 0 || quad[3] < 0) continue;
            add_quad(quad, to->distance < 0, &mesh);
          }
        }
  }
  return mesh;
}

SurfaceMesh without_small_parts(const SurfaceMesh& mesh, double min_area) {
  DisjointSets joined(mesh.vertices.size());
  const auto part = [&](const auto& triangle) { return joined.first_of(static_cast<size_t>(triangle[0])); };
  for (const auto& t : mesh.triangles)
    for (size_t i = 1; i < 3; ++i) joined.join(static_cast<size_t>(t[0]), static_cast<size_t>(t[i]));
  std::vector<double> area(mesh.vertices.size(), 0);
  for (const auto& t : mesh.triangles) {
    const auto at = [&](size_t i) -> const Eigen::Vector3f& { return mesh.vertices[static_cast<size_t>(t[i])]; };
    area[part(t)] += 0.5 * static_cast<double>((at(1) - at(0)).cross(at(2) - at(0)).norm());
  }
  SurfaceMesh result;
  std::vector<int32_t> renamed(mesh.vertices.size(), kNoVertex);
  for (const auto& t : mesh.triangles) {
    if (area[part(t)] < min_area) continue;
    for (int32_t v : t) renamed[static_cast<size_t>(v)] = 0;
  }
  for (size_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == kNoVertex) continue;
    renamed[v] = static_cast<int32_t>(result.vertices.size());
    result.vertices.push_back(mesh.vertices[v]);
    result.colours.push_back(mesh.colours[v]);
  }
  for (const auto& t : mesh.triangles) {
    const auto name = [&](size_t i) { return renamed[static_cast<size_t>(t[i])]; };
    if (name(0) != kNoVertex) result.triangles.push_back({name(0), name(1), name(2)});
  }
  return result;
}

std::string mesh_ply(const SurfaceMesh& mesh) {
  const std::string header = fmt::format(
      "ply\n"
      "format binary_little_endian 1.0\n"
      "comment surface of the still world by dkb-slam; metres\n"
      "element vertex {}\n"
      "property float x\n"
      "property float y\n"
      "property float z\n"
      "property uchar red\n"
      "property uchar green\n"
      "property uchar blue\n"
      "element face {}\n"
      "property list uchar int vertex_indices\n"
      "end_header\n",
      mesh.vertices.size(), mesh.triangles.size());
  ByteWriter out;
  out.reserve(header.size() + 15 * mesh.vertices.size() + 13 * mesh.triangles.size());
  out.raw(header);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    for (int i = 0; i < 3; ++i) out.f32(mesh.vertices[v][i]);
    for (uint8_t channel : {mesh.colours[v].r, mesh.colours[v].g, mesh.colours[v].b}) out.u8(channel);
  }
  for (const auto& t : mesh.triangles) {
    out.u8(3);
    for (int32_t v : t) out.i32(v);
  }
  return out.take();
}

}  // namespace dkb
