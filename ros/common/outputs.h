// SPDX-License-Identifier: Apache-2.0
// The library's results as what ROS shows.
#pragma once

#include <dkb_slam/slam.h>

#include <string>
#include <vector>

#include "types.h"

namespace dkb_ros {

// The colour (or grey) image with its features: green = used, red = dynamic, yellow = outlier, grey = unused.
ColourImageOutput draw_features(const dkb::ImageView& image, const dkb::FrameResult& result);

// Why the images do not tell where a frame's camera is, for people; empty when they do.
std::string hindrance_of(const dkb::FrameResult& result);

// How many of the maps were loaded, or have been joined to one that was: those with a keyframe of a frame below 0. They
// are the first by number, since maps are numbered by their first keyframes. 0 where the world began anew.
int loaded_maps(const std::vector<dkb::TrajectoryFrame>& keyframes);

MoversOutput movers_of(const dkb::FrameResult& result);
CloudOutput cloud_of(const std::vector<dkb::PointInfo>& points);

// The trajectory, thinned to poses of the base at least `step` metres or 10 degrees apart; the last one stays. Only
// frames of the newest map, since maps that are not joined have worlds of their own; of the first `placed` ones where
// the others lie nobody knows where (0 = of all).
std::vector<PathOutput::Pose> path_of(const std::vector<dkb::TrajectoryFrame>& trajectory, const Rigid3& cam_from_base,
                                      double step, int placed = 0);

// The library's grid, whose axes are those of the floor, in the map's axes: what shows it ignores a grid's turn.
GridOutput grid_in_map(const dkb::OccupancyGrid& grid);

}  // namespace dkb_ros
