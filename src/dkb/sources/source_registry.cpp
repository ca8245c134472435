// SPDX-License-Identifier: Apache-2.0
#include "dkb/sources/source_registry.h"

#include "dkb/util/errors.h"

namespace dkb {
namespace {

SourceKind folder_kind() {
  SourceKind kind;
  kind.name = "folder", kind.form = "FOLDER";
  kind.fits = [](const std::string&) { return true; };
  kind.open = [](const std::string& where, const SourceOptions& options) { return open_folder(where, options); };
  return kind;
}

}  // namespace

std::vector<SourceKind> source_kinds() {
  return {folder_kind()};
}

std::unique_ptr<Source> open_source(const std::string& where, const SourceOptions& options) {
  for (const SourceKind& kind : source_kinds()) {
    if (!kind.fits(where)) continue;
    if (const std::string missing = kind.why_not(); !missing.empty()) throw InputError(where + ": " + missing);
    return kind.open(where, options);
  }
  throw InputError(where + ": no kind of source takes this; `dkb-slam sources` lists them");
}

}  // namespace dkb
