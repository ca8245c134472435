// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace dkb {

// The page's files, bundled from web/ when the project is built. Null when there is none of that path.
struct PageFile {
  std::string_view path, type, bytes;
};
const PageFile* page_file(std::string_view path);

}  // namespace dkb
