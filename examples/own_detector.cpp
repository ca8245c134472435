// SPDX-License-Identifier: Apache-2.0
// A detector of one's own: keeps the robot's arm out of the map.  own_detector FOLDER, in TUM layout with a
// camera.yaml.
#include <dkb_slam/slam.h>
#include <dkb_slam/source.h>

#include <cstdio>

// Whatever is nearer than half a metre may move.
class NearThings final : public dkb::Detector {
 public:
  dkb::Detections detect(const dkb::DetectorInput& image) override {
    dkb::Detections found;
    found.mask = dkb::GreyImage(image.depth.width, image.depth.height);
    for (int y = 0; y < image.depth.height; ++y) {
      const auto* depth = reinterpret_cast<const float*>(image.depth.row(y));  // [m], 0 = none
      for (int x = 0; x < image.depth.width; ++x) found.mask(x, y) = depth[x] > 0 && depth[x] < 0.5F ? 255 : 0;
    }
    return found;
  }
  std::string kind() const override { return "near things"; }
};

int main(int argc, char** argv) try {
  if (argc != 2) throw dkb::InputError("usage: own_detector FOLDER");
  const auto source = dkb::open_folder(argv[1]);
  dkb::Detectors detectors;                                    // the motion segmentation, and beside it
  detectors.prompt.push_back(std::make_shared<NearThings>());  // asked for every frame; a slow one goes to `slow`
  dkb::Slam slam(source->camera(), dkb::Options("default"), detectors);
  for (dkb::SourceFrame next; (next = source->next()).state != dkb::SourceState::ended;) {
    if (next.state == dkb::SourceState::frame) slam.process(next.frame);
  }
  slam.finish();
  const dkb::Statistics all = slam.statistics();
  std::printf("tracked %d of %d frames; %ld features rejected by: %s\n", all.tracked, all.frames, all.features_removed,
              all.detector.c_str());
  return all.frames > 0 && all.tracked == all.frames ? 0 : 1;
} catch (const dkb::InputError& error) {
  std::fprintf(stderr, "error: %s\n", error.what());
  return 2;
}
