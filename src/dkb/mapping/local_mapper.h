// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/keyframe_packet.h"
#include "dkb/map/map.h"
#include "dkb/mapping/local_bundle_adjustment.h"
#include "dkb/mapping/map_correction.h"
#include "dkb/mapping/planes.h"
#include "dkb/mapping/point_creation.h"
#include "dkb/matching/optics.h"
#include "dkb/util/timing.h"

namespace dkb {

struct MappingOptions {
  double redundant_share = 0.9;  // a keyframe is culled when this share of its points is seen well elsewhere, 0 ... 1
  LocalBaOptions ba;
};

struct MappingReport {
  int points_created = 0, points_culled = 0, points_fused = 0, points_retracted = 0, keyframes_culled = 0;
};

// Turns keyframe packets into map: inserts, culls, creates, fuses, adjusts (DKB sections 3, 3.3). The only writer of
// the map. Deterministic: the same packets in the same order give the same map.
class LocalMapper {
 public:
  LocalMapper(const Optics& optics, const MappingOptions& options, Map map = {});

  // Works a keyframe in and returns the map as it is then.
  MapView process(const KeyframePacket& packet);
  // Works in what loop closing or global bundle adjustment found, and returns the map as it is then.
  MapView apply(const MapCorrection& correction);

  const Map& map() const { return map_; }
  const MappingReport& report() const { return report_; }
  StageTimes take_times() { return times_.take(); }  // durations since they were taken last

 private:
  void insert(const KeyframePacket& packet);
  void apply_reports(const KeyframePacket& packet);
  void cull_points(KeyframeId newest);
  void fuse_neighbours(KeyframeId id);
  void fuse_pair(PointId a, PointId b);
  int fuse_into(KeyframeId keyframe, const std::vector<PointId>& points, double tolerance = 1);
  void cull_keyframes(KeyframeId newest);
  // A keyframe that shows nothing: the way past it remains.
  void cull_if_empty(KeyframeId id);
  void refresh(const std::vector<PointId>& points);

  Optics optics_;
  MappingOptions options_;
  PlaneRecogniser planes_;
  Map map_;
  std::vector<PointId> young_;  // points on probation
  MappingReport report_;
  StageTimes times_;
};

// Recomputes normal, representative descriptor and scale of a point from its observations.
void refresh_point(Map& map, PointId id, double scale_factor);

}  // namespace dkb
