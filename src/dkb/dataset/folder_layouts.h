// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/tum_dataset.h"

namespace dkb {

// A recorded sequence in a folder, in one of the layouts that published datasets come in.
struct FolderLayout {
  TumDataset dataset;
  std::optional<CameraChoice> camera;  // where the layout tells it; a camera.yaml beside the data goes before it
  bool fit_colour = false;             // colour is larger than depth and is to be brought to its size
};

// Tells the layout by what lies in the folder, in this order:
//   TUM, Bonn, ICL-NUIM   associations.txt, or rgb.txt and depth.txt
//   OpenLORIS             color.txt and aligned_depth.txt; sensors.yaml
//   7-Scenes              frame-000000.color.png, frame-000000.depth.png
//   Replica               results/frame000000.jpg, results/depth000000.png; cam_params.json here or above
//   ScanNet, exported     color/0.jpg, depth/0.png, intrinsic/intrinsic_color.txt
//   TUM without lists     rgb, color or image/1305031102.175304.png, depth/1305031102.160407.png
//   Redwood, Open3D       color, image or rgb/000000.jpg, depth/000000.png; camera_intrinsic.json or intrinsic.json
// Images that are numbered instead of stamped are 1/30 s apart. Throws InputError with file and line, and where nothing
// fits what TUM's layout lacks.
FolderLayout open_folder_layout(const std::filesystem::path& folder);

// Whether one of these layouts lies there. A folder `results`, `depth` or `rgb` alone makes none.
bool has_folder_layout(const std::filesystem::path& folder);

}  // namespace dkb
