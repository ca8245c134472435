// SPDX-License-Identifier: Apache-2.0
#include "dense_output.h"

#include <fmt/format.h>

#include <vector>

#include "dkb/dynamics/silhouette.h"
#include "dkb/util/files.h"

namespace dkb {

namespace {

DenseOptions options_of(const SlamOptions& options) {
  DenseOptions dense = options.dense;
  if (!options.pipeline.threaded) dense.threads = 1;
  return dense;
}

}  // namespace

DenseOutput::DenseOutput(const SlamSystem& slam)
    : mapper_(slam.camera(), slam.options().noise, options_of(slam.options())) {}

void DenseOutput::note(const RgbdImage& image, const FrameResult& result, const SlamSystem& slam) {
  for (const LateMask& late : result.late_masks) mapper_.remove_movers(late.frame, late.mask);
  if (!result.keyframe) return;
  const Stopwatch watch;
  // People who stand still are fit to track by, but no part of the map.
  MoverMask movers = slam.mover_mask();
  unite(movers, silhouettes(image.depth, slam.detections(), slam.options().dynamics.silhouette), image.depth.width(),
        image.depth.height());
  mapper_.add_keyframe(result.frame, image, movers);
  times_.add("dense_keyframe", watch.ms());
}

std::string DenseOutput::write(const std::filesystem::path& folder, const SlamSystem& slam) {
  const Stopwatch watch;
  std::vector<TimedPose> poses;
  for (const TrajectoryFrame& f : slam.trajectory())
    if (f.map == 0) poses.push_back({f.timestamp, f.world_from_cam});
  const DenseMap map = mapper_.build(poses, slam.options().seed);
  times_.add("dense_build", watch.ms());
  write_file_atomically(folder / "dense.ply", mesh_ply(map.mesh));
  std::string line = fmt::format("dense map: {} keyframes, {} triangles, {:.1f} s", map.views,
                                 map.mesh.triangles.size(), watch.ms() / 1000);
  if (!map.grid) return line + "; no floor in view: no occupancy grid";
  write_file_atomically(folder / "occupancy.pgm", occupancy_pgm(*map.grid));
  write_file_atomically(folder / "occupancy.yaml", occupancy_yaml(*map.grid, "occupancy.pgm"));
  return line;
}

}  // namespace dkb
