// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb_slam/viewer.h"

namespace dkb {

// A symbol of libdkb_viewer.so. Throws InputError, which begins with `what` needs it.
void* viewer_symbol(const char* name, const std::string& what);

// Why there is no viewer. Exceptions do not cross this border, so it tells their kind.
struct ViewerRefusal {
  std::string reason;
  bool output = false;  // an OutputError, else an InputError
};

// Throws nothing: when it returns null, `refusal` says why. The symbol's number changes with what crosses this border.
using OpenViewer = Viewer* (*)(const ViewerOptions& options, ViewerRefusal* refusal);
inline constexpr const char* kOpenViewerSymbol = "dkb_open_viewer_5";

}  // namespace dkb
