// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/ort_library.h"

#include <dlfcn.h>

#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "dkb/util/module.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

constexpr const char* kLibrary = "libonnxruntime.so.1";
constexpr const char* kEntry = "OrtGetApiBase";
constexpr unsigned kInterface = 14;  // version of the interface that is asked for: ONNX Runtime 1.14 and newer have it

struct Base {
  const OrtTable::Function* (*interface)(uint32_t version);  // null when the library has not got that version
  const char* (*version)();                                  // of the library: "1.20.1"
};

const char* named_library() {
  const char* name = std::getenv("DKB_ONNXRUNTIME");
  return name == nullptr || *name == 0 ? nullptr : name;
}

void* entry_of(const std::string& file, std::string* reason) {
  void* loaded = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* entry = loaded == nullptr ? nullptr : dlsym(loaded, kEntry);
  const char* error = entry == nullptr ? dlerror() : nullptr;
  if (error != nullptr) *reason = one_line(error);
  return entry;
}

void* find_entry(std::string* reason) {
  if (const char* name = named_library()) {
    std::error_code ignored;
    return entry_of(fs::is_directory(name, ignored) ? (fs::path(name) / kLibrary).string() : name, reason);
  }
  if (void* entry = module_symbol({kLibrary, DKB_MODULE_LIBDIR, {DKB_ONNXRUNTIME_DIR}}, kEntry, reason)) return entry;
  std::string ignored;
  return entry_of(kLibrary, &ignored);
}

}  // namespace

bool onnxruntime_is_named() {
  return named_library() != nullptr;
}

std::optional<OrtLibrary> load_onnxruntime(std::string* reason) {
  void* entry = find_entry(reason);
  if (entry == nullptr) return std::nullopt;
  const Base* base = reinterpret_cast<const Base* (*)()>(entry)();
  const std::string version = base == nullptr ? "unknown" : excerpt(base->version());
  Dl_info info{};
  const bool placed = dladdr(entry, &info) != 0 && info.dli_fname != nullptr;
  const std::string name = std::string(placed ? info.dli_fname : kLibrary) + " of version " + version;
  unsigned minor = 0;
  const bool numbered = version.starts_with("1.") &&
                        std::from_chars(version.data() + 2, version.data() + version.size(), minor).ec == std::errc();
  // Asked for a version that it has not got, the library would print.
  const OrtTable::Function* table = numbered && minor >= kInterface ? base->interface(kInterface) : nullptr;
  if (table == nullptr) {
    *reason = name + " has not got version " + std::to_string(kInterface) + " of the interface, which ONNX Runtime 1." +
              std::to_string(kInterface) + " and newer have";
    return std::nullopt;
  }
  return OrtLibrary{name, {table}};
}

}  // namespace dkb
