// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb_slam/viewer.h"

namespace dkb {

// A symbol of libdkb_viewer.so. Throws InputError, which begins with `what` needs it.
void* viewer_symbol(const char* name, const std::string& what);

// Throws nothing: when it returns null, `error` says why. The symbol's number changes with what crosses this border.
using OpenViewer = Viewer* (*)(const ViewerOptions& options, std::string* error);
inline constexpr const char* kOpenViewerSymbol = "dkb_open_viewer_3";

}  // namespace dkb
