// SPDX-License-Identifier: Apache-2.0
// How good the dense map of a simulated sequence is: distance of the mesh to the true still surfaces, and how much of
// it belongs to people; which cells of the grid beside it (occupancy.pgm) are free though something stands in them. And
// pictures of meshes.
//
//   dkb-slam simulate --scene crowd --out crowd && dkb-slam run crowd --dense --out run ...
//   dense_bench run/dense.ply run/trajectory.txt crowd     (the simulator draws scene crowd again, seed 1)
//   dense_bench run/dense.ply run/trajectory.txt crowd picture.png EYE_X EYE_Y EYE_Z AT_X AT_Y AT_Z
//
// Eye and target are in the world of the run: x right, y down, z forward as the first camera saw it. With "-" for the
// scene only the picture is made.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <nanoflann.hpp>
#include <sstream>
#include <unordered_set>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/dense/dense_options.h"
#include "dkb/dense/surface_mesh.h"
#include "dkb/simulator/simulator.h"
#include "dkb/util/files.h"
#include "figures.h"

namespace dkb {
namespace {

constexpr int kFrameStep = 8;             // of the frames that are drawn again
constexpr double kPersonDistance = 0.15;  // [m] how far a walker gets within half of that, and more
constexpr double kGhost = 0.06;           // [m] from all still surfaces

// Reads what mesh_ply() wrote.
SurfaceMesh read_mesh(const std::string& file) {
  const std::string bytes = read_file(file), end = "end_header\n";
  const auto number = [&](const std::string& key) { return std::stoul(bytes.substr(bytes.find(key) + key.size())); };
  SurfaceMesh mesh;
  mesh.vertices.resize(number("element vertex "));
  mesh.colours.resize(mesh.vertices.size());
  mesh.triangles.resize(number("element face "));
  const char* p = bytes.data() + bytes.find(end) + end.size();
  for (size_t v = 0; v < mesh.vertices.size(); ++v, p += 15) {
    std::memcpy(mesh.vertices[v].data(), p, 12);
    std::memcpy(&mesh.colours[v], p + 12, 3);
  }
  for (auto& t : mesh.triangles) std::memcpy(t.data(), p + 1, 12), p += 13;
  return mesh;
}

struct Points {
  std::vector<Eigen::Vector3f> at;
  size_t kdtree_get_point_count() const { return at.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return at[i][static_cast<Eigen::Index>(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>, Points, 3>;

double distance_to(const Tree& tree, const Eigen::Vector3f& p) {
  if (tree.dataset.at.empty()) return 1e9;
  size_t index = 0;
  float squared = 0;
  nanoflann::KNNResultSet<float> result(1);
  result.init(&index, &squared);
  tree.findNeighbors(result, p.data(), nanoflann::SearchParams());
  return std::sqrt(static_cast<double>(squared));
}

// Points, one in each cube of a side [m].
class ThinnedPoints {
 public:
  explicit ThinnedPoints(float side) : side_(side) {}
  void add(const Eigen::Vector3f& p) {
    const Eigen::Array3i i = (p.array() / side_).floor().cast<int>() + (1 << 20);
    const uint64_t key =
        static_cast<uint64_t>(i.x()) << 42 | static_cast<uint64_t>(i.y()) << 21 | static_cast<uint64_t>(i.z());
    if (taken_.insert(key).second) points.at.push_back(p);
  }
  Points points;

 private:
  float side_;
  std::unordered_set<uint64_t> taken_;
};

Rigid3 truth_from_run(const Trajectory& estimated, const Simulator& simulator) {
  std::vector<std::pair<Rigid3, Rigid3>> pairs;  // world_from_cam of the run, of the truth
  for (const StampedPose& p : estimated)
    for (int i = 0; i < simulator.frames(); ++i)
      if (std::abs(simulator.stamp(i) - p.timestamp) < 1e-4)
        pairs.emplace_back(p.world_from_cam, simulator.world_from_cam(simulator.stamp(i) - simulator.stamp(0)));
  return registration(pairs);
}

// What run --dense wrote of a grid. Cells are counted as in the image: row 0 is the largest y.
OccupancyGrid read_grid(const std::filesystem::path& folder) {
  OccupancyGrid grid;
  std::istringstream image(read_file(folder / "occupancy.pgm"));
  std::string magic;
  int width = 0, height = 0, largest = 0;
  image >> magic >> width >> height >> largest;
  image.get();
  grid.cells = Image<uint8_t>(width, height);
  image.read(reinterpret_cast<char*>(grid.cells.data()), static_cast<std::streamsize>(grid.cells.size()));
  std::string yaml = read_file(folder / "occupancy.yaml");
  std::replace_if(
      yaml.begin(), yaml.end(), [](char c) { return c == '[' || c == ']' || c == ','; }, ' ');
  const auto after = [&](const std::string& key) {
    return std::istringstream(yaml.substr(yaml.find(key) + key.size()));
  };
  after("resolution:") >> grid.cell;
  after("origin:") >> grid.origin_x >> grid.origin_y;
  Eigen::Vector3d t;
  Eigen::Quaterniond q;
  after("\nfloor_from_world:") >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
  grid.floor_from_world = Rigid3(q, t);
  return grid;
}

void measure_grid(const OccupancyGrid& grid, const Points& still, const Points& people,
                  const Rigid3& world_from_truth) {
  constexpr int kStands = 20;    // points of a surface, 6 mm apart, that stand in a cell
  constexpr double kRim = 0.05;  // [m] by which heights that count as an obstacle's are more or fewer
  const DenseOptions options;
  const auto count = [&](const Points& points, double rim) {
    Image<int> cells(grid.cells.width(), grid.cells.height());
    for (const Eigen::Vector3f& p : points.at) {
      const Eigen::Vector3d q = grid.floor_from_world * (world_from_truth * p.cast<double>());
      const int x = static_cast<int>(std::floor((q.x() - grid.origin_x) / grid.cell));
      const int y = cells.height() - 1 - static_cast<int>(std::floor((q.y() - grid.origin_y) / grid.cell));
      const bool high = q.z() > options.obstacle_low - rim && q.z() < options.obstacle_high + rim;
      if (high && cells.contains(x, y)) ++cells(x, y);
    }
    return cells;
  };
  const Image<int> inside = count(still, -kRim), around = count(still, kRim), persons = count(people, kRim);
  int solid = 0, solid_free = 0, occupied = 0, nothing = 0, person = 0;
  for (size_t i = 0; i < grid.cells.size(); ++i) {
    const uint8_t cell = grid.cells.data()[i];
    if (inside.data()[i] >= kStands) ++solid, solid_free += cell == OccupancyGrid::kFree;
    if (cell != OccupancyGrid::kOccupied) continue;
    ++occupied;
    if (around.data()[i] > 0) continue;
    ++nothing;
    person += persons.data()[i] > 0;
  }
  fmt::print(
      "{} cells that something stands in, {} of them free; {} occupied, {} of them by nothing that stands still, "
      "{} by people\n",
      solid, solid_free, occupied, nothing, person);
}

void measure(const SurfaceMesh& mesh, const Trajectory& estimated, const std::string& scene,
             const std::filesystem::path& folder) {
  SimulatorOptions options;
  options.scene = scene;
  const Simulator simulator(options);
  const Rigid3 truth_from_world = truth_from_run(estimated, simulator);
  ThinnedPoints still(0.006F), people(0.02F);
  for (int i = 0; i < simulator.frames(); i += kFrameStep) {
    const SimulatedFrame f = simulator.render(i);
    for (int y = 0; y < f.true_depth.height(); ++y)
      for (int x = 0; x < f.true_depth.width(); ++x) {
        const auto z = static_cast<double>(f.true_depth(x, y));
        if (z <= 0 || z > 6) continue;
        const Eigen::Vector3f p = (f.world_from_cam * simulator.camera().unproject({x, y}, z)).cast<float>();
        // The mask's outline is that of a rolling shutter; the depth's is not.
        bool all = true, any = false;
        for (int v = std::max(0, y - 6); v <= std::min(f.mask.height() - 1, y + 6); v += 6)
          for (int u = std::max(0, x - 6); u <= std::min(f.mask.width() - 1, x + 6); u += 6) {
            all &= f.mask(u, v) != 0;
            any |= f.mask(u, v) != 0;
          }
        if (!any) still.add(p);
        if (all) people.add(p);
      }
  }
  const Tree still_tree(3, still.points), people_tree(3, people.points);
  std::vector<double> errors;
  size_t ghosts = 0, person = 0;
  for (const Eigen::Vector3f& v : mesh.vertices) {
    const Eigen::Vector3f p = (truth_from_world * v.cast<double>()).cast<float>();
    const double error = distance_to(still_tree, p);
    errors.push_back(error);
    if (error < kGhost) continue;
    ++ghosts;
    person += distance_to(people_tree, p) < kPersonDistance ? 1 : 0;
  }
  const double count = std::max<double>(1, static_cast<double>(errors.size()));
  fmt::print("{} occupied voxels; surface error median {:.1f} mm, 90% {:.1f} mm, 99% {:.1f} mm\n", errors.size(),
             1e3 * percentile(errors, 0.5), 1e3 * percentile(errors, 0.9), 1e3 * percentile(errors, 0.99));
  fmt::print("{:.3f}% more than {:.0f} cm from any still surface; {:.3f}% people\n",
             100 * static_cast<double>(ghosts) / count, 100 * kGhost, 100 * static_cast<double>(person) / count);
  if (std::filesystem::exists(folder / "occupancy.pgm"))
    measure_grid(read_grid(folder), still.points, people.points, truth_from_world.inverse());
}

// The mesh in its colours under a lamp at the eye.
ColourImage draw(const SurfaceMesh& mesh, const Eigen::Vector3f& eye, const Eigen::Vector3f& target) {
  const int width = 960, height = 600;
  const float focal = 620;
  const Eigen::Vector3f forward = (target - eye).normalized(),
                        right = Eigen::Vector3f(0, 1, 0).cross(forward).normalized();
  Eigen::Matrix3f cam_from_world;
  cam_from_world << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  ColourImage image(width, height, {255, 255, 255});
  Image<float> nearest(width, height, 0.0F);
  for (const auto& t : mesh.triangles) {
    std::array<Eigen::Vector3f, 3> p, colour;
    bool front = true;
    for (size_t i = 0; i < 3; ++i) {
      p[i] = cam_from_world * (mesh.vertices[static_cast<size_t>(t[i])] - eye);
      const Rgb c = mesh.colours[static_cast<size_t>(t[i])];
      colour[i] = {static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
      front &= p[i].z() > 0.1F;
    }
    if (!front) continue;
    const Eigen::Vector3f normal = (p[1] - p[0]).cross(p[2] - p[0]);
    const float facing = -normal.dot(p[0]) / (normal.norm() * p[0].norm() + 1e-12F);
    if (facing <= 0) continue;  // from behind walls are left out: one looks into the room
    std::array<Eigen::Vector2f, 3> q;
    for (size_t i = 0; i < 3; ++i)
      q[i] = {focal * p[i].x() / p[i].z() + width / 2.0F, focal * p[i].y() / p[i].z() + height / 2.0F};
    const auto cross = [](const Eigen::Vector2f& a, const Eigen::Vector2f& b) { return a.x() * b.y() - a.y() * b.x(); };
    const float area = cross(q[1] - q[0], q[2] - q[0]);
    if (std::abs(area) < 1e-9F) continue;
    const int x0 = std::max(0, static_cast<int>(std::min({q[0].x(), q[1].x(), q[2].x()})));
    const int x1 = std::min(width - 1, static_cast<int>(std::max({q[0].x(), q[1].x(), q[2].x()})) + 1);
    const int y0 = std::max(0, static_cast<int>(std::min({q[0].y(), q[1].y(), q[2].y()})));
    const int y1 = std::min(height - 1, static_cast<int>(std::max({q[0].y(), q[1].y(), q[2].y()})) + 1);
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2f at(static_cast<float>(x), static_cast<float>(y));
        const float a = cross(q[1] - at, q[2] - at) / area, b = cross(q[2] - at, q[0] - at) / area, c = 1 - a - b;
        if (a < -1e-4F || b < -1e-4F || c < -1e-4F) continue;
        const float inverse = a / p[0].z() + b / p[1].z() + c / p[2].z();
        if (inverse <= nearest(x, y)) continue;
        nearest(x, y) = inverse;
        const Eigen::Vector3f shade = (0.45F + 0.55F * facing) * (a * colour[0] + b * colour[1] + c * colour[2]);
        const auto byte = [](float v) { return static_cast<uint8_t>(std::clamp(v, 0.0F, 255.0F)); };
        image(x, y) = {byte(shade.x()), byte(shade.y()), byte(shade.z())};
      }
  }
  return image;
}

}  // namespace
}  // namespace dkb

int main(int argc, char** argv) {
  if (argc != 4 && argc != 11) {
    fmt::print(stderr, "usage: dense_bench MESH TRAJECTORY SCENE [PICTURE EYE_X EYE_Y EYE_Z AT_X AT_Y AT_Z]\n");
    return 2;
  }
  const dkb::SurfaceMesh mesh = dkb::read_mesh(argv[1]);
  if (std::string(argv[3]) != "-")
    dkb::measure(mesh, dkb::read_trajectory(argv[2]), argv[3], std::filesystem::path(argv[1]).parent_path());
  if (argc == 4) return 0;
  const auto vector = [&](int at) {
    return Eigen::Vector3f(std::stof(argv[at]), std::stof(argv[at + 1]), std::stof(argv[at + 2]));
  };
  dkb::write_image_file(argv[4], dkb::encode_png(dkb::draw(mesh, vector(5), vector(8)), 9));
  return 0;
}
