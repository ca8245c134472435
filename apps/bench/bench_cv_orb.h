// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "dkb/dataset/tum_dataset.h"
#include "dkb/geometry/camera.h"
#include "dkb_slam/source.h"

namespace dkb {

// The unit of times: [ms] per frame, mean, of OpenCV's ORB with 1000 features on one thread, measured in this process
// on up to 60 of the images, evenly spread. Nothing when none can be read. Throws when the module libdkb_cv_orb.so,
// which links OpenCV, was not built or does not load.
std::optional<double> measure_cv_orb(const std::vector<DatasetPair>& pairs, const CameraModel& camera);
// The same of a source that is read from its beginning, of about `pairs` pairs.
std::optional<double> measure_cv_orb(Source& source, size_t pairs);

// cv_orb.json: {"cv_orb_ms": number or null}. Throws OutputError.
void write_cv_orb(const std::filesystem::path& folder, const std::optional<double>& ms);

}  // namespace dkb
