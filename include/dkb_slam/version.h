// SPDX-License-Identifier: Apache-2.0
/// \file
/// The library's version, and the mark of what a shared library shows of itself.
#pragma once

#define DKB_SLAM_VERSION_MAJOR 0
#define DKB_SLAM_VERSION_MINOR 2
#define DKB_SLAM_VERSION_PATCH 0
#define DKB_SLAM_VERSION "0.2.0"

/// Marks what users may call. Everything else is hidden in the shared library.
#define DKB_SLAM_API __attribute__((visibility("default")))

namespace dkb {

/// The version of the library that is linked, e.g. "0.2.0": compare it with DKB_SLAM_VERSION, that of the headers.
DKB_SLAM_API const char* version();

}  // namespace dkb
