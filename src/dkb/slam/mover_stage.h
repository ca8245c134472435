// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "dkb/dynamics/mover_tracker.h"
#include "dkb/slam/scene.h"
#include "dkb/util/side_task.h"

namespace dkb {

// Follows the movers of a frame. It looks for them beside tracking, from where the camera is expected; the pose that
// tracking finds moves what was seen. Deterministic.
class MoverStage {
 public:
  MoverStage(const Camera& camera, const SensorNoise& noise, bool threaded)
      : movers_(camera, noise),
        looking_(
            "movers", [this] { look(); }, threaded) {}

  // Begins to look at a frame where something moves.
  void begin(const Scene& scene, const std::optional<Rigid3>& world_from_cam_expected) {
    end_look();
    begun_ = world_from_cam_expected && !scene.mask.empty();
    if (!begun_) return;
    task_ = {scene.extracted.frame, scene.mask, scene.boxes, *world_from_cam_expected};
    looking_.begin();
  }
  // The movers of that frame; frames that are lost get none.
  std::vector<Mover> finish(const Scene& scene, const Rigid3& world_from_cam) {
    const RgbdImage& image = scene.extracted.image();
    if (begun_)
      end_look();
    else
      sighting_ = movers_.look(image.timestamp, image.depth, scene.mask, scene.boxes, world_from_cam);
    return movers_.update(std::move(sighting_), image.depth, world_from_cam);
  }
  // The estimated world has moved under the camera, between two frames: what was at p is at new_from_old * p.
  void rebase(const Rigid3& new_from_old) {
    end_look();
    movers_.rebase(new_from_old);
  }

 private:
  struct Task {
    Frame frame;
    MoverMask mask;
    std::vector<Detection> boxes;
    Rigid3 world_from_cam;
  };
  // Also a frame that was lost is looked at to the end: what is known of movers must not depend on how far it came.
  void end_look() {
    if (!std::exchange(begun_, false)) return;
    looking_.finish();
    task_.frame = {};  // its images are not kept longer than they are needed
  }
  void look() {
    const RgbdImage& image = *task_.frame.image();
    sighting_ = movers_.look(image.timestamp, image.depth, task_.mask, task_.boxes, task_.world_from_cam);
  }

  MoverTracker movers_;  // these three belong to looking_ while it is at work
  Task task_;
  MoverSighting sighting_;
  bool begun_ = false;
  SideTask looking_;  // last: its thread ends first
};

}  // namespace dkb
