// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/viewer_module.h"

#include "dkb/util/errors.h"
#include "dkb/util/module.h"

namespace dkb {

void* viewer_symbol(const char* name, const std::string& what) {
  std::string reason;
  const Module module{"libdkb_viewer.so", DKB_MODULE_LIBDIR, {DKB_VIEWER_BUILD_DIR, DKB_MODULE_INSTALL_DIR}};
  void* symbol = module_symbol(module, name, &reason);
  if (symbol == nullptr)
    throw InputError(what + ": this build has no libdkb_viewer.so (" + reason + "); install it beside the library");
  return symbol;
}

std::unique_ptr<Viewer> open_viewer(const ViewerOptions& options) {
  const auto open =
      reinterpret_cast<OpenViewer>(viewer_symbol(kOpenViewerSymbol, options.port ? "viewer" : "recording"));
  ViewerRefusal refusal;
  std::unique_ptr<Viewer> viewer(open(options, &refusal));
  if (viewer != nullptr) return viewer;
  if (refusal.output) throw OutputError(refusal.reason);
  throw InputError(refusal.reason);
}

}  // namespace dkb
