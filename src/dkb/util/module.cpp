// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/module.h"

#include <dlfcn.h>

#include <system_error>

namespace dkb {
namespace fs = std::filesystem;
namespace {

// The folder of the program or shared library that this code was linked into.
fs::path own_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&own_folder), &info) == 0 || info.dli_fname == nullptr) return {};
  const fs::path name = info.dli_fname;  // for a program as it was called, so without a folder when found by PATH
  std::error_code error;
  const fs::path self = fs::canonical(name.has_parent_path() ? name : fs::path("/proc/self/exe"), error);
  return error ? fs::path() : self.parent_path();
}

}  // namespace

void* module_symbol(const Module& module, const std::string& symbol, std::string* reason) {
  *reason = module.file + " is not installed beside it";
  std::vector<fs::path> folders;
  if (const fs::path own = own_folder(); !own.empty()) folders = {own, (own / ".." / module.libdir).lexically_normal()};
  folders.insert(folders.end(), module.folders.begin(), module.folders.end());
  for (const fs::path& folder : folders) {
    if (folder.empty()) continue;
    const fs::path file = folder / module.file;
    void* loaded = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (loaded == nullptr) {
      const char* error = dlerror();
      std::error_code ignored;
      if (error != nullptr && fs::exists(file, ignored)) *reason = error;
      continue;
    }
    if (void* address = dlsym(loaded, symbol.c_str())) return address;
  }
  return nullptr;
}

}  // namespace dkb
