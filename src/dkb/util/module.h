// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dkb {

// Modules: our own shared libraries that are loaded when they are needed, so that a program starts without what they
// are linked with.
struct Module {
  std::string file;                            // its file's name, e.g. "libdkb_onnx.so"
  std::string libdir;                          // of an installation, relative to the folder above its programs: "lib"
  std::vector<std::filesystem::path> folders;  // where else it may be; empty ones do not count
};

// The address of `symbol` in the module's file beside the program or shared library that this code was linked into,
// else in the installation's `libdir`, else in the first of the folders; null when it is in none, and then `reason`
// says why in one line. A module is never closed: threads and statics of what it is linked with outlive any use.
void* module_symbol(const Module& module, const std::string& symbol, std::string* reason);

}  // namespace dkb
