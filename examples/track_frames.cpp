// SPDX-License-Identifier: Apache-2.0
// A camera loop of one's own: prints the pose of every frame.  track_frames FOLDER, in TUM layout with a camera.yaml.
#include <dkb_slam/slam.h>
#include <dkb_slam/source.h>

#include <cstdio>

int main(int argc, char** argv) try {
  if (argc != 2) throw dkb::InputError("usage: track_frames FOLDER");
  const auto source = dkb::open_folder(argv[1]);  // in the place of a camera's driver
  dkb::Slam slam(source->camera());
  for (dkb::SourceFrame next; (next = source->next()).state != dkb::SourceState::ended;) {
    if (next.state != dkb::SourceState::frame) continue;  // a pair that cannot be read
    dkb::FrameInput input;
    input.stamp_ns = next.frame.stamp_ns();
    input.colour = next.frame.grey();  // views of the driver's memory: any size of row, rgb8, bgr8, grey8 ...
    if (!next.frame.colour().empty()) input.colour = next.frame.colour();
    input.depth = next.frame.depth();  // registered to the colour image: depth_u16 or, as here, depth_f32
    input.depth_stamp_ns = next.frame.depth_stamp_ns();

    const dkb::FrameResult result = slam.process(input);  // tracks on this thread, maps on another one
    if (!result.tracked()) continue;
    const Eigen::Vector3d at = result.world_from_cam->translation;
    std::printf("%.3f s: %+.3f %+.3f %+.3f m, %d points\n", 1e-9 * static_cast<double>(result.stamp_ns), at.x(), at.y(),
                at.z(), result.inliers);
  }
  slam.finish();  // what mapping still has to do
  const dkb::Statistics all = slam.statistics();
  std::printf("tracked %d of %d frames, %zu map points\n", all.tracked, all.frames, slam.map().point_count());
  return all.frames > 0 && all.tracked == all.frames ? 0 : 1;
} catch (const dkb::InputError& error) {
  std::fprintf(stderr, "error: %s\n", error.what());
  return 2;
}
